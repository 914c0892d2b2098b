//! State machine of the end-to-end protection: from the statuses of single receptions to the state
//! of the communication.
//!
//! Source: AUTOSAR FO, "E2E Protocol Specification" (PRS_E2EProtocol), E2E state machine, with one
//! window size for all states and without clearing the window on the transition to INVALID.

use crate::e2e::Status;

/// Status of one reception, independent of the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProfileStatus {
    /// The data may be used.
    Ok,
    /// The last data again.
    Repeated,
    /// Out of sequence.
    WrongSequence,
    /// The data are wrong.
    Error,
    /// Nothing was received.
    NoNewData,
}

impl From<Status> for ProfileStatus {
    fn from(status: Status) -> Self {
        match status {
            Status::Ok | Status::OkSomeLost => Self::Ok,
            Status::Repeated => Self::Repeated,
            Status::WrongSequence => Self::WrongSequence,
            Status::Error => Self::Error,
            Status::NoNewData => Self::NoNewData,
        }
    }
}

/// State of the communication.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Nothing has been received.
    NoData,
    /// Data have been received, but not enough of them to be used.
    Init,
    /// The data may be used.
    Valid,
    /// Too few or too many wrong data have been received.
    Invalid,
}

/// Window and thresholds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Number of the last statuses that are counted, from 1 to 32 (WindowSize).
    pub window_size: u8,
    /// Least number of good statuses for the transition from INIT to VALID (MinOkStateInit). It must
    /// not be less than `min_ok_valid`.
    pub min_ok_init: u8,
    /// Greatest number of errors in INIT (MaxErrorStateInit).
    pub max_error_init: u8,
    /// Least number of good statuses in VALID (MinOkStateValid).
    pub min_ok_valid: u8,
    /// Greatest number of errors in VALID (MaxErrorStateValid).
    pub max_error_valid: u8,
    /// Least number of good statuses for the transition from INVALID to VALID (MinOkStateInvalid).
    pub min_ok_invalid: u8,
    /// Greatest number of errors for that transition (MaxErrorStateInvalid).
    pub max_error_invalid: u8,
}

/// The state machine of one receiver.
///
/// ```
/// use shared_model::e2e_state_machine::{Config, ProfileStatus, State, StateMachine};
/// let config = Config {
///     window_size: 3,
///     min_ok_init: 2,
///     max_error_init: 1,
///     min_ok_valid: 2,
///     max_error_valid: 0,
///     min_ok_invalid: 3,
///     max_error_invalid: 0,
/// };
/// let mut machine = StateMachine::new();
/// use ProfileStatus::{Error, NoNewData, Ok};
/// let states = [NoNewData, Ok, Ok, Ok, Error, Ok, Ok, Ok];
/// let states = states.map(|status| machine.check(&config, status));
/// use State::{Init, Invalid, NoData, Valid};
/// assert_eq!(states, [NoData, Init, Init, Valid, Invalid, Invalid, Invalid, Valid]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateMachine {
    /// The good statuses of the window, one bit each, the last in the lowest bit. A status that is
    /// neither good nor an error is in neither word, like a place not filled yet.
    ok: u32,
    /// The errors of the window.
    error: u32,
    state: State,
}

impl StateMachine {
    /// In NODATA.
    pub const fn new() -> Self {
        Self {
            ok: 0,
            error: 0,
            state: State::NoData,
        }
    }

    /// The present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Takes the status of the next reception, due in every cycle; returns the state after it.
    // In line: the configuration is a constant, whose numbers then need no memory.
    #[inline(always)]
    pub fn check(&mut self, config: &Config, status: ProfileStatus) -> State {
        self.state = match self.state {
            State::NoData => match status {
                ProfileStatus::Error | ProfileStatus::NoNewData => State::NoData,
                _ => State::Init,
            },
            State::Init => {
                let (ok, errors) = self.add(config, status);
                if errors > config.max_error_init.into() {
                    State::Invalid
                } else if ok >= config.min_ok_init.into() {
                    State::Valid
                } else {
                    State::Init
                }
            }
            State::Valid => {
                let (ok, errors) = self.add(config, status);
                let is_valid =
                    errors <= config.max_error_valid.into() && ok >= config.min_ok_valid.into();
                if is_valid {
                    State::Valid
                } else {
                    State::Invalid
                }
            }
            State::Invalid => {
                let (ok, errors) = self.add(config, status);
                let is_valid =
                    errors <= config.max_error_invalid.into() && ok >= config.min_ok_invalid.into();
                if is_valid {
                    State::Valid
                } else {
                    State::Invalid
                }
            }
        };
        self.state
    }

    /// Puts a status into the window; returns the numbers of good statuses and of errors in it.
    #[inline(always)]
    fn add(&mut self, config: &Config, status: ProfileStatus) -> (u32, u32) {
        let window = u32::MAX.wrapping_shr(u32::BITS.wrapping_sub(config.window_size.into()));
        let is = |one: ProfileStatus| u32::from(status == one);
        self.ok = (self.ok << 1 | is(ProfileStatus::Ok)) & window;
        self.error = (self.error << 1 | is(ProfileStatus::Error)) & window;
        (self.ok.count_ones(), self.error.count_ones())
    }
}

impl Default for StateMachine {
    fn default() -> Self {
        Self::new()
    }
}
