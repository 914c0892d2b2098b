//! Dither: a fast signal added ahead of a nonlinearity, which then acts on the slow motion through
//! its mean.
//!
//! Two ways to apply it. *Averaged*: the model uses the effective nonlinearity, (21) for a square
//! wave and (23) for a sine. *Signal*: the model is stepped at the PWM rate and each step sees the
//! sample of the true signal that the PWM holds.

use crate::Real;
use crate::listed;
use crate::parameter::parameters;

/// Greatest error of the oscillator's sine on the ECU (micromath in f32), measured over all phases
/// by a test of this module. It is 1.1 mV at an amplitude of 1 V, a ninth of one PWM step of the
/// presets.
pub const OSCILLATOR_SINE_ERROR: f64 = 1.2e-3;

listed! {
    /// Shape of the dither.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum Waveform {
        /// No dither.
        None => "none",
        /// Square wave of equal halves, equation (21).
        Square => "square",
        /// Sine, equation (23).
        Sine => "sine",
    }
}

listed! {
    /// How the dither reaches the model.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum Application {
        /// As effective nonlinearity, the model stepped at the control rate.
        Averaged => "averaged",
        /// As the true signal, the model stepped at the PWM rate.
        Signal => "signal",
    }
}

parameters! {
    section "dither";
    /// The dither's parameters.
    pub struct Dither {
        choices {
            /// Shape.
            waveform: Waveform,
            /// How it reaches the model.
            application: Application,
        }
        /// Amplitude W, V.
        amplitude_v: 0.0..=1000.0,
        /// Angular frequency of the square wave, rad/s.
        square_frequency_rad_per_s: 1.0..=1e6,
        /// Angular frequency of the sine, rad/s.
        sine_frequency_rad_per_s: 1.0..=1e6,
        /// Start time of the dither, s, and of the ECU's delayed feedback.
        start_time_s: 0.0..=1e5,
        /// Angle that one volt of square wave adds ahead of the nonlinearities, rad/V. The paper uses volts as an angle and
        /// gives no conversion.
        square_rad_per_volt: 0.0..=100.0,
        /// The same for the sine.
        sine_rad_per_volt: 0.0..=100.0,
    }
}

impl<T: Real> Dither<T> {
    /// Angular frequency of the chosen waveform, rad/s.
    pub fn frequency_rad_per_s(&self) -> T {
        match self.waveform {
            Waveform::None => T::zero(),
            Waveform::Square => self.square_frequency_rad_per_s,
            Waveform::Sine => self.sine_frequency_rad_per_s,
        }
    }

    /// Amplitude of the chosen waveform, V; zero without dither.
    pub fn active_amplitude_v(&self) -> T {
        match self.waveform {
            Waveform::None => T::zero(),
            Waveform::Square | Waveform::Sine => self.amplitude_v,
        }
    }

    /// Amplitude ahead of the nonlinearities, rad.
    ///
    /// ```
    /// use shared_model::{Scenario, dither::Waveform};
    /// let mut dither = Scenario::<f64>::reconstruction().dither;
    /// dither.waveform = Waveform::Square;
    /// dither.amplitude_v = 0.1;
    /// assert_eq!(dither.amplitude_rad(), 0.1);
    /// dither.waveform = Waveform::Sine;
    /// dither.amplitude_v = 1.0;
    /// assert!((dither.amplitude_rad() - 0.159_155).abs() < 1e-6);
    /// ```
    pub fn amplitude_rad(&self) -> T {
        let rad_per_volt = match self.waveform {
            Waveform::None => T::zero(),
            Waveform::Square => self.square_rad_per_volt,
            Waveform::Sine => self.sine_rad_per_volt,
        };
        self.amplitude_v * rad_per_volt
    }

    /// Effect on the nonlinearities once the dither is on: the mean over its period, or `sample`
    /// (in units of the amplitude) held over one step.
    pub fn injection(&self, sample: T) -> Injection<T> {
        let amplitude = self.amplitude_rad();
        match (self.waveform, self.application) {
            (Waveform::None, _) => Injection::Off,
            (_, Application::Signal) => Injection::Shift {
                offset: amplitude * sample,
            },
            (Waveform::Square, Application::Averaged) => Injection::SquareMean { amplitude },
            (Waveform::Sine, Application::Averaged) => Injection::SineMean { amplitude },
        }
    }
}

/// Effect of the dither on the argument of a nonlinearity during one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Injection<T> {
    /// Nothing.
    Off,
    /// Mean over a square wave of this amplitude (rad), equation (21).
    SquareMean {
        /// Amplitude, rad.
        amplitude: T,
    },
    /// Mean over a sine of this amplitude (rad), equation (23).
    SineMean {
        /// Amplitude, rad.
        amplitude: T,
    },
    /// One sample of the true signal, held over the step.
    Shift {
        /// The sample, rad.
        offset: T,
    },
}

impl<T> Injection<T> {
    /// The same dither in another arithmetic.
    pub fn map<U>(self, f: impl Fn(T) -> U) -> Injection<U> {
        match self {
            Self::Off => Injection::Off,
            Self::SquareMean { amplitude } => Injection::SquareMean {
                amplitude: f(amplitude),
            },
            Self::SineMean { amplitude } => Injection::SineMean {
                amplitude: f(amplitude),
            },
            Self::Shift { offset } => Injection::Shift { offset: f(offset) },
        }
    }
}

