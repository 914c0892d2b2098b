//! The task at the control rate: frame, controller, gate.

use super::dual_channel::DualChannel;
use super::reception::Reception;
use super::warning;
use crate::controller::{Command, Controller};
use crate::e2e::Sender;
use crate::exchange::FrameBytes;
use crate::frame::{ACTUATOR_DATA_ID, decode_measurement, encode_actuation};
use crate::gate::{Fault, Faults, Observation, Setpoint, Supervisor};
use crate::signal::{Actuation, Measurement, Mode};
use crate::{Real, Scenario};

/// Input of a control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlInput {
    /// The sensor frame that came since the last tick.
    pub frame: Option<FrameBytes>,
    /// Counts of the independent clock since the last tick.
    pub elapsed_counts: u32,
    /// Faults found by the PWM task.
    pub found_by_pwm: Faults,
    /// Whether the PWM task has the servo's bridge on.
    pub bridge_on: bool,
}

impl ControlInput {
    /// No frame, no time, nothing found.
    pub const NOTHING: Self = Self {
        frame: None,
        elapsed_counts: 0,
        found_by_pwm: Faults::NONE,
        bridge_on: true,
    };
}

/// Output of a control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlOutput<T> {
    /// For the PWM task, one a channel.
    pub setpoints: [Setpoint<T>; 2],
    /// Whether the servo's bridge may be on, for the PWM task, one a channel.
    pub bridge_on: [bool; 2],
    /// The actuator frame.
    pub frame: FrameBytes,
    /// Content of the frame.
    pub actuation: Actuation<T>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Channel<T: Real> {
    reception: Reception,
    measurement: Option<Measurement<T>>,
    controller: Controller<T>,
    supervisor: Supervisor<T>,
    sender: Sender,
}

impl<T: Real> Channel<T> {
    fn run(
        &mut self,
        input: &ControlInput,
        found_outside: Faults,
        change: &mut impl FnMut(&mut Command<T>),
    ) -> (Setpoint<T>, Actuation<T>) {
        let frame = input.frame.as_ref();
        let received = self
            .reception
            .check(frame, self.supervisor.frame_age_ticks());
        let new = frame
            .filter(|_| received.usable_age_ticks.is_some())
            .map(|frame| decode_measurement(frame).map(&|signal| T::from_f64(signal.into())));
        // The gate finds a signal that is not a number. It must not enter the state: NaN is not equal
        // to itself, so that the channels would differ for good.
        let is_new = new.is_some_and(|new| new.is_finite());
        if is_new {
            self.measurement = new;
        }
        let is_active = self.supervisor.mode() == Mode::Active;
        let mut found_outside = found_outside;
        found_outside.add_if(received.is_invalid && is_active, Fault::FramesInvalid);
        let mut command = match &self.measurement {
            Some(measurement) => self.controller.run(measurement, is_new),
            None => Command::neutral(),
        };
        change(&mut command);
        let setpoint = self.supervisor.run(&Observation {
            elapsed_counts: input.elapsed_counts,
            measurement: new,
            measurement_age_ticks: received.usable_age_ticks.unwrap_or(0),
            motor_v: command.motor_v,
            feedback_v: command.feedback_v,
            dither_amplitude_v: command.dither_amplitude_v,
            found_outside,
        });
        let is_overspeed = new.is_some_and(|now| self.supervisor.is_overspeed(&now));
        let actuation = Actuation {
            mode: self.supervisor.mode(),
            faults: self.supervisor.faults().bits(),
            motor_voltage_v: setpoint.motor_v,
            dither_amplitude_v: setpoint.dither_amplitude_v,
            wheel_speed_limit_rpm: self.supervisor.wheel_speed_limit_rpm(),
            warnings: warning::bits(&received, is_overspeed),
            sensor_counter: self.reception.counter(),
            bridge_on: self.supervisor.bridge_on() && input.bridge_on,
            challenge: self.reception.challenge(),
        };
        (setpoint, actuation)
    }

    /// The actuator frame. The safe state makes no further checks of memory that it reports, so a
    /// wheel speed limit corrupted in one channel must not be reported: the limit is the lower of
    /// both channels'.
    fn report(&mut self, own: &Actuation<T>, other: &Actuation<T>) -> (Actuation<T>, FrameBytes) {
        let limit_rpm = lower(own.wheel_speed_limit_rpm, other.wheel_speed_limit_rpm);
        let actuation = Actuation {
            wheel_speed_limit_rpm: limit_rpm,
            bridge_on: own.bridge_on && other.bridge_on,
            ..*own
        };
        let signals = actuation.map(&|signal: T| signal.to_f64() as f32);
        (actuation, encode_actuation(&signals, &mut self.sender))
    }
}

