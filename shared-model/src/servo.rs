//! Servo drive: volts to PWM duty and back.
//!
//! A full bridge at duty d puts the mean voltage (2 d - 1) V_bus on the servo, so half duty is
//! neutral. The timer counts the duty in whole steps of its period.

use crate::Real;
use crate::parameter::parameters;
use core::fmt;

parameters! {
    section "servo";
    /// Parameters of the servo drive. The paper has none; these are assumed.
    pub struct Servo {
        /// Bus voltage, V.
        bus_voltage_v: 0.1..=1000.0,
        /// Resistance of the motor's winding, ohm: turns the motor current into the voltage that drives it at rest.
        winding_resistance_ohm: 0.0..=100.0,
        /// Clock of the PWM timer, Hz. The carrier period is this over the PWM rate, in whole counts.
        timer_clock_hz: 1e3..=1e9,
    }
}

impl<T: Real> Servo<T> {
    /// Counts of the timer in one carrier period, rounded; 0 and values over 65535 do not fit a
    /// timer.
    pub fn period_counts(&self, pwm_rate_hz: T) -> u32 {
        (self.timer_clock_hz / pwm_rate_hz + T::from_f64(0.5)).to_u32()
    }
}

/// Duty cycle as the timer has it: `code` counts high out of `period`. The code is never above the
/// period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Duty {
    code: u16,
    period: u16,
}

/// A duty code above the timer's period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DutyOutOfRange {
    /// The code that was refused.
    pub code: u16,
    /// Greatest allowed code.
    pub period: u16,
}

impl fmt::Display for DutyOutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "duty code {}: must be from 0 to {}",
            self.code, self.period
        )
    }
}

impl core::error::Error for DutyOutOfRange {}

impl Duty {
    /// A duty of `code` counts out of `period`.
    ///
    /// # Errors
    /// If the code is above the period.
    ///
    /// ```
    /// use shared_model::servo::Duty;
    /// assert_eq!(Duty::new(1250, 2500).unwrap().code(), 1250);
    /// assert!(Duty::new(2501, 2500).is_err());
    /// ```
    pub fn new(code: u16, period: u16) -> Result<Self, DutyOutOfRange> {
        if code > period {
            return Err(DutyOutOfRange { code, period });
        }
        Ok(Self { code, period })
    }

    /// Counts high.
    pub fn code(self) -> u16 {
        self.code
    }

    /// Counts of a carrier period.
    pub fn period(self) -> u16 {
        self.period
    }

    /// The middle one of this and two others of the same period.
    ///
    /// ```
    /// use shared_model::servo::Duty;
    /// let [low, middle, high] = [700, 1250, 1800].map(|code| Duty::new(code, 2500).unwrap());
    /// assert_eq!(middle.median(high, low), middle);
    /// assert_eq!(middle.median(high, high), high);
    /// ```
    #[must_use]
    pub fn median(self, a: Self, b: Self) -> Self {
        let (low, high) = (a.code.min(b.code), a.code.max(b.code));
        Self {
            code: self.code.max(low).min(high),
            period: self.period,
        }
    }
}

/// The servo's PWM: conversion between volts and duty at one carrier frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pwm<T> {
    period: u16,
    counts_per_volt: T,
    midpoint: T,
}

impl<T: Real> Pwm<T> {
    /// The PWM of a servo at the given carrier frequency. A period that fits no 16-bit timer is cut
    /// to 65535 counts; [`Scenario::validate`](crate::Scenario::validate) refuses it before.
    pub fn new(servo: &Servo<T>, pwm_rate_hz: T) -> Self {
        let period = u16::try_from(servo.period_counts(pwm_rate_hz)).unwrap_or(u16::MAX);
        let midpoint = T::from_f64(0.5) * T::from_u32(period.into());
        Self {
            period,
            counts_per_volt: midpoint / servo.bus_voltage_v,
            midpoint,
        }
    }

    /// The duty nearest to `volts`; outside the bus voltage it saturates, and NaN gives the neutral
    /// duty.
    ///
    /// ```
    /// use shared_model::{Scenario, servo::Pwm};
    /// let pwm = Pwm::new(&Scenario::reconstruction().servo, 10e3);
    /// assert_eq!(pwm.duty(0.0).code(), 1250);
    /// assert_eq!(pwm.duty(0.1).code(), 1260);
    /// assert_eq!(pwm.duty(100.0).code(), 2500);
    /// assert_eq!(pwm.duty(-100.0).code(), 0);
    /// assert_eq!(pwm.duty(f64::NAN), pwm.neutral());
    /// ```
    pub fn duty(&self, volts: T) -> Duty {
        let counts = self.midpoint + volts * self.counts_per_volt;
        let top = T::from_u32(self.period.into());
        let code = if counts >= top {
            self.period
        } else if counts >= T::zero() {
            // Below the period, so it fits; the minimum makes that evident to the compiler.
            let rounded = (counts + T::from_f64(0.5)).to_u32();
            rounded.min(self.period.into()) as u16
        } else if counts < T::zero() {
            0
        } else {
            self.neutral().code
        };
        Duty {
            code,
            period: self.period,
        }
    }

    /// Mean voltage of a duty, V.
    ///
    /// ```
    /// use shared_model::{Scenario, servo::Pwm};
    /// let pwm = Pwm::new(&Scenario::reconstruction().servo, 10e3);
    /// assert!((pwm.volts(pwm.duty(1.0)) - 1.0_f64).abs() <= 0.5 * pwm.volts_per_count());
    /// ```
    pub fn volts(&self, duty: Duty) -> T {
        (T::from_u32(duty.code.into()) - self.midpoint) / self.counts_per_volt
    }

    /// Voltage of one count, V: the resolution.
    pub fn volts_per_count(&self) -> T {
        T::one() / self.counts_per_volt
    }

    /// The duty of no voltage, to within half a count.
    pub fn neutral(&self) -> Duty {
        Duty {
            code: self.period / 2,
            period: self.period,
        }
    }
}
