//! The gate at the control rate: sensors, time, and the controller's command.

use super::plausibility::Plausibility;
use super::{Fault, Faults, Setpoint};
use crate::Real;
use crate::dither::Waveform;
use crate::scenario::Scenario;
use crate::signal::{Measurement, Mode};

/// Rounding that a command may have beyond a limit, as a share of the greatest command.
const ROUNDING: f64 = 1e-6;

/// Input of the gate at a control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation<T> {
    /// Counts of the independent clock since the last control tick.
    pub elapsed_counts: u32,
    /// The measurement, if a valid frame brought a new one.
    pub measurement: Option<Measurement<T>>,
    /// Its age by the challenge that its frame returned, control ticks, from 1; without a measurement
    /// not used.
    pub measurement_age_ticks: u32,
    /// The controller's command: the motor's share of the voltage, V.
    pub motor_v: T,
    /// The controller's command: the delayed feedback's share, V.
    pub feedback_v: T,
    /// The controller's command: the dither's amplitude, V.
    pub dither_amplitude_v: T,
    /// Faults found elsewhere: by the gate at the PWM rate, or by comparing the program's
    /// channels.
    pub found_outside: Faults,
}

/// Faults after which the servo cannot be trusted to follow a ramp: its bridge is switched off.
const BRIDGE_FAULTS: Faults = Faults::of([Fault::Readback, Fault::ChannelsDiffer]);
/// Faults of the servo's path that are judged in the safe state too.
const SERVO_FAULTS: Faults = Faults::of([
    Fault::Readback,
    Fault::ChannelsDiffer,
    Fault::DitherAmplitude,
    Fault::DitherFrequency,
]);
/// Faults after which the safe state keeps the dither up.
const KEEP_DITHER: Faults = Faults::that_keep_dither();

/// Greatest magnitudes of a command, rounding included.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CommandLimits<T> {
    motor_v: T,
    /// Change of the motor's share in a control tick.
    motor_change_v: T,
    feedback_v: T,
    /// Change of the feedback's share in a control tick.
    feedback_change_v: T,
    dither_amplitude_v: T,
}

/// The shares of the motor's voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shares<T> {
    motor_v: T,
    feedback_v: T,
}

/// The least dither at the wheel speeds that need it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LeastDither<T> {
    amplitude_v: T,
    /// Most consecutive control ticks with less.
    max_weak_ticks: u32,
    /// Control ticks until it applies.
    ticks_to_start: u32,
    /// Consecutive control ticks with less.
    weak_ticks: u32,
}

impl<T: Real> LeastDither<T> {
    fn new(scenario: &Scenario<T>) -> Self {
        let limits = &scenario.gate;
        let ticks = |time_s: T| (time_s * scenario.run.control_rate_hz + T::from_f64(0.5)).to_u32();
        Self {
            amplitude_v: match scenario.suppressing_waveform() {
                Waveform::None => T::zero(),
                Waveform::Square => limits.square_least_amplitude_v,
                Waveform::Sine => limits.sine_least_amplitude_v,
            },
            max_weak_ticks: ticks(limits.weak_dither_s),
            ticks_to_start: ticks(scenario.dither.start_time_s),
            weak_ticks: 0,
        }
    }

    /// A control tick of an active ECU; returns whether the dither has been too weak for too long.
    fn is_missed(&mut self, is_needed: bool, amplitude_v: T) -> bool {
        if self.ticks_to_start > 0 {
            self.ticks_to_start -= 1;
            return false;
        }
        self.weak_ticks = if is_needed && amplitude_v < self.amplitude_v {
            self.weak_ticks.saturating_add(1)
        } else {
            0
        };
        self.weak_ticks > self.max_weak_ticks
    }
}

/// The gate at the control rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervisor<T> {
    plausibility: Plausibility<T>,
    /// Greatest wheel speed of the vehicle, and that of the safe state, rpm.
    wheel_speed_rpm: T,
    safe_wheel_speed_rpm: T,
    command_limits: CommandLimits<T>,
    /// Change of the motor's share in a control tick of the safe state, V.
    slew_v: T,
    /// Amplitude that the safe state keeps up while the dither can be trusted, V; zero if it began
    /// without a dither.
    safe_amplitude_v: T,
    /// Change of the amplitude in a control tick of the safe state, V.
    ramp_v: T,
    /// Least and most counts of the clock in a control tick.
    window_counts: (u32, u32),
    frame_age_ticks: u32,
    /// Age of the last measurement.
    age_ticks: u32,
    least_dither: LeastDither<T>,
    mode: Mode,
    faults: Faults,
    /// Faults found outside so far, and late ticks of the safe state.
    found: Faults,
    bridge_on: bool,
    setpoint: Setpoint<T>,
    /// Of the last command that passed.
    shares: Shares<T>,
}