/// The task at the control rate.
#[derive(Debug, Clone)]
pub struct ControlTask<T: Real> {
    channels: DualChannel<Channel<T>>,
    frames_differed: bool,
}

impl<T: Real> ControlTask<T> {
    pub(super) fn new(scenario: &Scenario<T>, clock_hz: u32) -> Self {
        Self {
            channels: DualChannel::new(Channel {
                reception: Reception::new(),
                measurement: None,
                controller: Controller::new(scenario),
                supervisor: Supervisor::new(scenario, clock_hz),
                sender: Sender::new(ACTUATOR_DATA_ID),
            }),
            frames_differed: false,
        }
    }

    /// A control tick.
    pub fn run(&mut self, input: &ControlInput) -> ControlOutput<T> {
        self.run_with(input, &mut |_| {})
    }

    /// A control tick in which `change` alters each channel's command ahead of the gate, to inject a
    /// failure of the controller.
    pub fn run_with(
        &mut self,
        input: &ControlInput,
        change: &mut impl FnMut(&mut Command<T>),
    ) -> ControlOutput<T> {
        let mut found_outside = input.found_by_pwm;
        let channels_differ = self.frames_differed || !self.channels.agrees();
        found_outside.add_if(channels_differ, Fault::ChannelsDiffer);
        let [a, b] = self.channels.both();
        let (setpoint_a, actuation_a) = a.run(input, found_outside, change);
        let (setpoint_b, actuation_b) = b.run(input, found_outside, change);
        let pairs = [(actuation_a, actuation_b), (actuation_b, actuation_a)];
        let [(actuation, frame), (_, other_frame)] = self
            .channels
            .run_each(&pairs, |channel, (own, other)| channel.report(own, other));
        let bridge_on = self.channels.run(|channel| channel.supervisor.bridge_on());
        self.frames_differed = differ(&frame, &other_frame);
        ControlOutput {
            setpoints: [setpoint_a, setpoint_b],
            bridge_on,
            frame,
            actuation,
        }
    }
}

/// Word by word: on the target `==` on arrays calls a function that takes them byte by byte.
fn differ(a: &FrameBytes, b: &FrameBytes) -> bool {
    let (a, _) = a.as_chunks::<4>();
    let (b, _) = b.as_chunks::<4>();
    a.iter().ne(b)
}

