//! The whole ECU program: frames in, duties and frames out, faults to the safe state.

use proptest::prelude::*;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::ecu::{ControlInput, ControlOutput, Ecu, Warning};
use shared_model::exchange::{FRAME_LEN, FrameBytes, Packet};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, decode_actuation, encode_measurement,
};
use shared_model::gate::{Fault, Faults};
use shared_model::servo::{Duty, Pwm};
use shared_model::signal::{Measurement, Mode};

const CLOCK_HZ: u32 = 25_000_000;
const TICK_COUNTS: u32 = 25_000;
const PERIODS_A_TICK: u32 = 10;
const NEUTRAL: u16 = 1250;
/// Ticks in which the safe state takes the greatest voltage away.
const SLOWEST_RAMP_TICKS: u32 = 1126;

fn scenario() -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = Waveform::Square;
    scenario.dither.start_time_s = 0.0;
    scenario
}

fn measurement(current_request_a: f32) -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm: 1750.0,
        yaw_rate_rad_per_s: 0.5,
        steering_angle_rad: 0.1,
        steering_rate_rad_per_s: 0.0,
        current_request_a,
    }
}

/// An ECU with a perfect clock, and a pin that shows its output.
#[derive(Clone)]
struct Rig {
    ecu: Ecu<f32>,
    sender: Sender,
    /// Duty codes of the last tick's periods.
    codes: Vec<u16>,
}

impl Rig {
    fn new(scenario: &Scenario<f32>) -> Self {
        Self {
            ecu: Ecu::new(scenario, CLOCK_HZ).unwrap(),
            sender: Sender::new(SENSOR_DATA_ID),
            codes: Vec::new(),
        }
    }

    /// Active at a settled request, dither fully on.
    fn settled(current_request_a: f32) -> Self {
        let mut rig = Self::new(&scenario());
        for _ in 0..1500 {
            rig.good_tick(current_request_a);
        }
        rig
    }

    fn frame(&mut self, current_request_a: f32) -> FrameBytes {
        encode_measurement(&measurement(current_request_a), &mut self.sender)
    }

    fn good_tick(&mut self, current_request_a: f32) -> ControlOutput<f32> {
        let frame = self.frame(current_request_a);
        self.tick(Some(frame), TICK_COUNTS, |code| code)
    }

    fn tick(
        &mut self,
        frame: Option<FrameBytes>,
        elapsed_counts: u32,
        pin: impl Fn(u16) -> u16,
    ) -> ControlOutput<f32> {
        self.codes.clear();
        loop {
            let mut code = 0;
            let is_last = self.codes.len() as u32 == PERIODS_A_TICK - 1;
            let answer = |packet: &Packet| {
                code = packet.duty_code;
                Packet {
                    duty_code: pin(code),
                    frame: frame.filter(|_| is_last),
                }
            };
            let output = self.ecu.period(answer, || elapsed_counts);
            self.codes.push(code);
            if let Some(output) = output {
                return output;
            }
        }
    }
}

fn assert_safe(output: &ControlOutput<f32>, fault: Fault) {
    let faults = Faults::from_bits(output.actuation.faults);
    assert_eq!(faults.iter().collect::<Vec<_>>(), [fault]);
    assert_eq!(output.actuation.mode, Mode::Safe);
    assert_eq!(output.actuation.wheel_speed_limit_rpm, 1100.0);
}

