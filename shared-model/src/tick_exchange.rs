//! The exchange once per control tick: duty codes and bridge of all its PWM periods in one message.
//!
//! The duty that is captured on the servo's pin is then the ECU's own, so this exchange has no
//! faults after the pin; the one per PWM period (module `exchange`) has. A tick has at most
//! [`MAX_RATIO`] periods, and the length of its message is that of its periods:
//!
//! | bytes | content |
//! |---|---|
//! | 2 | number of PWM periods |
//! | 1 + 24 | "a frame follows", actuator frame (zeros without one) |
//! | 2 + 2 | cost of the PWM task, cost of the control task |
//! | 2 + 1 per period | duty code, "the bridge is on" |

use crate::MAX_RATIO;
use crate::exchange::{FRAME_LEN, FrameBytes, Packet, ToHost};

const FRAME_AT: usize = 2;
const COSTS_AT: usize = FRAME_AT + 1 + FRAME_LEN;
const PERIODS_AT: usize = COSTS_AT + 2 + 2;
/// Bytes of a PWM period.
const PERIOD_LEN: usize = 2 + 1;
/// Longest message of the ECU, bytes.
pub const MAX_TICK_TO_HOST_LEN: usize = PERIODS_AT + PERIOD_LEN * MAX_RATIO as usize;
/// Length of the message to the ECU, bytes: "a frame follows", sensor frame, "the run is over".
pub const TICK_TO_ECU_LEN: usize = 1 + FRAME_LEN + 1;

/// The ECU's message of a control tick, gathered period by period.
#[derive(Debug, Clone)]
pub struct TickToHost {
    bytes: [u8; MAX_TICK_TO_HOST_LEN],
    length: usize,
}

impl TickToHost {
    /// Without a period.
    pub const fn new() -> Self {
        Self {
            bytes: [0; MAX_TICK_TO_HOST_LEN],
            length: PERIODS_AT,
        }
    }

    /// Adds a PWM period before the last of its tick. Periods beyond [`MAX_RATIO`] are dropped.
    pub fn push(&mut self, packet: &Packet) {
        let [low, high] = packet.duty_code.to_le_bytes();
        if let Some([a, b, bridge_on]) = self.bytes.get_mut(self.length..self.length + PERIOD_LEN) {
            (*a, *b, *bridge_on) = (low, high, packet.bridge_on.into());
            self.length += PERIOD_LEN;
        }
    }

    /// Adds the last period, which has the frame and the costs; returns the message's bytes, and
    /// begins the next one.
    pub fn finish(&mut self, last: &ToHost) -> &[u8] {
        self.push(&last.packet);
        let length = core::mem::replace(&mut self.length, PERIODS_AT);
        let periods = ((length - PERIODS_AT) / PERIOD_LEN) as u16;
        self.bytes[..FRAME_AT].copy_from_slice(&periods.to_le_bytes());
        let frame = &last.packet.frame;
        self.bytes[FRAME_AT] = frame.is_some().into();
        self.bytes[FRAME_AT + 1..COSTS_AT].copy_from_slice(&frame.unwrap_or([0; FRAME_LEN]));
        let [a, b] = last.pwm_cost.to_le_bytes();
        let [c, d] = last.control_cost.to_le_bytes();
        self.bytes[COSTS_AT..PERIODS_AT].copy_from_slice(&[a, b, c, d]);
        self.bytes.get(..length).unwrap_or(&[])
    }

    /// Length of the whole message that begins with `bytes`; `None` while they are too few.
    pub fn length(bytes: &[u8]) -> Option<usize> {
        let periods = u16::from_le_bytes([*bytes.first()?, *bytes.get(1)?]);
        Some(PERIODS_AT + PERIOD_LEN * usize::from(periods))
    }

    /// The periods of a message, one after another: the last has the frame and the costs.
    /// Nothing if the message is not whole.
    ///
    /// ```
    /// use shared_model::exchange::{Packet, ToHost};
    /// use shared_model::tick_exchange::TickToHost;
    /// let first = Packet { duty_code: 1250, bridge_on: true, frame: None };
    /// let last = Packet { duty_code: 1251, bridge_on: false, frame: Some([7; 24]) };
    /// let mut tick = TickToHost::new();
    /// tick.push(&first);
    /// let last = ToHost { packet: last, pwm_cost: 3, control_cost: 4 };
    /// let bytes = tick.finish(&last);
    /// assert_eq!(TickToHost::length(bytes), Some(bytes.len()));
    /// let periods: Vec<ToHost> = TickToHost::periods(bytes).collect();
    /// assert_eq!(periods.len(), 2);
    /// assert_eq!((periods[0].packet, periods[1]), (first, last));
    /// ```
    pub fn periods(bytes: &[u8]) -> impl Iterator<Item = ToHost> {
        let is_whole = Self::length(bytes) == Some(bytes.len());
        let (head, codes) = bytes.split_at_checked(PERIODS_AT).unwrap_or((bytes, &[]));
        let (codes, _) = codes.as_chunks::<PERIOD_LEN>();
        let codes = if is_whole { codes } else { &[] };
        let byte = |at: usize| head.get(at).copied().unwrap_or(0);
        let number = move |at: usize| u16::from_le_bytes([byte(at), byte(at + 1)]);
        let frame = (byte(FRAME_AT) != 0).then(|| core::array::from_fn(|i| byte(FRAME_AT + 1 + i)));
        let (pwm_cost, control_cost) = (number(COSTS_AT), number(COSTS_AT + 2));
        codes
            .iter()
            .enumerate()
            .map(move |(index, &[low, high, bridge_on])| {
                let is_last = index + 1 == codes.len();
                ToHost {
                    packet: Packet {
                        duty_code: u16::from_le_bytes([low, high]),
                        bridge_on: bridge_on != 0,
                        frame: frame.filter(|_| is_last),
                    },
                    pwm_cost: if is_last { pwm_cost } else { 0 },
                    control_cost: if is_last { control_cost } else { 0 },
                }
            })
    }
}

impl Default for TickToHost {
    fn default() -> Self {
        Self::new()
    }
}

/// The message to the ECU at a control tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TickToEcu {
    /// Sensor frame; `None` if it was lost.
    pub frame: Option<FrameBytes>,
    /// The run is over.
    pub stop: bool,
}

impl TickToEcu {
    /// Its bytes.
    ///
    /// ```
    /// use shared_model::tick_exchange::TickToEcu;
    /// let answer = TickToEcu { frame: Some([7; 24]), stop: true };
    /// assert_eq!(TickToEcu::decode(&answer.encode()), answer);
    /// ```
    pub fn encode(&self) -> [u8; TICK_TO_ECU_LEN] {
        let mut bytes = [0; TICK_TO_ECU_LEN];
        if let Some(frame) = &self.frame {
            bytes[0] = 1;
            bytes[1..=FRAME_LEN].copy_from_slice(frame);
        }
        bytes[FRAME_LEN + 1] = self.stop.into();
        bytes
    }

    /// Reads its bytes.
    pub fn decode(bytes: &[u8; TICK_TO_ECU_LEN]) -> Self {
        let mut frame = [0; FRAME_LEN];
        frame.copy_from_slice(&bytes[1..=FRAME_LEN]);
        Self {
            frame: (bytes[0] != 0).then_some(frame),
            stop: bytes[FRAME_LEN + 1] != 0,
        }
    }
}
