//! Faults of sensors, links and servo, injected between vehicle and ECU.

use super::catalogue::{Fault, Kind, LinkFailure, SensorFailure, ServoFailure};
use crate::disturbance::{Disturbance, DutyCodes};
use shared_model::Scenario;
use shared_model::e2e::Sender;
use shared_model::exchange::{FRAME_LEN, FrameBytes};
use shared_model::frame::{ACTUATOR_DATA_ID, SENSOR_DATA_ID};
use shared_model::gate::Limits;
use shared_model::servo::Pwm;
use shared_model::signal::Measurement;
use std::collections::VecDeque;

/// Frames kept for repetition: one more than the period of the counter.
const KEPT_FRAMES: usize = 257;
/// Duties kept: more than one period of the slowest dither.
const KEPT_DUTIES: usize = 40;

/// Passes all signals unchanged until a fault begins.
#[derive(Debug, Clone)]
pub struct Injector {
    limits: Limits<f64>,
    control_period_s: f32,
    fault: Option<Fault>,
    /// Control ticks since the fault began.
    ticks: u32,
    /// The last measurement before the fault.
    last: Option<Measurement<f32>>,
    sensor_link: Link,
    actuator_link: Link,
    servo: Servo,
    was_changed: bool,
}

impl Injector {
    /// For a loop of that scenario.
    pub fn new(scenario: &Scenario<f64>) -> Self {
        let neutral = Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz).neutral();
        Self {
            limits: scenario.gate,
            control_period_s: (1.0 / scenario.run.control_rate_hz) as f32,
            fault: None,
            ticks: 0,
            last: None,
            sensor_link: Link::new(SENSOR_DATA_ID, ACTUATOR_DATA_ID),
            actuator_link: Link::new(ACTUATOR_DATA_ID, SENSOR_DATA_ID),
            servo: Servo::new(neutral.period()),
            was_changed: false,
        }
    }

    /// Begins a fault. Call directly after a control tick.
    pub fn begin(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    /// Whether a permanent fault changed a sensor value or the duty of the servo.
    pub fn is_value_corrupted(&self) -> bool {
        self.was_changed && self.fault.is_some_and(|fault| fault.ticks.is_none())
    }

    fn active(&self) -> Option<Kind> {
        let fault = self.fault?;
        let is_on = fault.ticks.is_none_or(|ticks| self.ticks < ticks);
        is_on.then_some(fault.kind)
    }
}

impl Disturbance for Injector {
    fn actuator_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        let Some(Kind::ActuatorLink(failure)) = self.active() else {
            return self.actuator_link.pass(sent);
        };
        self.ticks += u32::from(sent.is_some());
        self.actuator_link.fail(failure, sent)
    }

    fn duty(&mut self, code: u16) -> DutyCodes {
        let (driven, is_seen) = match self.active() {
            Some(Kind::Servo(failure)) => (self.servo.fail(failure, code), true),
            Some(Kind::ServoBehindReadback(failure)) => (self.servo.fail(failure, code), false),
            _ => (self.servo.pass(code), true),
        };
        self.was_changed |= driven != code;
        let captured = if is_seen { driven } else { code };
        DutyCodes { driven, captured }
    }

    fn measurement(&mut self, measured: Measurement<f32>) -> Measurement<f32> {
        let mut changed = measured;
        match self.active() {
            Some(Kind::Sensor(signal, failure)) => {
                let mut last = self.last.unwrap_or(measured);
                let value = signal.of(&mut changed);
                let range = signal.range(&self.limits) as f32;
                let since_s = self.ticks as f32 * self.control_period_s;
                *value = failed(failure, *value, *signal.of(&mut last), range, since_s);
            }
            Some(Kind::Swapped(a, b)) => {
                let mut measured = measured;
                *a.of(&mut changed) = *b.of(&mut measured);
                *b.of(&mut changed) = *a.of(&mut measured);
            }
            _ => self.last = Some(measured),
        }
        self.was_changed |= changed != measured;
        changed
    }

    fn sensor_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        let active = self.active();
        if let Some(Kind::Sensor(..) | Kind::Swapped(..) | Kind::SensorLink(_)) = active {
            self.ticks += u32::from(sent.is_some());
        }
        match active {
            Some(Kind::SensorLink(failure)) => self.sensor_link.fail(failure, sent),
            _ => self.sensor_link.pass(sent),
        }
    }
}

/// Output of a failed sensor in place of `value`.
fn failed(failure: SensorFailure, value: f32, last: f32, range: f32, since_s: f32) -> f32 {
    match failure {
        SensorFailure::NotANumber => f32::NAN,
        SensorFailure::Infinite => f32::INFINITY,
        SensorFailure::Subnormal => f32::MIN_POSITIVE / 2.0,
        SensorFailure::OutOfRange => 1.5 * range,
        SensorFailure::Stuck => last,
        SensorFailure::Step(share) => last + share * range,
        SensorFailure::Offset(share) => value + share * range,
        SensorFailure::Drift(share) => value + share * range * since_s,
        SensorFailure::DropOut => 0.0,
    }
}

