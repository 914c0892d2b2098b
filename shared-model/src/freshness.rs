//! Freshness of sensor frames, by challenge and echo.
//!
//! Checksum and counter of a frame show that it is whole and in sequence, not when it was sent: the
//! last 256 frames in an endless loop, or frames whose delay grows slowly, pass both. Each actuator
//! frame therefore carries a challenge, and each sensor frame returns the challenge of the last valid
//! actuator frame that the vehicle received. The ECU compares it with those that it sent, which gives
//! the age of the frame, the way of the challenge to the vehicle included.
//!
//! The low four bits of a challenge are its number modulo 16, one challenge in a control tick; they
//! give the age. The high four bits are a nibble of a pseudo-random sequence. An echo from another
//! turn of the number has the right nibble with a probability of 1/16, so that a replay is not
//! accepted for long: its stale frames are errors for the
//! [state machine](crate::e2e_state_machine).

/// Start of the generator; any number except zero.
const SEED: u32 = 0x5A01_5A02;
/// Bits of a nibble.
const NIBBLE_BITS: u32 = 4;
const NIBBLE: u8 = 0xF;

/// The end that sends challenges and checks their echoes.
///
/// ```
/// use shared_model::freshness::Challenger;
/// let mut challenger = Challenger::new();
/// // Before the first challenge there is no echo of one.
/// assert_eq!(challenger.age_ticks(0), None);
/// let first = challenger.challenge();
/// assert_eq!(challenger.age_ticks(first), Some(1));
/// challenger.challenge();
/// assert_eq!(challenger.age_ticks(first), Some(2));
/// assert_eq!(challenger.age_ticks(first ^ 0x10), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Challenger {
    /// State of the generator (xorshift, period 2^32 - 1).
    generator: u32,
    /// Number of the last challenge, modulo 16.
    number: u8,
    /// Number of challenges since the start, up to [`MAX_AGE_TICKS`](Self::MAX_AGE_TICKS).
    sent: u8,
    /// Nibbles of the last 16 challenges, the last in the low bits.
    nibbles: u64,
}

impl Challenger {
    /// Greatest age that four bits distinguish, control ticks.
    pub const MAX_AGE_TICKS: u32 = 15;

    /// No challenge has been sent.
    pub const fn new() -> Self {
        Self {
            generator: SEED,
            number: 0,
            sent: 0,
            nibbles: 0,
        }
    }

    /// The challenge of a control tick. Call it once per control tick, after the check of the echo.
    pub fn challenge(&mut self) -> u8 {
        self.generator ^= self.generator << 13;
        self.generator ^= self.generator >> 17;
        self.generator ^= self.generator << 5;
        let nibble = (self.generator >> (u32::BITS - NIBBLE_BITS)) as u8;
        self.nibbles = self.nibbles << NIBBLE_BITS | u64::from(nibble);
        self.number = self.number.wrapping_add(1) & NIBBLE;
        self.sent = self.sent.saturating_add(1).min(Self::MAX_AGE_TICKS as u8);
        nibble << NIBBLE_BITS | self.number
    }

    /// Control ticks since the tick whose challenge is `echo`, from 1; `None` if it is none of the
    /// last 15.
    pub fn age_ticks(&self, echo: u8) -> Option<u32> {
        // The last challenge is one tick old in the tick that checks its echo.
        let age = self.number.wrapping_add(1).wrapping_sub(echo) & NIBBLE;
        let behind = u32::from(age.wrapping_sub(1) & NIBBLE);
        let sent = (self.nibbles >> (NIBBLE_BITS * behind)) as u8 & NIBBLE;
        let is_known = age >= 1 && age <= self.sent && sent == echo >> NIBBLE_BITS;
        is_known.then_some(age.into())
    }
}

impl Default for Challenger {
    fn default() -> Self {
        Self::new()
    }
}
