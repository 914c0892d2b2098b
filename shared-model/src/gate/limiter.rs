//! The gate at the PWM rate: the dither's samples and the duty on the servo's pin.

use super::{Fault, Faults, Setpoint};
use crate::Real;
use crate::scenario::Scenario;

/// Rounding of a sample above its amplitude, as a share of it: the oscillator's error.
const SAMPLE_ERROR: f64 = crate::dither::OSCILLATOR_SINE_ERROR;
/// Periods in a row in which the pin may show another duty: a capture that fell onto an edge.
const READBACK_TOLERANCE: u32 = 1;

/// The gate at the PWM rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limiter<T> {
    /// Least and most samples in half a period of the dither.
    half_period_samples: (u32, u32),
    /// The dither's last sample was positive; `None` while there is no dither.
    was_positive: Option<bool>,
    samples_since_change: u32,
    /// The dither has changed its sign since it set in, so that the next half period is a whole one.
    is_timed: bool,
    expected_code: u16,
    mismatches: u32,
    faults: Faults,
    amplitude_v: T,
}

impl<T: Real> Limiter<T> {
    /// The gate of a scenario, the servo at `neutral_code`.
    pub fn new(scenario: &Scenario<T>, neutral_code: u16) -> Self {
        let limits = &scenario.gate;
        let half_turn_samples = |frequency: T| {
            T::from_f64(core::f64::consts::PI) * scenario.run.pwm_rate_hz / frequency
        };
        let least = half_turn_samples(limits.dither_frequency_max_rad_per_s).to_u32();
        let most = half_turn_samples(limits.dither_frequency_min_rad_per_s).to_u32();
        Self {
            // A half period falls between two whole numbers of samples.
            half_period_samples: (least, most.saturating_add(1)),
            was_positive: None,
            samples_since_change: 0,
            is_timed: false,
            expected_code: neutral_code,
            mismatches: 0,
            faults: Faults::NONE,
            amplitude_v: T::zero(),
        }
    }

    /// Servo voltage of a PWM period: the motor's share and the dither's sample, the latter cut to its amplitude.
    pub fn run(&mut self, setpoint: &Setpoint<T>, dither_v: T) -> T {
        self.amplitude_v = setpoint.dither_amplitude_v;
        let bound = self.amplitude_v * T::from_f64(1.0 + SAMPLE_ERROR);
        // Written so that NaN is above the bound.
        let is_above = !(dither_v.abs() <= bound);
        self.faults.add_if(is_above, Fault::DitherAmplitude);
        self.check_frequency(dither_v);
        let limited = if dither_v > bound {
            bound
        } else if dither_v < -bound {
            -bound
        } else if is_above {
            T::zero()
        } else {
            dither_v
        };
        setpoint.motor_v + limited
    }

    fn check_frequency(&mut self, dither_v: T) {
        if self.amplitude_v == T::zero() {
            self.was_positive = None;
            return;
        }
        let is_positive = dither_v > T::zero();
        let Some(was_positive) = self.was_positive.replace(is_positive) else {
            self.is_timed = false;
            self.samples_since_change = 0;
            return;
        };
        let (least, most) = self.half_period_samples;
        self.samples_since_change = self.samples_since_change.saturating_add(1);
        let is_late = self.samples_since_change > most;
        if is_positive != was_positive {
            let is_early = self.is_timed && self.samples_since_change < least;
            self.faults.add_if(is_early, Fault::DitherFrequency);
            self.samples_since_change = 0;
            self.is_timed = true;
        }
        self.faults.add_if(is_late, Fault::DitherFrequency);
    }

    /// The duty code that is put out.
    pub fn expect(&mut self, code: u16) {
        self.expected_code = code;
    }

    /// The duty code that the pin showed in the period.
    pub fn observe(&mut self, captured_code: u16) {
        self.mismatches = if captured_code == self.expected_code {
            0
        } else {
            self.mismatches.saturating_add(1)
        };
        self.faults
            .add_if(self.mismatches > READBACK_TOLERANCE, Fault::Readback);
    }

    /// Everything found since the start.
    pub fn faults(&self) -> Faults {
        self.faults
    }
}