impl<T: Real> Injection<T> {
    /// The same dither of another amplitude: `factor` times this one's.
    pub fn scaled(self, factor: T) -> Self {
        self.map(|amplitude| factor * amplitude)
    }
}

/// Number of Gauss-Chebyshev nodes. They hold the mean of the Magic Formula of set A to 1e-6 of its
/// peak up to an amplitude of 0.2 rad (the paper's largest is 0.19 rad), and to 2e-5 up to 0.3 rad.
const NODES: usize = 32;

/// Mean of a function over a sine, equation (23), by Gauss-Chebyshev quadrature.
///
/// Substituting u = sin(theta) turns (23) into the integral of f(y + W u)/(pi sqrt(1 - u^2)) over
/// [-1, 1], whose Gauss nodes are cos((2 k - 1) pi/(2 n)) with equal weights: exact for polynomials
/// of degree 2 n - 1.
#[derive(Debug, Clone, Copy)]
pub struct SineMean<T> {
    nodes: [T; NODES],
}

impl<T: Real> SineMean<T> {
    /// The quadrature's nodes.
    pub fn new() -> Self {
        let node = |k: usize| {
            let angle = (2 * k + 1) as f64 * core::f64::consts::PI / (2 * NODES) as f64;
            T::from_f64(angle).cos()
        };
        Self {
            nodes: core::array::from_fn(node),
        }
    }

    /// The same quadrature in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> SineMean<U> {
        SineMean {
            nodes: self.nodes.map(f),
        }
    }

    /// Mean of `f(y + amplitude sin(theta))` over a period of theta.
    ///
    /// ```
    /// use shared_model::dither::SineMean;
    /// // The mean of the square is y^2 + W^2/2.
    /// let mean = SineMean::new().of(|u: f64| u * u, 3.0, 2.0);
    /// assert!((mean - 11.0).abs() < 1e-13);
    /// ```
    pub fn of(&self, f: impl Fn(T) -> T, y: T, amplitude: T) -> T {
        let sum = self
            .offsets(amplitude)
            .fold(T::zero(), |sum, offset| sum + f(y + offset));
        sum * T::from_f64(1.0 / NODES as f64)
    }

    /// Distances from `y` at which [`of`](Self::of) takes the function, all with the same weight.
    pub fn offsets(&self, amplitude: T) -> impl Iterator<Item = T> + '_ {
        self.nodes.iter().map(move |&node| amplitude * node)
    }
}

impl<T: Real> Default for SineMean<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Phase accumulator and waveform: one sample per PWM period.
///
/// The phase counts 2^-32 turns in an integer, so it neither drifts nor differs between machines.
/// The frequency is met to half a count, 2^-33 of the sample rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Oscillator {
    waveform: Waveform,
    phase: u32,
    increment: u32,
}

const COUNTS_PER_TURN: f64 = 4_294_967_296.0;

impl Oscillator {
    /// An oscillator of the dither's waveform and frequency, sampled at `rate_hz`, at phase zero.
    pub fn new<T: Real>(dither: &Dither<T>, rate_hz: T) -> Self {
        // In f64 whatever T is, so that every arithmetic runs through the same phases.
        let radians_per_sample = dither.frequency_rad_per_s().to_f64() / rate_hz.to_f64();
        let counts = radians_per_sample / core::f64::consts::TAU * COUNTS_PER_TURN;
        Self {
            waveform: dither.waveform,
            phase: 0,
            increment: (counts + 0.5) as u32,
        }
    }

    /// Actual angular frequency of the integer phase at `rate_hz`, rad/s.
    pub fn frequency_rad_per_s(&self, rate_hz: f64) -> f64 {
        f64::from(self.increment) / COUNTS_PER_TURN * rate_hz * core::f64::consts::TAU
    }

    /// The sample at the present phase, from -1 to 1 (0 without dither); then the phase advances.
    ///
    /// ```
    /// use shared_model::{Scenario, dither::{Oscillator, Waveform}};
    /// let mut dither = Scenario::<f64>::reconstruction().dither;
    /// dither.waveform = Waveform::Sine;
    /// // A quarter turn per sample.
    /// let rate_hz = 4000.0 / core::f64::consts::TAU * 4.0;
    /// let mut oscillator = Oscillator::new(&dither, rate_hz);
    /// let samples: [f64; 4] = core::array::from_fn(|_| oscillator.sample());
    /// for (sample, expected) in samples.iter().zip([0.0, 1.0, 0.0, -1.0]) {
    ///     assert!((sample - expected).abs() < 1e-8);
    /// }
    /// ```
    pub fn sample<T: Real>(&mut self) -> T {
        let phase = self.phase;
        self.phase = phase.wrapping_add(self.increment);
        match self.waveform {
            Waveform::None => T::zero(),
            Waveform::Square if phase < 1 << 31 => T::one(),
            Waveform::Square => -T::one(),
            Waveform::Sine => angle_rad::<T>(phase).oscillator_sin(),
        }
    }
}

/// The phase as an angle in [-pi, pi] rad: the upper half of the turn counts as negative.
fn angle_rad<T: Real>(phase: u32) -> T {
    let signed = phase as i32;
    let magnitude = T::from_u32(signed.unsigned_abs());
    let angle = magnitude * T::from_f64(core::f64::consts::PI / f64::from(1_u32 << 31));
    if signed < 0 { -angle } else { angle }
}