#[test]
fn starts_with_the_first_frame_and_tells_it() {
    let mut rig = Rig::new(&scenario());
    let mut receiver = Receiver::new(ACTUATOR_DATA_ID, MAX_DELTA_COUNTER);
    for _ in 0..3 {
        let output = rig.tick(None, 0, |code| code);
        assert_eq!(output.actuation.mode, Mode::Starting);
        assert_eq!(output.actuation.warnings, 1 << Warning::FrameMissing as u16);
        assert_eq!(output.actuation.sensor_counter, 255);
        assert_eq!(output.actuation.wheel_speed_limit_rpm, 1100.0);
        assert_eq!(receiver.check(Some(&output.frame)), Status::Ok);
        assert_eq!(rig.codes, [NEUTRAL; 10]);
    }
    for counter in 0..5 {
        let output = rig.good_tick(10.0);
        assert_eq!(output.actuation.mode, Mode::Active);
        assert_eq!(output.actuation.warnings, 0);
        assert_eq!(output.actuation.faults, 0);
        assert_eq!(output.actuation.sensor_counter, counter);
        assert_eq!(output.actuation.wheel_speed_limit_rpm, 2500.0);
        let setpoint = output.setpoints[0];
        assert_eq!(output.setpoints[1], setpoint);
        assert_eq!(output.actuation.motor_voltage_v, setpoint.motor_v);
        assert_eq!(
            output.actuation.dither_amplitude_v,
            setpoint.dither_amplitude_v
        );
        assert_eq!(receiver.check(Some(&output.frame)), Status::Ok);
        assert_eq!(decode_actuation(&output.frame), Ok(output.actuation));
    }
}

/// The result of a tick is put out from the next one on: the duties of its periods, the frame with
/// the last of them.
#[test]
fn a_command_acts_one_tick_later() {
    let pwm = Pwm::new(&scenario().servo, 10_000.0);
    let mut scenario = scenario();
    scenario.dither.waveform = Waveform::None;
    let mut rig = Rig::new(&scenario);
    let mut commands = vec![0.0; 2];
    for _ in 0..200 {
        let output = rig.good_tick(10.0);
        let acting_v = commands[commands.len() - 2];
        let last = rig.codes.pop().unwrap();
        assert!(
            rig.codes
                .iter()
                .all(|&code| code == pwm.duty(acting_v).code())
        );
        assert_eq!(last, pwm.duty(acting_v).code());
        commands.push(output.setpoints[0].motor_v);
    }
    assert!(commands.last().unwrap() > &0.5);
}

#[test]
fn an_actuator_frame_goes_out_once_a_tick() {
    let mut rig = Rig::new(&scenario());
    let mut sent = Vec::new();
    for period in 0..50 {
        let answer = |packet: &Packet| {
            sent.extend(packet.frame.map(|_| period));
            *packet
        };
        rig.ecu.period(answer, || TICK_COUNTS);
    }
    // The first tick has nothing to report yet.
    assert_eq!(sent, [19, 29, 39, 49]);
}

/// Square dither about the motor's share, both to half a count.
#[test]
fn duty_is_motor_and_dither() {
    let rig = Rig::settled(10.0);
    let mut codes: Vec<u16> = rig.codes;
    codes.sort_unstable();
    codes.dedup();
    // 3 V and 0.1098 V at 104.2 counts a volt, about 1250.
    assert!(
        codes.iter().all(|code| [1551, 1574].contains(code)),
        "{codes:?}"
    );
}

#[test]
fn a_frame_counts_whenever_it_came_since_the_last_tick() {
    let mut rig = Rig::new(&scenario());
    let frame = rig.frame(1.0);
    for period in 0..10 {
        let answer = |packet: &Packet| Packet {
            frame: (period == 4).then_some(frame),
            ..*packet
        };
        if let Some(output) = rig.ecu.period(answer, || TICK_COUNTS) {
            assert_eq!(output.actuation.mode, Mode::Active);
        }
    }
    // And only once.
    let output = rig.tick(None, TICK_COUNTS, |code| code);
    assert_eq!(output.actuation.warnings, 1 << Warning::FrameMissing as u16);
}

#[test]
fn what_is_wrong_with_a_frame_is_a_warning() {
    let warnings = |output: ControlOutput<f32>| {
        assert_eq!(output.actuation.mode, Mode::Active);
        output.actuation.warnings
    };
    let mut rig = Rig::settled(10.0);
    assert_eq!(warnings(rig.good_tick(10.0)), 0);
    assert_eq!(warnings(rig.tick(None, TICK_COUNTS, |code| code)), 1);

    let mut damaged = rig.frame(10.0);
    damaged[7] ^= 4;
    assert_eq!(
        warnings(rig.tick(Some(damaged), TICK_COUNTS, |code| code)),
        2
    );

    let before = rig.good_tick(10.0);
    assert_eq!(warnings(before), 1 << 4, "the damaged one is lost");
    let mut again = rig.sender;
    let frame = rig.frame(10.0);
    assert_eq!(warnings(rig.tick(Some(frame), TICK_COUNTS, |code| code)), 0);
    let frame = encode_measurement(&measurement(10.0), &mut again);
    let repeated = rig.tick(Some(frame), TICK_COUNTS, |code| code);
    assert_eq!(warnings(repeated), 4);

    for _ in 0..3 {
        rig.frame(10.0);
    }
    let counter = repeated.actuation.sensor_counter;
    let skipped = rig.good_tick(10.0);
    assert_eq!(warnings(skipped), 8);
    assert_eq!(
        skipped.actuation.sensor_counter, counter,
        "not a valid frame"
    );
    assert_eq!(warnings(rig.good_tick(10.0)), 0);
}

