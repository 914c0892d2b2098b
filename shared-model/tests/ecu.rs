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
use shared_model::gate::{Fault, Faults, Setpoint};
use shared_model::servo::{Duty, Pwm};
use shared_model::signal::{Measurement, Mode};

const CLOCK_HZ: u32 = 25_000_000;
const TICK_COUNTS: u32 = 25_000;
const PERIODS_A_TICK: u32 = 10;
const NEUTRAL: u16 = 1250;
/// Duty codes of the safe state's square dither, the motor without voltage: 0.125 V.
const SAFE_DITHER: [u16; 2] = [1237, 1263];
/// Ticks in which the safe state takes the greatest voltage away.
const SLOWEST_RAMP_TICKS: u32 = 1126;
/// Good ticks until the ECU is active: two in which its first challenge comes back, one that begins
/// the communication, and eleven good frames.
const START_TICKS: u32 = 14;

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
    /// Challenge of the last actuator frame: each sensor frame returns it, one tick later.
    challenge: u8,
    /// Duty codes of the last tick's periods.
    codes: Vec<u16>,
    /// Whether the bridge was on in each of them.
    bridges: Vec<bool>,
}

impl Rig {
    fn new(scenario: &Scenario<f32>) -> Self {
        Self {
            ecu: Ecu::new(scenario, CLOCK_HZ).unwrap(),
            sender: Sender::new(SENSOR_DATA_ID),
            challenge: 0,
            codes: Vec::new(),
            bridges: Vec::new(),
        }
    }

    /// Active for the first tick.
    fn active(scenario: &Scenario<f32>) -> Self {
        let mut rig = Self::new(scenario);
        for _ in 0..START_TICKS {
            rig.good_tick(0.0);
        }
        rig
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
        self.frame_of(&measurement(current_request_a))
    }

    fn frame_of(&mut self, measurement: &Measurement<f32>) -> FrameBytes {
        encode_measurement(measurement, self.challenge, &mut self.sender)
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
        self.bridges.clear();
        loop {
            let (mut code, mut bridge_on) = (0, false);
            let mut challenge = self.challenge;
            let is_last = self.codes.len() as u32 == PERIODS_A_TICK - 1;
            let answer = |packet: &Packet| {
                code = packet.duty_code;
                bridge_on = packet.bridge_on;
                if let Some(frame) = &packet.frame {
                    challenge = decode_actuation(frame).unwrap().challenge;
                }
                Packet {
                    duty_code: pin(code),
                    bridge_on,
                    frame: frame.filter(|_| is_last),
                }
            };
            let output = self.ecu.period(answer, || elapsed_counts);
            self.challenge = challenge;
            self.codes.push(code);
            self.bridges.push(bridge_on);
            if let Some(output) = output {
                return output;
            }
        }
    }

    /// The codes of the last tick are those of the safe state's dither.
    fn has_safe_dither(&self) -> bool {
        self.codes.len() == 10 && self.codes.iter().all(|code| SAFE_DITHER.contains(code))
    }
}

fn assert_safe(output: &ControlOutput<f32>, fault: Fault) {
    let faults = Faults::from_bits(output.actuation.faults);
    assert_eq!(faults.iter().collect::<Vec<_>>(), [fault]);
    assert_eq!(output.actuation.mode, Mode::Safe);
    assert_eq!(output.actuation.wheel_speed_limit_rpm, 1100.0);
}