/// The lower of two numbers, or the one that is finite.
fn lower<T: Real>(a: T, b: T) -> T {
    if b < a || !a.is_finite() { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dither::Waveform;
    use crate::ecu_schedule::Table;
    use crate::frame::{SENSOR_DATA_ID, encode_measurement};
    use crate::gate::Limits;
    use crate::parameter::ParameterSet;
    use crate::policy::{Policy, Suppression};
    use crate::signal::Mode;

    const CLOCK_HZ: u32 = 25_000_000;

    /// With all that the controller has.
    fn scenario() -> Scenario<f32> {
        let mut scenario = Scenario::reconstruction();
        scenario.controller.suppression = Suppression::Both;
        scenario.dither.waveform = Waveform::Square;
        scenario
    }

    /// A task with another channel in one place.
    fn damaged(channel: usize, damage: impl Fn(&mut Channel<f32>)) -> ControlTask<f32> {
        let mut task = ControlTask::new(&scenario(), CLOCK_HZ);
        let mut place = 0;
        task.channels.run(|one| {
            if place == channel {
                damage(one);
            }
            place += 1;
        });
        task
    }

    fn flip(number: &mut f32, bit: u32) {
        *number = f32::from_bits(number.to_bits() ^ (1 << bit));
    }

    fn assert_found(mut task: ControlTask<f32>, what: &str, bit: u32) {
        for _ in 0..3 {
            let output = task.run(&ControlInput::NOTHING);
            // A limit that has become a smaller one finds faults of its own.
            let faults = Faults::from_bits(output.actuation.faults);
            let is_found = faults.contains(Fault::ChannelsDiffer);
            assert!(is_found, "{what}, bit {bit}");
            assert_eq!(output.actuation.mode, Mode::Safe);
            // One is enough: the PWM task puts out the duty that is nearer to neutral.
            assert!(output.setpoints.contains(&Setpoint::neutral()));
            let limit_rpm = output.actuation.wheel_speed_limit_rpm;
            assert!(limit_rpm <= 1100.0, "{limit_rpm} rpm: {what}, bit {bit}");
        }
    }

    /// The safe state demands no higher speed because of it, either. Of limits that are rounded to ticks or
    /// counts the last bits have no effect, and those of the other waveform have none at all.
    #[test]
    fn sr13_every_flipped_bit_of_a_limit_is_found() {
        let right = Supervisor::new(&scenario(), CLOCK_HZ);
        let rounded = ["weak_dither_s", "frame_age_s", "tick_tolerance"];
        let at_pwm_rate = [
            "dither_frequency_min_rad_per_s",
            "dither_frequency_max_rad_per_s",
        ];
        for (channel, field) in [0, 1]
            .into_iter()
            .flat_map(|channel| Limits::<f32>::FIELDS.iter().map(move |f| (channel, f)))
        {
            let is_unused = field.name.starts_with("sine_") || at_pwm_rate.contains(&field.name);
            for bit in 0..32 {
                let mut scenario = scenario();
                flip((field.accessor)(&mut scenario.gate), bit);
                let supervisor = Supervisor::new(&scenario, CLOCK_HZ);
                if supervisor == right {
                    let is_rounded = bit < 21 && rounded.contains(&field.name);
                    assert!(is_unused || is_rounded, "{}, bit {bit}", field.name);
                    continue;
                }
                let task = damaged(channel, |one| one.supervisor = supervisor);
                assert_found(task, field.name, bit);
            }
        }
    }

    #[test]
    fn sr13_every_flipped_bit_of_the_policy_is_found() {
        for (channel, field) in [0, 1]
            .into_iter()
            .flat_map(|channel| Policy::<f32>::FIELDS.iter().map(move |f| (channel, f)))
        {
            for bit in 0..32 {
                let mut scenario = scenario();
                let right = Controller::new(&scenario);
                flip((field.accessor)(&mut scenario.controller), bit);
                let wrong = Controller::new(&scenario);
                // The last bits of some are rounded away: without an effect there is nothing to find.
                if wrong == right {
                    assert!(bit < 8, "{}, bit {bit}", field.name);
                    continue;
                }
                let task = damaged(channel, |one| one.controller = wrong);
                assert_found(task, field.name, bit);
            }
        }
    }

    /// The bridge is reported on if both channels have it on.
    #[test]
    fn a_channel_reports_the_bridge_of_both() {
        let actuation = |bridge_on| Actuation {
            mode: Mode::Active,
            faults: 0,
            motor_voltage_v: 0.0,
            dither_amplitude_v: 0.0,
            wheel_speed_limit_rpm: 1000.0,
            warnings: 0,
            sensor_counter: 0,
            bridge_on,
            challenge: 0,
        };
        let mut task = ControlTask::<f32>::new(&scenario(), CLOCK_HZ);
        for (own, other) in [(true, true), (true, false), (false, true), (false, false)] {
            let of_both =
                |one: &mut Channel<f32>| one.report(&actuation(own), &actuation(other)).0.bridge_on;
            assert_eq!(task.channels.run(of_both), [own && other; 2]);
        }
    }

    /// A flipped bit may change a frame's content and leave both channels equal: only the frames
    /// differ.
    #[test]
    fn frames_that_differ_are_found_in_the_next_tick() {
        for channel in [0, 1] {
            let mut task = damaged(channel, |one| one.sender = Sender::new(SENSOR_DATA_ID));
            task.run(&ControlInput::NOTHING);
            assert!(task.frames_differed);
        }
        let mut task = ControlTask::<f32>::new(&Scenario::reconstruction(), CLOCK_HZ);
        task.run(&ControlInput::NOTHING);
        assert!(!task.frames_differed);
        task.frames_differed = true;
        assert_found(task, "frame", 0);
    }

    #[test]
    fn frames_differ_in_any_bit() {
        let frame: FrameBytes = core::array::from_fn(|place| 7 * place as u8);
        assert!(!differ(&frame, &frame));
        for (place, bit) in (0..frame.len()).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
            let mut other = frame;
            other[place] ^= 1 << bit;
            assert!(differ(&frame, &other), "byte {place}, bit {bit}");
        }
    }

    /// A schedule that both channels have with a zero at the speed, as after a wrong flash.
    #[test]
    fn sr11_a_schedule_without_dither_at_a_speed_is_found() {
        for (waveform, start_ticks) in [(Waveform::Square, 0), (Waveform::Sine, 500)] {
            let mut scenario = Scenario::<f32>::reconstruction();
            scenario.dither.waveform = waveform;
            scenario.dither.start_time_s = start_ticks as f32 / 1000.0;
            let mut schedule = Table::of(waveform);
            // 1750 and 1775 rpm, the neighbours of the speed.
            schedule.amplitudes_v[30] = 0.0;
            schedule.amplitudes_v[31] = 0.0;
            let mut task = ControlTask::new(&scenario, CLOCK_HZ);
            task.channels
                .run(|one| one.controller = one.controller.with_schedule(schedule));
            let mut sender = Sender::new(SENSOR_DATA_ID);
            let (mut challenge, mut active_ticks) = (0, 0);
            let found = (0..3000).find_map(|_| {
                let measurement = Measurement {
                    wheel_speed_rpm: 1760.0,
                    yaw_rate_rad_per_s: 0.0,
                    steering_angle_rad: 0.0,
                    steering_rate_rad_per_s: 0.0,
                    current_request_a: 0.0,
                };
                let output = task.run(&ControlInput {
                    frame: Some(encode_measurement(&measurement, challenge, &mut sender)),
                    elapsed_counts: 25_000,
                    ..ControlInput::NOTHING
                });
                challenge = output.actuation.challenge;
                active_ticks += u32::from(output.actuation.mode == Mode::Active);
                let faults = Faults::from_bits(output.actuation.faults);
                (!faults.is_empty()).then_some(faults)
            });
            assert_eq!(found, Some(Fault::DitherWeak.into()));
            assert_eq!(active_ticks, start_ticks + 701, "0.7 s after the start");
        }
    }

    /// The channels do not compare the delay line: a value that differs is found once the feedback reads it.
    #[test]
    fn a_changed_value_of_the_delay_line_is_found_when_it_is_read() {
        let mut scenario = Scenario::<f32>::reconstruction();
        scenario.controller.suppression = Suppression::DelayedFeedback;
        scenario.dither.start_time_s = 0.0;
        // Not periodic: there is a torque.
        let measured = |tick: u32| Measurement {
            wheel_speed_rpm: 1750.0,
            yaw_rate_rad_per_s: 0.3 * Real::sin(0.005 * tick as f32),
            steering_angle_rad: 0.0,
            steering_rate_rad_per_s: 0.0,
            // Without a request the controller alone has no motor voltage yet.
            current_request_a: if tick < 1000 { 0.0 } else { 10.0 },
        };
        // A tick whose value the line keeps, in the past of the one channel.
        let changed_tick = 500;
        let controller = |is_changed: bool| {
            let mut controller = Controller::new(&scenario);
            for tick in 0..1000 {
                let mut measurement = measured(tick);
                if is_changed && tick == changed_tick {
                    measurement.yaw_rate_rad_per_s += 0.1;
                }
                controller.run(&measurement, true);
            }
            controller
        };
        let controllers = [controller(false), controller(true)];
        assert_eq!(controllers[0], controllers[1]);
        let mut task = ControlTask::new(&scenario, CLOCK_HZ);
        let mut own = controllers.iter();
        task.channels
            .run(|one| one.controller = *own.next().unwrap());
        let mut sender = Sender::new(SENSOR_DATA_ID);
        let mut challenge = 0;
        let found = (1000..4000).find(|&tick| {
            let output = task.run(&ControlInput {
                frame: Some(encode_measurement(&measured(tick), challenge, &mut sender)),
                elapsed_counts: 25_000,
                ..ControlInput::NOTHING
            });
            challenge = output.actuation.challenge;
            let faults = Faults::from_bits(output.actuation.faults);
            assert!(faults.is_empty() || faults == Fault::ChannelsDiffer.into());
            assert_eq!(faults.is_empty(), output.actuation.mode != Mode::Safe);
            !faults.is_empty()
        });
        // Within the four values that the interpolation reads, a period later.
        let read_tick = changed_tick + 1687;
        let found = found.expect("it is found");
        assert!(
            found.abs_diff(read_tick) <= 60,
            "{found}, read at {read_tick}"
        );
    }

    #[test]
    fn a_lower_speed_limit_of_one_channel_is_reported() {
        for channel in [0, 1] {
            let mut scenario = scenario();
            scenario.gate.safe_wheel_speed_rpm = 500.0;
            let supervisor = Supervisor::new(&scenario, CLOCK_HZ);
            let mut task = damaged(channel, |one| one.supervisor = supervisor);
            let output = task.run(&ControlInput::NOTHING);
            assert_eq!(output.actuation.wheel_speed_limit_rpm, 500.0);
        }
    }
}