/// A flipped bit anywhere in a frame: the frame is not used, and nothing else happens.
#[test]
fn every_flipped_bit_of_a_sensor_frame_is_found() {
    let settled = Rig::settled(10.0);
    for bit in 0..8 * FRAME_LEN {
        let mut rig = settled.clone();
        let before = rig.good_tick(10.0);
        let mut frame = rig.frame(-10.0);
        frame[bit / 8] ^= 1 << (bit % 8);
        let output = rig.tick(Some(frame), TICK_COUNTS, |code| code);
        assert_eq!(output.actuation.warnings, 1 << Warning::FrameDamaged as u16);
        assert_eq!(
            output.actuation.sensor_counter,
            before.actuation.sensor_counter
        );
        assert_eq!(output.setpoints, before.setpoints, "bit {bit}");
        assert_eq!(rig.good_tick(10.0).actuation.mode, Mode::Active);
    }
}

#[test]
fn without_frames_the_safe_state_follows() {
    let mut rig = Rig::settled(10.0);
    for _ in 0..10 {
        let output = rig.tick(None, TICK_COUNTS, |code| code);
        assert_eq!(output.actuation.mode, Mode::Active);
    }
    let output = rig.tick(None, TICK_COUNTS, |code| code);
    assert_safe(&output, Fault::FrameAge);
    for _ in 0..SLOWEST_RAMP_TICKS {
        rig.good_tick(10.0);
    }
    for _ in 0..100 {
        assert_safe(&rig.good_tick(10.0), Fault::FrameAge);
        assert_eq!(rig.codes, [NEUTRAL; 10], "until restart");
    }
}

#[test]
fn a_wrong_clock_is_found() {
    for elapsed_counts in [0, TICK_COUNTS / 2, 2 * TICK_COUNTS] {
        let mut rig = Rig::settled(10.0);
        let frame = rig.frame(10.0);
        let output = rig.tick(Some(frame), elapsed_counts, |code| code);
        assert_safe(&output, Fault::TickWindow);
    }
}

#[test]
fn a_stuck_pin_is_found() {
    for stuck in [0, 1, NEUTRAL, 2500, u16::MAX] {
        let mut rig = Rig::settled(10.0);
        let frame = rig.frame(10.0);
        let output = rig.tick(Some(frame), TICK_COUNTS, |_| stuck);
        assert_safe(&output, Fault::Readback);
    }
}

#[test]
fn control_that_is_late_is_found() {
    let mut rig = Rig::settled(10.0);
    rig.ecu.pwm.report_late_control();
    assert_safe(&rig.good_tick(10.0), Fault::ControlLate);
}