/// A link and its past frames.
#[derive(Debug, Clone)]
struct Link {
    data_id: u16,
    other_data_id: u16,
    /// Frames before the fault, the newest last.
    seen: VecDeque<FrameBytes>,
    /// Delayed frames.
    late: VecDeque<FrameBytes>,
    /// Frames since the fault began.
    failed: usize,
}

impl Link {
    fn new(data_id: u16, other_data_id: u16) -> Self {
        Self {
            data_id,
            other_data_id,
            seen: VecDeque::new(),
            late: VecDeque::new(),
            failed: 0,
        }
    }

    fn pass(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        if let Some(frame) = sent {
            self.seen.push_back(frame);
            if self.seen.len() > KEPT_FRAMES {
                self.seen.pop_front();
            }
        }
        sent
    }

    fn fail(&mut self, failure: LinkFailure, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        let mut frame = sent?;
        let number = self.failed;
        self.failed += 1;
        match failure {
            LinkFailure::Corruption { bit } => {
                frame[usize::from(bit) / 8 % FRAME_LEN] ^= 1 << (bit % 8);
                Some(frame)
            }
            LinkFailure::Repetition => self.seen.back().copied(),
            LinkFailure::Loss => None,
            LinkFailure::TwoOfThreeLost => (number % 3 == 2).then_some(frame),
            LinkFailure::Delay { ticks } => self.delay(frame, ticks),
            LinkFailure::GrowingDelay { interval_ticks } => {
                self.delay(frame, number / interval_ticks)
            }
            LinkFailure::Replay { frames } => {
                let first = self.seen.len().checked_sub(frames)?;
                self.seen.get(first + number % frames).copied()
            }
            LinkFailure::Insertion { age_ticks } => {
                let index = self.seen.len().checked_sub(age_ticks)?;
                self.seen.get(index).copied()
            }
            LinkFailure::Masquerade => Some(protected(frame, self.other_data_id, frame[2])),
            LinkFailure::WrongSequence { ahead } => {
                let counter = frame[2].wrapping_add(ahead);
                Some(protected(frame, self.data_id, counter))
            }
        }
    }

    fn delay(&mut self, frame: FrameBytes, ticks: usize) -> Option<FrameBytes> {
        self.late.push_back(frame);
        let is_over = self.late.len() > ticks;
        is_over.then(|| self.late.pop_front()).flatten()
    }
}

/// The frame with another header.
fn protected(mut frame: FrameBytes, data_id: u16, counter: u8) -> FrameBytes {
    Sender::starting_at(data_id, counter).protect(&mut frame);
    frame
}

/// A servo and its past duties.
#[derive(Debug, Clone)]
struct Servo {
    period: u16,
    /// Duty codes, the newest last.
    codes: VecDeque<u16>,
    /// The last duty.
    driven: u16,
    /// PWM periods for which that duty has been held.
    held: u32,
}

impl Servo {
    fn new(period: u16) -> Self {
        Self {
            period,
            codes: VecDeque::new(),
            driven: period / 2,
            held: 0,
        }
    }

    fn pass(&mut self, code: u16) -> u16 {
        self.codes.push_back(code);
        if self.codes.len() > KEPT_DUTIES {
            self.codes.pop_front();
        }
        self.driven = code;
        self.held = 1;
        code
    }

    fn fail(&mut self, failure: ServoFailure, code: u16) -> u16 {
        let last = self.driven;
        let held = self.held;
        self.pass(code);
        self.held = held + 1;
        let driven = match failure {
            ServoFailure::Stuck => last,
            ServoFailure::Saturated { high: true } => self.period,
            ServoFailure::Saturated { high: false } => 0,
            ServoFailure::DitherPhase { periods } => {
                let index = self.codes.len().saturating_sub(periods + 1);
                self.codes.get(index).copied().unwrap_or(code)
            }
            ServoFailure::DitherInverted => self.mirrored(code),
            ServoFailure::DitherFrequency { held: most } if held < most => last,
            ServoFailure::DitherFrequency { .. } => {
                self.held = 1;
                code
            }
            ServoFailure::Offset { counts } => code.saturating_add_signed(counts),
        };
        self.driven = driven;
        driven
    }

    /// The code mirrored at the mean of the extremes of the kept duties.
    fn mirrored(&self, code: u16) -> u16 {
        let low = self.codes.iter().min().copied().unwrap_or(code);
        let high = self.codes.iter().max().copied().unwrap_or(code);
        low + high - code
    }
}