impl<T: Real> Supervisor<T> {
    /// The gate of a scenario, whose clock runs at `clock_hz`.
    pub fn new(scenario: &Scenario<T>, clock_hz: u32) -> Self {
        let limits = scenario.gate;
        let period_s = T::one() / scenario.run.control_rate_hz;
        let speed_per_rpm = scenario.vehicle.speed_m_per_s(T::one());
        let (amplitude_limit_v, safe_amplitude_v) = match scenario.suppressing_waveform() {
            Waveform::None => (T::zero(), T::zero()),
            Waveform::Square => (limits.square_amplitude_v, limits.square_safe_amplitude_v),
            Waveform::Sine => (limits.sine_amplitude_v, limits.sine_safe_amplitude_v),
        };
        let slew_v = limits.motor_slew_v_per_s * period_s;
        let feedback_limit_v = if scenario.controller.suppression.has_feedback() {
            limits.feedback_voltage_v
        } else {
            T::zero()
        };
        let feedback_slew_v = limits.feedback_slew_v_per_s * period_s;
        let rounding = T::from_f64(ROUNDING);
        let counts = T::from_u32(clock_hz) * period_s;
        let tolerance = limits.tick_tolerance * counts;
        Self {
            plausibility: Plausibility::new(&limits, period_s, speed_per_rpm),
            wheel_speed_rpm: limits.wheel_speed_rpm,
            safe_wheel_speed_rpm: limits.safe_wheel_speed_rpm,
            command_limits: CommandLimits {
                motor_v: limits.motor_voltage_v * (T::one() + rounding),
                motor_change_v: slew_v + rounding * limits.motor_voltage_v,
                feedback_v: feedback_limit_v * (T::one() + rounding),
                feedback_change_v: feedback_slew_v + rounding * feedback_limit_v,
                dither_amplitude_v: amplitude_limit_v * (T::one() + rounding),
            },
            slew_v,
            safe_amplitude_v,
            ramp_v: amplitude_limit_v * period_s / limits.ramp_out_s,
            window_counts: ((counts - tolerance).to_u32(), (counts + tolerance).to_u32()),
            frame_age_ticks: limits.frame_age_ticks(scenario.run.control_rate_hz),
            age_ticks: 0,
            least_dither: LeastDither::new(scenario),
            mode: Mode::Starting,
            faults: Faults::NONE,
            found: Faults::NONE,
            bridge_on: true,
            setpoint: Setpoint::neutral(),
            shares: Shares {
                motor_v: T::zero(),
                feedback_v: T::zero(),
            },
        }
    }

    /// A control tick: judges the observation, and passes a command within the limits.
    pub fn run(&mut self, seen: &Observation<T>) -> Setpoint<T> {
        self.judge_bridge(seen.found_outside);
        // Findings after a fault are its consequences.
        if self.mode != Mode::Safe {
            let found = self.judge(seen);
            self.faults |= found;
            self.mode = self.next_mode(seen.measurement.is_some());
        }
        match self.mode {
            Mode::Starting => self.setpoint = Setpoint::neutral(),
            Mode::Active => {
                self.shares = Shares {
                    motor_v: seen.motor_v,
                    feedback_v: seen.feedback_v,
                };
                self.setpoint = Setpoint {
                    motor_v: seen.motor_v + seen.feedback_v,
                    dither_amplitude_v: seen.dither_amplitude_v,
                };
            }
            Mode::Safe => self.step_safe_state(seen.elapsed_counts),
        }
        self.setpoint
    }

    /// Switches the bridge off after a fault in which the servo may not follow its ramp to neutral,
    /// and after any fault of its path that the safe state's ramp adds to those known before.
    fn judge_bridge(&mut self, found_outside: Faults) {
        let added = found_outside.without(self.found);
        let ramp_is_wrong = self.mode == Mode::Safe && added.intersects(SERVO_FAULTS);
        self.bridge_on &= !(found_outside.intersects(BRIDGE_FAULTS) || ramp_is_wrong);
        self.found |= found_outside;
    }

    fn is_in_time(&self, elapsed_counts: u32) -> bool {
        let (least, most) = self.window_counts;
        (least..=most).contains(&elapsed_counts)
    }

    fn next_mode(&self, has_measurement: bool) -> Mode {
        if !self.faults.is_empty() {
            Mode::Safe
        } else if has_measurement {
            Mode::Active
        } else {
            self.mode
        }
    }

