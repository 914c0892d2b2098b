//! The state machine of the end-to-end protection: the specification's transitions, and a second
//! implementation that counts in a list.

use ProfileStatus::{Error, NoNewData, Ok, Repeated, WrongSequence};
use State::{Init, Invalid, NoData, Valid};
use proptest::prelude::*;
use shared_model::e2e::Status;
use shared_model::e2e_state_machine::{Config, ProfileStatus, State, StateMachine};
use shared_model::frame::SENSOR_STATE_MACHINE;
use std::collections::VecDeque;

const STATUSES: [ProfileStatus; 5] = [Ok, Repeated, WrongSequence, Error, NoNewData];

const CONFIG: Config = Config {
    window_size: 6,
    min_ok_init: 3,
    max_error_init: 1,
    min_ok_valid: 3,
    max_error_valid: 2,
    min_ok_invalid: 5,
    max_error_invalid: 0,
};

/// Statuses before, and the state after each of some last ones.
type Row = (&'static [ProfileStatus], &'static [(ProfileStatus, State)]);

/// PRS_E2EProtocol, E2E state machine: for each state the statuses before, the last one, and the state
/// after it.
#[test]
fn every_transition_of_the_specification() {
    let table: [Row; 7] = [
        // NODATA: any status except ERROR and NONEWDATA begins the communication.
        (
            &[],
            &[
                (Ok, Init),
                (Repeated, Init),
                (WrongSequence, Init),
                (Error, NoData),
                (NoNewData, NoData),
            ],
        ),
        // Statuses in NODATA are not counted: neither these errors nor the first good one.
        (
            &[Error, Error, Error, Ok, Ok, Ok],
            &[(Ok, Valid), (NoNewData, Init), (Error, Init)],
        ),
        // INIT: too many errors, before enough good ones.
        (
            &[Ok, Error],
            &[
                (Error, Invalid),
                (Ok, Init),
                (NoNewData, Init),
                (WrongSequence, Init),
            ],
        ),
        // INIT: errors are checked together with the good ones.
        (&[Ok, Ok, Ok, Error], &[(Error, Invalid), (Ok, Valid)]),
        // VALID: the oldest statuses leave the window.
        (
            &[Ok, Ok, Ok, Ok, NoNewData, NoNewData, NoNewData],
            &[
                (Ok, Valid),
                (NoNewData, Invalid),
                (Error, Invalid),
                (Repeated, Invalid),
            ],
        ),
        // VALID: too many errors among enough good ones.
        (
            &[Ok, Ok, Ok, Ok, Ok, Error, Error],
            &[(Error, Invalid), (Ok, Valid), (NoNewData, Valid)],
        ),
        // INVALID: the errors must have left the window.
        (
            &[Ok, Error, Error, Ok, Ok, Ok, Ok, Ok],
            &[(Ok, Valid), (Error, Invalid), (NoNewData, Valid)],
        ),
    ];
    for (before, ends) in table {
        for &(last, after) in ends {
            let mut machine = StateMachine::new();
            assert_eq!(machine.state(), NoData);
            for &status in before {
                machine.check(&CONFIG, status);
            }
            assert_eq!(
                machine.check(&CONFIG, last),
                after,
                "{before:?}, then {last:?}"
            );
            assert_eq!(machine.state(), after);
        }
    }
}

#[test]
fn statuses_of_the_profile_are_mapped() {
    for (status, expected) in [
        (Status::Ok, Ok),
        (Status::OkSomeLost, Ok),
        (Status::Error, Error),
        (Status::Repeated, Repeated),
        (Status::NoNewData, NoNewData),
        (Status::WrongSequence, WrongSequence),
    ] {
        assert_eq!(ProfileStatus::from(status), expected);
    }
}

/// The machine, naively.
struct Naive {
    config: Config,
    window: VecDeque<ProfileStatus>,
    state: State,
}