#[test]
fn starts_with_enough_good_frames_and_reports_it() {
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
    // The challenge has come back; the communication begins, and needs eleven good frames.
    for _ in 0..11 {
        let output = rig.good_tick(10.0);
        assert_eq!(output.actuation.mode, Mode::Starting);
        assert_eq!(output.actuation.warnings, 0);
        assert_eq!(output.actuation.sensor_counter, 255, "no frame is used yet");
        assert_eq!(receiver.check(Some(&output.frame)), Status::Ok);
        assert_eq!(output.setpoints, [Setpoint::neutral(); 2]);
    }
    for counter in 11..16 {
        let output = rig.good_tick(10.0);
        assert_eq!(output.actuation.mode, Mode::Active);
        assert_eq!(output.actuation.warnings, 0);
        assert_eq!(output.actuation.faults, 0);
        assert!(output.actuation.bridge_on);
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

/// The output of a period is known before it begins: no measurement at its start changes it.
#[test]
fn the_next_output_is_known_ahead() {
    let mut every_period = scenario();
    every_period.run.control_rate_hz = every_period.run.pwm_rate_hz;
    for (scenario, periods_a_tick) in [(scenario(), PERIODS_A_TICK), (every_period, 1)] {
        let mut ecu = Ecu::new(&scenario, CLOCK_HZ).unwrap();
        let mut sender = Sender::new(SENSOR_DATA_ID);
        let (mut challenge, mut codes) = (0, Vec::new());
        let mut begun = ecu.begin();
        for period in 1..=20_000_u32 {
            let ahead = ecu.ahead();
            if let Some(frame) = &begun.packet.frame {
                challenge = decode_actuation(frame).unwrap().challenge;
            }
            // A request that changes all the time.
            let measurement = measurement((period % 700) as f32 / 100.0);
            let frame = begun
                .control_due
                .then(|| encode_measurement(&measurement, challenge, &mut sender));
            let reply = Packet {
                frame,
                ..begun.packet
            };
            let counts = TICK_COUNTS * periods_a_tick / PERIODS_A_TICK;
            let output = ecu.end(&begun, &reply, || counts);
            assert_eq!(output.is_some(), period % periods_a_tick == 0);
            begun = ecu.begin();
            let mut expected = begun;
            if periods_a_tick == 1 {
                expected.packet.frame = None;
            }
            assert_eq!(ahead, expected, "period {period}");
            codes.push(begun.packet.duty_code);
        }
        codes.sort_unstable();
        codes.dedup();
        assert!(codes.len() > 50, "the servo does not move");
    }
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
    let mut rig = Rig::active(&scenario());
    let frame = rig.frame(1.0);
    for period in 0..10 {
        let answer = |packet: &Packet| Packet {
            frame: (period == 4).then_some(frame),
            ..*packet
        };
        if let Some(output) = rig.ecu.period(answer, || TICK_COUNTS) {
            assert_eq!(output.actuation.mode, Mode::Active);
            assert_eq!(output.actuation.warnings, 0);
        }
    }
    // And only once.
    let output = rig.tick(None, TICK_COUNTS, |code| code);
    assert_eq!(output.actuation.warnings, 1 << Warning::FrameMissing as u16);
}

#[test]
fn sr08_what_is_wrong_with_a_frame_is_a_warning() {
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
    let frame = encode_measurement(&measurement(10.0), rig.challenge, &mut again);
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
fn sr08_every_flipped_bit_of_a_sensor_frame_is_found() {
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
    // The last frame was two ticks old when it came.
    for _ in 0..8 {
        let output = rig.tick(None, TICK_COUNTS, |code| code);
        assert_eq!(output.actuation.mode, Mode::Active);
    }
    let output = rig.tick(None, TICK_COUNTS, |code| code);
    assert_safe(&output, Fault::FrameAge);
    for _ in 0..SLOWEST_RAMP_TICKS {
        rig.good_tick(10.0);
    }
    for _ in 0..100 {
        let output = rig.good_tick(10.0);
        assert_safe(&output, Fault::FrameAge);
        assert!(rig.has_safe_dither(), "until restart: {:?}", rig.codes);
        assert_eq!(rig.bridges, [true; 10]);
        assert!(output.actuation.bridge_on);
    }
}

#[test]
fn sr14_a_wrong_clock_is_found() {
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

/// From the period on that follows the second wrong one; the frame reports it.
#[test]
fn sr05_a_stuck_pin_switches_the_bridge_off() {
    for stuck in [0, NEUTRAL, 2500] {
        let mut rig = Rig::settled(10.0);
        let frame = rig.frame(10.0);
        let output = rig.tick(Some(frame), TICK_COUNTS, |_| stuck);
        assert_eq!(rig.bridges[..2], [true; 2], "one is a capture on an edge");
        assert_eq!(rig.bridges[2..], [false; 8]);
        assert!(!output.actuation.bridge_on);
        assert!(!decode_actuation(&output.frame).unwrap().bridge_on);
        for _ in 0..2000 {
            let output = rig.good_tick(10.0);
            assert_eq!(rig.bridges, [false; 10], "until restart");
            assert!(!output.actuation.bridge_on);
        }
    }
}

/// A safe state of another cause, and then the pin is stuck, or a setpoint is corrupted.
#[test]
fn the_safe_state_judges_pin_and_channels() {
    let safe = || {
        let mut rig = Rig::settled(10.0);
        let frame = rig.frame(10.0);
        let output = rig.tick(Some(frame), 0, |code| code);
        assert_safe(&output, Fault::TickWindow);
        for _ in 0..50 {
            rig.good_tick(10.0);
            assert_eq!(rig.bridges, [true; 10]);
        }
        rig
    };
    let mut rig = safe();
    let frame = rig.frame(10.0);
    let output = rig.tick(Some(frame), TICK_COUNTS, |_| 2000);
    assert_eq!(rig.bridges[2..], [false; 8]);
    assert!(!output.actuation.bridge_on);
    assert_safe(&output, Fault::TickWindow);

    let mut rig = safe();
    let mut output = rig.good_tick(10.0);
    output.setpoints[1].motor_v += 0.5;
    rig.ecu.pwm.accept(&output);
    rig.good_tick(10.0);
    assert_eq!(rig.bridges, [false; 10], "from this period on");
    let output = rig.good_tick(10.0);
    assert!(!output.actuation.bridge_on);
    assert_safe(&output, Fault::TickWindow);
}

/// A signal that is not a number is a fault of the sensor, in both channels the same: it is not taken
/// for a corrupted memory, and the servo keeps its ramp.
#[test]
fn a_signal_that_is_not_a_number_leaves_the_channels_equal() {
    let signals: [fn(&mut Measurement<f32>) -> &mut f32; 5] = [
        |m| &mut m.wheel_speed_rpm,
        |m| &mut m.yaw_rate_rad_per_s,
        |m| &mut m.steering_angle_rad,
        |m| &mut m.steering_rate_rad_per_s,
        |m| &mut m.current_request_a,
    ];
    for signal in signals {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut rig = Rig::settled(10.0);
            let mut measurement = measurement(10.0);
            *signal(&mut measurement) = bad;
            let frame = rig.frame_of(&measurement);
            let output = rig.tick(Some(frame), TICK_COUNTS, |code| code);
            assert_safe(&output, Fault::SensorNotANumber);
            for _ in 0..1500 {
                let output = rig.good_tick(10.0);
                assert_safe(&output, Fault::SensorNotANumber);
                assert!(output.actuation.bridge_on);
                assert_eq!(rig.bridges, [true; 10]);
            }
            assert!(rig.has_safe_dither(), "{:?}", rig.codes);
        }
    }
}

/// Both channels of either task must agree to the bridge.
#[test]
fn one_channel_switches_the_bridge_off() {
    for bridge_on in [[false, true], [true, false], [false, false]] {
        let mut rig = Rig::settled(10.0);
        let output = rig.good_tick(10.0);
        rig.ecu.pwm.accept(&ControlOutput {
            bridge_on,
            ..output
        });
        assert!(!rig.ecu.pwm.bridge_on());
        rig.good_tick(10.0);
        assert_eq!(rig.bridges, [false; 10]);
    }
    // The control task reports it, and its next outputs keep it off.
    let mut rig = Rig::settled(10.0);
    let input = ControlInput {
        bridge_on: false,
        ..ControlInput::NOTHING
    };
    assert!(!rig.ecu.control.run(&input).actuation.bridge_on);
    let input = ControlInput {
        found_by_pwm: Fault::ChannelsDiffer.into(),
        ..ControlInput::NOTHING
    };
    let output = rig.ecu.control.run(&input);
    assert_eq!(output.bridge_on, [false; 2]);
    let output = rig.ecu.control.run(&ControlInput::NOTHING);
    assert_eq!(output.bridge_on, [false; 2]);
    assert!(!output.actuation.bridge_on);
}

#[test]
fn sr15_control_that_is_late_is_found() {
    let mut rig = Rig::settled(10.0);
    rig.ecu.pwm.report_late_control();
    assert_safe(&rig.good_tick(10.0), Fault::ControlLate);
}

/// A voltage that comes out of the control task with a flipped bit, in either channel: found in the
/// same tick, and what goes out meanwhile lies between neutral and the right duty.
#[test]
fn sr13_every_flipped_bit_of_a_setpoint_is_found_and_harmless() {
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

/// A measurement of straight driving at a speed.
fn steady(wheel_speed_rpm: f32, current_request_a: f32) -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm,
        yaw_rate_rad_per_s: 0.0,
        steering_angle_rad: 0.0,
        steering_rate_rad_per_s: 0.0,
        current_request_a,
    }
}

/// Ticks until the safe state, and its fault; `None` after ten thousand.
fn found(mut tick: impl FnMut() -> ControlOutput<f32>) -> Option<(u32, Faults)> {
    (1..10_000).find_map(|ticks| {
        let output = tick();
        let faults = Faults::from_bits(output.actuation.faults);
        (output.actuation.mode == Mode::Safe).then_some((ticks, faults))
    })
}

/// The last 256 frames in an endless loop: their counters are always in sequence, and at steady motion
/// their values as well.
#[test]
fn sr09_a_replay_of_the_last_frames_is_found() {
    for wheel_speed_rpm in [300.0, 1000.0] {
        for settled_ticks in 1500..1532 {
            let mut rig = Rig::new(&scenario());
            let mut sent = Vec::new();
            for _ in 0..settled_ticks {
                let frame = rig.frame_of(&steady(wheel_speed_rpm, 2.0));
                sent.push(frame);
                rig.tick(Some(frame), TICK_COUNTS, |code| code);
            }
            let mut replayed = sent[sent.len() - 256..].iter().cycle();
            let stale = 1 << Warning::FrameStale as u16;
            let mut warnings = 0;
            let (ticks, faults) = found(|| {
                let frame = *replayed.next().unwrap();
                let output = rig.tick(Some(frame), TICK_COUNTS, |code| code);
                warnings |= output.actuation.warnings;
                output
            })
            .unwrap();
            assert_eq!(warnings, stale);
            assert!(ticks <= 12, "{ticks} ticks");
            let expected = [Fault::FrameAge, Fault::FramesInvalid].map(Faults::from);
            assert!(expected.contains(&faults), "{faults:?}");
        }
    }
}

/// One more tick of delay after each eight ticks.
#[test]
fn sr09_frames_whose_delay_grows_are_found_at_the_greatest_age() {
    let mut rig = Rig::new(&scenario());
    for _ in 0..1500 {
        let frame = rig.frame_of(&steady(1000.0, 2.0));
        rig.tick(Some(frame), TICK_COUNTS, |code| code);
    }
    let mut late = std::collections::VecDeque::new();
    let mut number = 0;
    let (ticks, faults) = found(|| {
        late.push_back(rig.frame_of(&steady(1000.0, 2.0)));
        let frame = (late.len() > number / 8).then(|| late.pop_front().unwrap());
        number += 1;
        rig.tick(frame, TICK_COUNTS, |code| code)
    })
    .unwrap();
    assert_eq!(faults, Fault::FrameAge.into());
    // Two ticks old without delay; ten are the limit.
    assert_eq!(ticks, 8 * 9 + 1);
}

/// A constant delay is tolerated up to the greatest age, and no further.
#[test]
fn sr09_the_age_of_frames_in_use_has_a_limit() {
    for (delay, is_used) in [
        (0, true),
        (3, true),
        (8, true),
        (9, false),
        (14, false),
        (30, false),
    ] {
        let mut rig = Rig::new(&scenario());
        let mut late = std::collections::VecDeque::new();
        let mut mode = Mode::Starting;
        for _ in 0..2000 {
            late.push_back(rig.frame_of(&steady(1000.0, 2.0)));
            let frame = (late.len() > delay).then(|| late.pop_front().unwrap());
            mode = rig.tick(frame, TICK_COUNTS, |code| code).actuation.mode;
        }
        let expected = if is_used {
            Mode::Active
        } else {
            Mode::Starting
        };
        assert_eq!(mode, expected, "{delay} ticks");
    }
}

/// A vehicle that receives no frame of the ECU returns no challenge.
#[test]
fn without_an_answer_the_ecu_does_not_start() {
    for echo in [0, 0x35, 0xFF] {
        let mut rig = Rig::new(&scenario());
        for _ in 0..5000 {
            let frame = encode_measurement(&steady(1000.0, 2.0), echo, &mut rig.sender);
            let output = rig.tick(Some(frame), TICK_COUNTS, |code| code);
            assert_eq!(output.actuation.mode, Mode::Starting);
            assert_eq!(output.actuation.faults, 0);
            assert_eq!(rig.codes, [NEUTRAL; 10]);
        }
    }
}

/// An ECU that restarts in the middle of a drive: the vehicle's counter and its echo are those of
/// before.
#[test]
fn a_restarted_ecu_becomes_active_again() {
    let mut rig = Rig::settled(10.0);
    for _ in 0..300 {
        rig.good_tick(10.0);
        rig.ecu = Ecu::new(&scenario(), CLOCK_HZ).unwrap();
        let active = (1..100).find(|_| {
            let output = rig.good_tick(10.0);
            assert_eq!(output.actuation.faults, 0);
            output.actuation.mode == Mode::Active
        });
        assert!(
            active.is_some_and(|ticks| ticks <= START_TICKS),
            "{active:?}"
        );
    }
}

/// At every control rate an ECU starts, and bridges a lost frame.
#[test]
fn frames_are_fresh_at_every_control_rate() {
    for (control_rate_hz, pwm_rate_hz) in
        [(10, 1000), (100, 1000), (1000, 10_000), (10_000, 100_000)]
    {
        let mut scenario = scenario();
        scenario.run.control_rate_hz = control_rate_hz as f32;
        scenario.run.pwm_rate_hz = pwm_rate_hz as f32;
        scenario.dither.waveform = Waveform::None;
        let mut ecu = Ecu::new(&scenario, CLOCK_HZ).unwrap();
        let mut sender = Sender::new(SENSOR_DATA_ID);
        let (mut challenge, mut tick, mut last) = (0, 0, None);
        while tick < 100 {
            let answer = |packet: &Packet| {
                let frame = packet.frame.map(|frame| {
                    challenge = decode_actuation(&frame).unwrap().challenge;
                    encode_measurement(&steady(1000.0, 0.0), challenge, &mut sender)
                });
                Packet {
                    frame: frame.filter(|_| tick % 10 != 9),
                    ..*packet
                }
            };
            let counts = CLOCK_HZ / control_rate_hz;
            if let Some(output) = ecu.period(answer, || counts) {
                tick += 1;
                last = Some(output.actuation);
            }
        }
        let last = last.unwrap();
        assert_eq!(
            (last.mode, last.faults),
            (Mode::Active, 0),
            "{control_rate_hz} Hz"
        );
    }
}

#[test]
fn sr10_two_of_three_frames_lost_for_good_are_found() {
    let mut rig = Rig::settled(10.0);
    let mut number = 0;
    let (ticks, faults) = found(|| {
        number += 1;
        let frame = rig.frame(10.0);
        rig.tick((number % 3 == 0).then_some(frame), TICK_COUNTS, |code| code)
    })
    .unwrap();
    assert_eq!((ticks, faults), (20, Fault::FramesInvalid.into()));
}

/// A link that has been that bad from the start does not make the ECU active.
#[test]
fn two_of_three_frames_lost_from_the_start_leave_the_servo_neutral() {
    let mut rig = Rig::new(&scenario());
    for number in 0..5000 {
        let frame = rig.frame(10.0);
        let frame = (number % 3 == 0).then_some(frame);
        let output = rig.tick(frame, TICK_COUNTS, |code| code);
        assert_eq!(output.actuation.mode, Mode::Starting);
        assert_eq!(output.actuation.faults, 0);
        assert_eq!(rig.codes, [NEUTRAL; 10]);
    }
    for _ in 0..30 {
        rig.good_tick(10.0);
    }
    assert_eq!(rig.good_tick(10.0).actuation.mode, Mode::Active);
}

/// Two in a row now and then, and a random tenth.
#[test]
fn some_loss_is_tolerated() {
    let mut generator = 1_u32;
    let mut rig = Rig::settled(10.0);
    for number in 0..20_000 {
        generator = generator
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        let is_lost = if number < 5000 {
            number % 8 < 2
        } else {
            generator >> 16 < 6554
        };
        let frame = rig.frame(10.0);
        let output = rig.tick((!is_lost).then_some(frame), TICK_COUNTS, |code| code);
        assert_eq!(output.actuation.mode, Mode::Active, "tick {number}");
    }
}

#[test]
fn sr10_frames_that_are_damaged_for_good_are_invalid() {
    let mut rig = Rig::settled(10.0);
    let (ticks, faults) = found(|| {
        let mut frame = rig.frame(10.0);
        frame[9] ^= 1;
        rig.tick(Some(frame), TICK_COUNTS, |code| code)
    })
    .unwrap();
    assert_eq!((ticks, faults), (8, Fault::FramesInvalid.into()));
}

/// Above the vehicle's limit a warning, with the dither of the schedule's last speed; beyond the
/// sensor's range a fault.
#[test]
fn overspeed_is_a_warning_and_the_dither_stays() {
    let mut rig = Rig::settled(0.0);
    let mut speed_rpm = 1750.0;
    let mut drive = |speed_rpm: f32| {
        let frame = rig.frame_of(&Measurement {
            wheel_speed_rpm: speed_rpm,
            ..measurement(0.0)
        });
        rig.tick(Some(frame), TICK_COUNTS, |code| code).actuation
    };
    while speed_rpm < 3990.0 {
        speed_rpm += 1.0;
        let actuation = drive(speed_rpm);
        assert_eq!(
            (actuation.mode, actuation.faults),
            (Mode::Active, 0),
            "{speed_rpm} rpm"
        );
        let overspeed = 1 << Warning::Overspeed as u16;
        let expected = if speed_rpm > 2500.0 { overspeed } else { 0 };
        assert_eq!(actuation.warnings, expected, "{speed_rpm} rpm");
        assert_eq!(actuation.wheel_speed_limit_rpm, 2500.0);
        if speed_rpm > 2100.0 {
            assert_eq!(actuation.dither_amplitude_v, 0.1135);
        }
    }
    drive(4000.0);
    let actuation = drive(4001.0);
    assert_eq!(actuation.faults, 1 << Fault::SensorRange as u32);
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
            vec!["controller.motor_current_a=15"],
            vec!["controller.motor_current_a=15.001"],
            "controller.motor_current_a =",
        ),
        (
            vec!["controller.motor_slew_a_per_s=13.33"],
            vec!["controller.motor_slew_a_per_s=13.34"],
            "controller.motor_slew_a_per_s =",
        ),
        (
            vec![
                "gate.square_amplitude_v=0.1135",
                "gate.square_safe_amplitude_v=0.1135",
            ],
            vec![
                "gate.square_amplitude_v=0.1134",
                "gate.square_safe_amplitude_v=0.1134",
            ],
            "gate.square_amplitude_v =",
        ),
        (
            vec![
                sine,
                "gate.sine_amplitude_v=1.0086",
                "gate.sine_safe_amplitude_v=1.0086",
            ],
            vec![
                sine,
                "gate.sine_amplitude_v=1.0085",
                "gate.sine_safe_amplitude_v=1.0085",
            ],
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
            vec![
                "gate.wheel_speed_rpm=1200",
                "gate.safe_wheel_speed_rpm=1200",
            ],
            vec![
                "gate.wheel_speed_rpm=1200",
                "gate.safe_wheel_speed_rpm=1201",
            ],
            "gate.safe_wheel_speed_rpm =",
        ),
        (
            vec!["gate.wheel_speed_rpm=4000"],
            vec!["gate.wheel_speed_rpm=4001"],
            "gate.wheel_speed_rpm =",
        ),
        (
            vec!["gate.dither_above_rpm=1550"],
            vec!["gate.dither_above_rpm=1549"],
            "gate.dither_above_rpm =",
        ),
        (
            vec!["controller.dither_off_below_rpm=1555"],
            vec!["controller.hysteresis_rpm=46"],
            "from 1576",
        ),
        (
            // 0.1055 V at 1575 rpm, and 0.1060 V above it.
            vec!["gate.square_least_amplitude_v=0.1059"],
            vec!["gate.square_least_amplitude_v=0.1061"],
            "gate.square_least_amplitude_v =",
        ),
        (
            vec![sine, "gate.sine_least_amplitude_v=0.9421"],
            vec![sine, "gate.sine_least_amplitude_v=0.9423"],
            "gate.sine_least_amplitude_v =",
        ),
        (
            vec!["gate.square_safe_amplitude_v=0.1"],
            vec!["gate.square_safe_amplitude_v=0.0999"],
            "gate.square_safe_amplitude_v =",
        ),
        (
            vec!["gate.square_safe_amplitude_v=0.2"],
            vec!["gate.square_safe_amplitude_v=0.201"],
            "gate.square_safe_amplitude_v =",
        ),
        (
            vec![sine, "gate.sine_safe_amplitude_v=1.3"],
            vec![sine, "gate.sine_safe_amplitude_v=0.89"],
            "gate.sine_safe_amplitude_v =",
        ),
        (
            vec!["gate.weak_dither_s=0.502"],
            vec!["gate.weak_dither_s=0.5"],
            "gate.weak_dither_s =",
        ),
        (
            vec!["controller.dither_ramp_s=0.69"],
            vec!["controller.dither_ramp_s=0.7"],
            "gate.weak_dither_s =",
        ),
        (
            vec!["servo.bus_voltage_v=4.33"],
            vec!["servo.bus_voltage_v=4.32"],
            "servo.bus_voltage_v =",
        ),
        (
            vec![
                "servo.bus_voltage_v=4.38",
                "gate.square_safe_amplitude_v=0.17",
            ],
            vec![
                "servo.bus_voltage_v=4.36",
                "gate.square_safe_amplitude_v=0.17",
            ],
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
        "gate.dither_above_rpm=0",
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
        let mut rig = Rig::active(&scenario);
        let mut is_safe = false;
        for (frame, elapsed, pin_error, request_a) in &ticks {
            let frame = match frame {
                Frame::Good => Some(rig.frame(*request_a)),
                Frame::Lost => None,
                &Frame::Words([wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a]) => {
                    let measurement = Measurement {
                        wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a,
                    };
                    Some(rig.frame_of(&measurement))
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