/// A voltage that comes out of the control task with a flipped bit, in either channel: found in the
/// same tick, and what goes out meanwhile lies between neutral and the right duty.
#[test]
fn every_flipped_bit_of_a_setpoint_is_found_and_harmless() {
    for request_a in [10.0, -10.0, 0.0] {
        let mut rig = Rig::settled(request_a);
        let output = rig.good_tick(request_a);
        for bit in 0..128 {
            let mut flipped = output;
            let setpoint = &mut flipped.setpoints[bit / 64];
            let number = if bit % 64 < 32 {
                &mut setpoint.motor_v
            } else {
                &mut setpoint.dither_amplitude_v
            };
            *number = f32::from_bits(number.to_bits() ^ (1 << (bit % 32)));
            let is_zero_of_other_sign = flipped.setpoints == output.setpoints;

            let (mut right, mut wrong) = (rig.ecu.pwm.clone(), rig.ecu.pwm.clone());
            right.accept(&output);
            wrong.accept(&flipped);
            let found = wrong.faults().contains(Fault::ChannelsDiffer);
            assert_ne!(found, is_zero_of_other_sign, "bit {bit} at {request_a} A");
            for _ in 0..100 {
                let (right, wrong) = (right.begin().duty.code(), wrong.begin().duty.code());
                let between = NEUTRAL.min(right)..=NEUTRAL.max(right);
                assert!(
                    between.contains(&wrong),
                    "bit {bit} at {request_a} A: {wrong} for {right}"
                );
            }
        }
    }
}

#[test]
fn tasks_compare_their_channels_before_a_result_is_used() {
    let mut rig = Rig::settled(10.0);
    let mut output = rig.good_tick(10.0);
    output.setpoints[1].motor_v = 2.99;
    rig.ecu.pwm.accept(&output);
    // A tick later the accepted values are right again; the fault stays.
    let output = rig.good_tick(10.0);
    assert_safe(&output, Fault::ChannelsDiffer);
    assert_eq!(output.setpoints[0], output.setpoints[1]);
}

#[test]
fn nothing_is_no_input() {
    let mut rig = Rig::new(&scenario());
    let output = rig.ecu.control.run(&ControlInput::NOTHING);
    assert_eq!(output.actuation.mode, Mode::Starting);
    assert_eq!(output.actuation.faults, 0);
}

/// The message of a scenario with these settings; empty if it is taken.
fn refusal(settings: &[&str]) -> String {
    let mut scenario = scenario();
    for setting in settings {
        scenario.apply(setting).unwrap();
    }
    assert_eq!(scenario.validate(), Ok(()), "the open loop takes it");
    let error = Ecu::new(&scenario, CLOCK_HZ).err();
    error.map_or(String::new(), |error| error.to_string())
}

#[test]
fn what_the_gate_would_refuse_is_refused_at_the_start() {
    let sine = "dither.waveform=sine";
    for (good, bad, name) in [
        (
            vec!["policy.motor_current_a=15"],
            vec!["policy.motor_current_a=15.001"],
            "policy.motor_current_a =",
        ),
        (
            vec!["policy.motor_slew_a_per_s=13.33"],
            vec!["policy.motor_slew_a_per_s=13.34"],
            "policy.motor_slew_a_per_s =",
        ),
        (
            vec!["gate.square_amplitude_v=0.1135"],
            vec!["gate.square_amplitude_v=0.1134"],
            "gate.square_amplitude_v =",
        ),
        (
            vec![sine, "gate.sine_amplitude_v=1.0086"],
            vec![sine, "gate.sine_amplitude_v=1.0085"],
            "gate.sine_amplitude_v =",
        ),
        (
            vec!["dither.square_frequency_rad_per_s=1500"],
            vec!["dither.square_frequency_rad_per_s=1499"],
            "dither.square_frequency_rad_per_s =",
        ),
        (
            vec!["dither.square_frequency_rad_per_s=5000"],
            vec!["dither.square_frequency_rad_per_s=5001"],
            "from 1500 to 5000",
        ),
        (
            vec![sine, "dither.square_frequency_rad_per_s=1"],
            vec![sine, "dither.sine_frequency_rad_per_s=1"],
            "dither.sine_frequency_rad_per_s =",
        ),
        (
            vec![
                "run.pwm_rate_hz=5000",
                "gate.dither_frequency_max_rad_per_s=7853",
            ],
            vec![
                "run.pwm_rate_hz=5000",
                "gate.dither_frequency_max_rad_per_s=7855",
            ],
            "gate.dither_frequency_max_rad_per_s =",
        ),
        (
            vec!["gate.dither_frequency_max_rad_per_s=2000"],
            vec!["gate.dither_frequency_min_rad_per_s=5001"],
            "from 5001 to",
        ),
        (
            vec!["gate.wheel_speed_rpm=1200", "gate.safe_wheel_speed_rpm=1200"],
            vec!["gate.wheel_speed_rpm=1200", "gate.safe_wheel_speed_rpm=1201"],
            "gate.safe_wheel_speed_rpm =",
        ),
        (
            vec!["servo.bus_voltage_v=4.32"],
            vec!["servo.bus_voltage_v=4.31"],
            "servo.bus_voltage_v =",
        ),
    ] {
        assert_eq!(refusal(&good), "");
        let message = refusal(&bad);
        assert!(message.contains(name), "{message}");
    }
    // Without dither its frequency is not checked.
    let none = [
        "dither.waveform=none",
        "gate.dither_frequency_max_rad_per_s=1e4",
        "run.pwm_rate_hz=5000",
        "gate.square_amplitude_v=0",
    ];
    assert_eq!(refusal(&none), "");
    let mut invalid = scenario();
    invalid.vehicle.mass_kg = -1.0;
    assert!(Ecu::new(&invalid, CLOCK_HZ).is_err());
}

