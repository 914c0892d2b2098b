//! Reception of sensor frames: end-to-end check, freshness, state of the communication.

use crate::e2e::{Receiver, Status};
use crate::e2e_state_machine::{ProfileStatus, State, StateMachine};
use crate::exchange::FrameBytes;
use crate::frame::{MAX_DELTA_COUNTER, SENSOR_DATA_ID, SENSOR_STATE_MACHINE, challenge_echo};
use crate::freshness::Challenger;

/// Result of the reception in a control tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Received {
    /// Status of the end-to-end check.
    pub status: Status,
    /// A frame that passed the end-to-end check is not fresh.
    pub is_stale: bool,
    /// The communication is invalid.
    pub is_invalid: bool,
    /// Age of the frame, control ticks, if its content may be used.
    pub usable_age_ticks: Option<u32>,
}

/// The receiving end of the sensor frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reception {
    receiver: Receiver,
    challenger: Challenger,
    state_machine: StateMachine,
    /// Counter of the last frame that was used.
    counter: u8,
}

impl Reception {
    /// Nothing has been received.
    pub fn new() -> Self {
        Self {
            receiver: Receiver::new(SENSOR_DATA_ID, MAX_DELTA_COUNTER),
            challenger: Challenger::new(),
            state_machine: StateMachine::new(),
            counter: u8::MAX,
        }
    }

    /// Checks the reception of a control tick; a frame older than `max_age_ticks` is stale. A frame
    /// that is whole and fresh may be used while the communication is valid.
    pub fn check(&mut self, frame: Option<&FrameBytes>, max_age_ticks: u32) -> Received {
        let status = self.receiver.check(frame);
        let whole = frame.filter(|_| status.is_ok());
        let age_ticks = whole
            .and_then(|frame| self.challenger.age_ticks(challenge_echo(frame)))
            .filter(|&age_ticks| age_ticks <= max_age_ticks);
        let is_stale = whole.is_some() && age_ticks.is_none();
        let profile_status = if is_stale {
            ProfileStatus::Error
        } else {
            status.into()
        };
        let state = self
            .state_machine
            .check(&SENSOR_STATE_MACHINE, profile_status);
        let usable_age_ticks = age_ticks.filter(|_| state == State::Valid);
        if usable_age_ticks.is_some() {
            self.counter = self.receiver.counter();
        }
        Received {
            status,
            is_stale,
            is_invalid: state == State::Invalid,
            usable_age_ticks,
        }
    }

    /// The challenge for the next actuator frame; once per control tick, after the check.
    pub fn challenge(&mut self) -> u8 {
        self.challenger.challenge()
    }

    /// Counter of the last frame that was used; 255 before the first.
    pub fn counter(&self) -> u8 {
        self.counter
    }
}