impl Naive {
    fn check(&mut self, status: ProfileStatus) -> State {
        if self.state == NoData {
            if status != Error && status != NoNewData {
                self.state = Init;
            }
            return self.state;
        }
        self.window.push_back(status);
        if self.window.len() > self.config.window_size.into() {
            self.window.pop_front();
        }
        let count = |one| self.window.iter().filter(|&&status| status == one).count();
        let holds = |min_ok: u8, max_error: u8| {
            count(Error) <= max_error.into() && count(Ok) >= min_ok.into()
        };
        let config = &self.config;
        self.state = match self.state {
            NoData => unreachable!("handled above"),
            Init if holds(config.min_ok_init, config.max_error_init) => Valid,
            Init if count(Error) > config.max_error_init.into() => Invalid,
            Init => Init,
            Valid if holds(config.min_ok_valid, config.max_error_valid) => Valid,
            Valid => Invalid,
            Invalid if holds(config.min_ok_invalid, config.max_error_invalid) => Valid,
            Invalid => Invalid,
        };
        self.state
    }
}

prop_compose! {
    fn config()(window_size in 1..=32_u8)(
        window_size in Just(window_size),
        counts in prop::array::uniform6(0..=window_size),
    ) -> Config {
        let [min_ok_init, max_error_init, min_ok_valid, max_error_valid, min_ok_invalid, max_error_invalid] = counts;
        Config {
            window_size, min_ok_init, max_error_init, min_ok_valid, max_error_valid, min_ok_invalid, max_error_invalid,
        }
    }
}

proptest! {
    #[test]
    fn the_machine_equals_a_naive_one(
        config in prop_oneof![config(), Just(SENSOR_STATE_MACHINE), Just(CONFIG)],
        good_percent in 0..=100_u32,
        draws in prop::collection::vec((0..100_u32, 0..5_usize), 1..300),
    ) {
        let mut machine = StateMachine::new();
        let mut naive = Naive { config, window: VecDeque::new(), state: NoData };
        for (draw, other) in draws {
            let status = if draw < good_percent { Ok } else { STATUSES[other] };
            prop_assert_eq!(machine.check(&config, status), naive.check(status));
        }
    }
}

/// The statuses of a pattern until the sensor frames are invalid, from a full window of good ones.
fn invalid_after(pattern: impl Iterator<Item = ProfileStatus>) -> Option<usize> {
    let mut machine = StateMachine::new();
    for _ in 0..100 {
        machine.check(&SENSOR_STATE_MACHINE, Ok);
    }
    assert_eq!(machine.state(), Valid);
    let found = pattern
        .take(100_000)
        .position(|status| machine.check(&SENSOR_STATE_MACHINE, status) == Invalid);
    found.map(|index| index + 1)
}

/// The figures in the documentation of `SENSOR_STATE_MACHINE`.
#[test]
fn thresholds_of_the_sensor_frames() {
    let cycle = |statuses: &'static [ProfileStatus]| statuses.iter().copied().cycle();
    // Two of three lost for good.
    assert_eq!(invalid_after(cycle(&[NoNewData, NoNewData, Ok])), Some(20));
    assert_eq!(invalid_after(cycle(&[Ok, NoNewData, NoNewData])), Some(21));
    // Every second one lost, and two in a row among four.
    assert_eq!(invalid_after(cycle(&[NoNewData, Ok])), None);
    assert_eq!(invalid_after(cycle(&[NoNewData, NoNewData, Ok, Ok])), None);
    // Errors: more than 7 of 24.
    assert_eq!(invalid_after(cycle(&[Error])), Some(8));
    assert_eq!(invalid_after(cycle(&[Error, Ok, Ok])), Some(22));
    assert_eq!(invalid_after(cycle(&[Error, Ok, Ok, Ok])), None);
}

/// A random loss of 10 %, over ten million ticks.
#[test]
fn a_random_loss_of_a_tenth_is_tolerated() {
    let mut machine = StateMachine::new();
    for _ in 0..13 {
        machine.check(&SENSOR_STATE_MACHINE, Ok);
    }
    let mut generator = 1_u64;
    for tick in 0..10_000_000 {
        generator = generator
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let is_lost = (generator >> 33).is_multiple_of(10);
        let state = machine.check(&SENSOR_STATE_MACHINE, if is_lost { NoNewData } else { Ok });
        assert_eq!(state, Valid, "tick {tick}");
    }
}
