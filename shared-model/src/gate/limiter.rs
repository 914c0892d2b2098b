//! The gate at the PWM rate: the dither's samples and the duty on the servo's pin.

use super::{Fault, Faults, Setpoint};
use crate::Real;
use crate::dither::OSCILLATOR_SINE_ERROR;
use crate::scenario::Scenario;

/// Periods in a row in which the pin may show another duty: a capture that fell onto an edge.
const READBACK_TOLERANCE: u32 = 1;

/// The present half period of the dither.
#[derive(Debug, Clone, Copy, PartialEq)]
struct HalfPeriod {
    is_positive: bool,
    samples: u32,
    /// It began with a change of sign, not with the dither's onset.
    is_whole: bool,
}

/// The gate at the PWM rate.
///
/// The frequency is judged by the whole number of samples in each half period, so it is known to
/// one sample in that: at 10 kHz a limit of 5000 rad/s (6.28 samples) is found exceeded from 5240
/// rad/s (6 samples) upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limiter<T> {
    /// Least and most samples in half a period of the dither.
    half_period_samples: (u32, u32),
    /// `None` while there is no dither.
    half_period: Option<HalfPeriod>,
    expected_code: u16,
    mismatches: u32,
    faults: Faults,
    /// Error of a sample, as a share of the amplitude.
    sample_error: T,
}

impl<T: Real> Limiter<T> {
    /// The gate of a scenario, the servo at `neutral_code`.
    pub fn new(scenario: &Scenario<T>, neutral_code: u16) -> Self {
        let limits = &scenario.gate;
        let sample_error = T::from_f64(OSCILLATOR_SINE_ERROR);
        let samples = |frequency: T| {
            T::from_f64(core::f64::consts::PI) * scenario.run.pwm_rate_hz / frequency
        };
        // A half period falls between two whole numbers of samples, and may be off by the error of
        // its ends.
        let shortest = samples(limits.dither_frequency_max_rad_per_s) * (T::one() - sample_error);
        let longest = samples(limits.dither_frequency_min_rad_per_s) * (T::one() + sample_error);
        Self {
            half_period_samples: (shortest.to_u32(), longest.to_u32().saturating_add(1)),
            half_period: None,
            expected_code: neutral_code,
            mismatches: 0,
            faults: Faults::NONE,
            sample_error,
        }
    }

    /// Servo voltage of a PWM period: the motor's share and the dither's sample, the latter only if
    /// it is within its amplitude.
    pub fn run(&mut self, setpoint: &Setpoint<T>, dither_v: T) -> T {
        let amplitude_v = setpoint.dither_amplitude_v;
        // False for NaN.
        let is_within = dither_v.abs() <= amplitude_v * (T::one() + self.sample_error);
        let volts = setpoint.motor_v + if is_within { dither_v } else { T::zero() };
        self.faults.add_if(!is_within, Fault::DitherAmplitude);
        if amplitude_v == T::zero() {
            self.half_period = None;
        } else {
            self.judge_half_period(dither_v, amplitude_v);
        }
        volts
    }

    fn judge_half_period(&mut self, dither_v: T, amplitude_v: T) {
        let (least, most) = self.half_period_samples;
        let now = self.half_period.get_or_insert(HalfPeriod {
            is_positive: dither_v > T::zero(),
            samples: 0,
            is_whole: false,
        });
        // Closer to zero the sign of a sample may be that of its error.
        let sure_v = amplitude_v * self.sample_error;
        let has_changed = if now.is_positive {
            dither_v < -sure_v
        } else {
            dither_v > sure_v
        };
        let is_wrong = if has_changed {
            let is_short = now.is_whole && now.samples < least;
            *now = HalfPeriod {
                is_positive: !now.is_positive,
                samples: 1,
                is_whole: true,
            };
            is_short
        } else {
            now.samples = now.samples.saturating_add(1);
            now.samples > most
        };
        self.faults.add_if(is_wrong, Fault::DitherFrequency);
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

    /// All faults found since the start.
    pub fn faults(&self) -> Faults {
        self.faults
    }
}