#[derive(Debug, Clone)]
enum Frame {
    Good,
    Lost,
    Words([f32; 5]),
    Bytes(FrameBytes),
}

fn any_frame() -> impl Strategy<Value = Frame> {
    let any_number = any::<u32>().prop_map(f32::from_bits);
    let number = prop_oneof![any_number, -3.0_f32..3.0, Just(1750.0), Just(0.0)];
    prop_oneof![
        20 => Just(Frame::Good),
        2 => Just(Frame::Lost),
        1 => prop::array::uniform5(number).prop_map(Frame::Words),
        1 => prop::array::uniform24(any::<u8>()).prop_map(Frame::Bytes),
    ]
}

fn any_tick() -> impl Strategy<Value = (Frame, u32, u16, f32)> {
    let elapsed = prop_oneof![30 => Just(TICK_COUNTS), 1 => any::<u32>()];
    let pin_error = prop_oneof![30 => Just(0), 1 => any::<u16>()];
    (any_frame(), elapsed, pin_error, -20.0_f32..20.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever comes in: every duty is one of the timer's and within the gate's voltages, and a fault ends in neutral
    /// for good.
    #[test]
    fn nothing_that_comes_in_gets_past(
        ticks in prop::collection::vec(any_tick(), 1..300),
        is_sine in any::<bool>(),
    ) {
        let mut scenario = scenario();
        if is_sine {
            scenario.dither.waveform = Waveform::Sine;
        }
        let pwm = Pwm::new(&scenario.servo, 10_000.0);
        let most_v = 4.5 + if is_sine { 1.3 * 1.0012 } else { 0.2 } + pwm.volts_per_count();
        let mut rig = Rig::new(&scenario);
        let mut is_safe = false;
        for (frame, elapsed, pin_error, request_a) in &ticks {
            let frame = match frame {
                Frame::Good => Some(rig.frame(*request_a)),
                Frame::Lost => None,
                &Frame::Words([wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a]) => {
                    let measurement = Measurement {
                        wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a,
                    };
                    Some(encode_measurement(&measurement, &mut rig.sender))
                }
                Frame::Bytes(bytes) => Some(*bytes),
            };
            let output = rig.tick(frame, *elapsed, |code| code ^ pin_error);
            for &code in &rig.codes {
                let volts: f32 = pwm.volts(Duty::new(code, 2500).unwrap());
                prop_assert!(volts.abs() <= most_v, "{volts} V");
            }
            prop_assert!(!is_safe || output.actuation.mode == Mode::Safe);
            is_safe = output.actuation.mode == Mode::Safe;
            prop_assert_eq!(is_safe, output.actuation.faults != 0);
        }
        rig.ecu.pwm.report_late_control();
        for _ in 0..SLOWEST_RAMP_TICKS + 2 {
            rig.good_tick(20.0);
        }
        for (frame, ..) in ticks.iter().take(20) {
            let frame = matches!(frame, Frame::Good).then(|| rig.frame(20.0));
            let output = rig.tick(frame, 7, |code| !code);
            prop_assert_eq!(output.actuation.mode, Mode::Safe);
            prop_assert_eq!(&rig.codes, &[NEUTRAL; 10]);
        }
    }
}