    fn judge(&mut self, seen: &Observation<T>) -> Faults {
        let mut faults = seen.found_outside;
        faults |= self.plausibility.check(seen.measurement.as_ref());
        faults |= self.command_faults(seen);
        self.age_ticks = match seen.measurement {
            Some(_) => seen.measurement_age_ticks,
            None => self.age_ticks.saturating_add(1),
        };
        // Before the first frame the times since the last tick and frame are undefined; until then
        // the servo is neutral.
        if self.mode == Mode::Starting {
            return faults;
        }
        let is_old = self.age_ticks > self.frame_age_ticks;
        faults.add_if(is_old, Fault::FrameAge);
        let is_needed = self.plausibility.is_dither_needed();
        let amplitude_v = seen.dither_amplitude_v;
        let is_missed = self.least_dither.is_missed(is_needed, amplitude_v);
        faults.add_if(is_missed, Fault::DitherWeak);
        let is_late = !self.is_in_time(seen.elapsed_counts);
        faults.add_if(is_late, Fault::TickWindow);
        faults
    }

    fn command_faults(&self, seen: &Observation<T>) -> Faults {
        let (motor_v, amplitude_v) = (seen.motor_v, seen.dither_amplitude_v);
        let feedback_v = seen.feedback_v;
        if !(motor_v.is_finite() && feedback_v.is_finite() && amplitude_v.is_finite()) {
            return Fault::CommandNotANumber.into();
        }
        let limits = &self.command_limits;
        let change_v = motor_v - self.shares.motor_v;
        let feedback_change_v = feedback_v - self.shares.feedback_v;
        let is_motor = motor_v.abs() > limits.motor_v;
        let is_sum = (motor_v + feedback_v).abs() > limits.motor_v;
        let is_feedback = feedback_v.abs() > limits.feedback_v;
        let is_feedback_change = feedback_change_v.abs() > limits.feedback_change_v;
        let is_amplitude = amplitude_v >= T::zero() && amplitude_v <= limits.dither_amplitude_v;
        let mut faults = Faults::NONE;
        faults.add_if(is_motor || is_sum, Fault::MotorVoltage);
        faults.add_if(change_v.abs() > limits.motor_change_v, Fault::MotorSlew);
        faults.add_if(is_feedback, Fault::FeedbackVoltage);
        faults.add_if(is_feedback_change, Fault::FeedbackSlew);
        faults.add_if(!is_amplitude, Fault::DitherCommand);
        faults
    }

    /// The motor without voltage. The dither, while it can be trusted, at an amplitude that suppresses
    /// the chaos at any speed. It is kept, not begun, unless it is what was missing.
    #[inline(never)]
    fn step_safe_state(&mut self, elapsed_counts: u32) {
        let is_late = !self.is_in_time(elapsed_counts);
        self.found.add_if(is_late, Fault::TickWindow);
        let is_on = self.setpoint.dither_amplitude_v > T::zero();
        if !is_on && !self.faults.contains(Fault::DitherWeak) {
            self.safe_amplitude_v = T::zero();
        }
        let mut found = self.faults;
        found |= self.found;
        let is_trusted = found.without(KEEP_DITHER).is_empty();
        let amplitude_v = if is_trusted {
            self.safe_amplitude_v
        } else {
            T::zero()
        };
        self.setpoint = Setpoint {
            motor_v: stepped(self.setpoint.motor_v, T::zero(), self.slew_v),
            dither_amplitude_v: stepped(self.setpoint.dither_amplitude_v, amplitude_v, self.ramp_v),
        };
    }

    /// The ECU's operating mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Greatest age of a measurement, control ticks.
    pub fn frame_age_ticks(&self) -> u32 {
        self.frame_age_ticks
    }

    /// Whether a measurement is above the greatest wheel speed of the vehicle.
    pub fn is_overspeed(&self, measurement: &Measurement<T>) -> bool {
        measurement.wheel_speed_rpm > self.wheel_speed_rpm
    }

    /// Whether the servo's bridge may be on. Once off, it is off until restart.
    pub fn bridge_on(&self) -> bool {
        self.bridge_on
    }

    /// The faults that caused the safe state.
    pub fn faults(&self) -> Faults {
        self.faults
    }

    /// Wheel speed that the vehicle must not exceed, rpm.
    pub fn wheel_speed_limit_rpm(&self) -> T {
        match self.mode {
            Mode::Active => self.wheel_speed_rpm,
            Mode::Starting | Mode::Safe => self.safe_wheel_speed_rpm,
        }
    }
}

/// `value` moved to `target` by at most `step`.
fn stepped<T: Real>(value: T, target: T, step: T) -> T {
    if value > target + step {
        value - step
    } else if value < target - step {
        value + step
    } else {
        target
    }
}
