//! Dither: the oscillator's frequency, phase and samples, and the quadrature of the mean over a
//! sine.

use proptest::prelude::*;
use shared_model::dither::{Dither, OSCILLATOR_SINE_ERROR, Oscillator, SineMean, Waveform};
use shared_model::tire::LOW_FRICTION_ROAD;
use shared_model::{Real, Scenario};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const TURN: f64 = 4_294_967_296.0; // counts of the phase

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// A dither whose oscillator moves on by `counts` of the phase at each sample, at a rate of 1 Hz.
fn dither<T: Real>(waveform: Waveform, counts: f64) -> Dither<T> {
    let mut dither = Scenario::<f64>::reconstruction().dither;
    dither.waveform = waveform;
    dither.square_frequency_rad_per_s = counts / TURN * TAU;
    dither.sine_frequency_rad_per_s = counts / TURN * TAU;
    dither.map(&T::from_f64)
}

proptest! {
    #![proptest_config(cases(256))]

    /// Half a count of the phase is 2^-33 of the sample rate.
    #[test]
    fn frequency_is_met_to_half_a_count(rate_hz in 1e3..1e6_f64, share in 1e-4..0.5_f64) {
        let mut dither = Scenario::<f64>::reconstruction().dither;
        dither.waveform = Waveform::Sine;
        dither.sine_frequency_rad_per_s = share * rate_hz * TAU;
        let met = Oscillator::new(&dither, rate_hz).frequency_rad_per_s(rate_hz);
        let half_count = 0.5 / TURN * rate_hz * TAU;
        let error = (met - dither.sine_frequency_rad_per_s).abs();
        // Beside half a count, the rounding of the frequency itself.
        prop_assert!(error <= half_count + 1e-15 * met, "{error} over {half_count} rad/s");
    }

    /// The phase runs on over many turns without a jump and without drift: sample k is the sine of k increments,
    /// which whole numbers give exactly.
    #[test]
    fn phase_is_continuous(increment in 1..u32::MAX / 2) {
        let mut oscillator = Oscillator::new(&dither::<f64>(Waveform::Sine, increment.into()), 1.0);
        for k in 0..5000_u32 {
            let phase = f64::from(k.wrapping_mul(increment)) / TURN * TAU;
            let sample: f64 = oscillator.sample();
            prop_assert!((sample - libm::sin(phase)).abs() < 1e-14, "sample {k} = {sample}");
        }
    }

    /// Both arithmetics run through the same phases: the square waves are equal, the sines differ by the sine's error.
    #[test]
    fn arithmetics_share_the_phase(frequency_rad_per_s in 1.0..31_000.0_f32) {
        let pair = |waveform| {
            let mut dither = Scenario::<f32>::reconstruction().dither;
            dither.waveform = waveform;
            dither.square_frequency_rad_per_s = frequency_rad_per_s;
            dither.sine_frequency_rad_per_s = frequency_rad_per_s;
            (Oscillator::new(&dither, 10e3_f32), Oscillator::new(&dither.map(&f64::from), 10e3_f64))
        };
        let (mut square32, mut square64) = pair(Waveform::Square);
        let (mut sine32, mut sine64) = pair(Waveform::Sine);
        prop_assert_eq!(square32, square64);
        for _ in 0..1000 {
            prop_assert_eq!(f64::from(square32.sample::<f32>()), square64.sample::<f64>());
            let (low, high): (f32, f64) = (sine32.sample(), sine64.sample());
            prop_assert!((f64::from(low) - high).abs() <= OSCILLATOR_SINE_ERROR);
        }
    }

    /// Over a whole number of turns the square wave's halves are equal, else the dither would push to one side. With
    /// 2^bits samples in `odd` turns the phases are the multiples of 2^-bits turns, each once.
    #[test]
    fn square_halves_are_equal(bits in 1..12_u32, odd in 0..500_u32) {
        let samples = 1_u32 << bits;
        let turns = (2 * odd + 1) % samples;
        let increment = f64::from(turns) * TURN / f64::from(samples);
        let mut oscillator = Oscillator::new(&dither::<f64>(Waveform::Square, increment), 1.0);
        let values: Vec<f64> = (0..samples).map(|_| oscillator.sample()).collect();
        prop_assert!(values.iter().all(|value| value.abs() == 1.0), "only the two levels");
        prop_assert_eq!(values.iter().sum::<f64>(), 0.0);
        prop_assert_eq!(values[0], 1.0, "starts with the positive half");
    }
}

#[test]
fn no_dither_is_silent() {
    let mut oscillator = Oscillator::new(&dither::<f32>(Waveform::None, 1e9), 1.0);
    assert!((0..100).all(|_| oscillator.sample::<f32>() == 0.0));
}

/// Greatest error of the ECU's sine over a grid of phases with the quadrants' edges on it.
#[test]
fn oscillator_sine_error_is_as_stated() {
    const SAMPLES: u32 = 1 << 20;
    let step = TURN / f64::from(SAMPLES);
    let mut oscillator = Oscillator::new(&dither::<f32>(Waveform::Sine, step), 1.0);
    let mut worst: f64 = 0.0;
    for k in 0..SAMPLES {
        let exact = libm::sin(f64::from(k) / f64::from(SAMPLES) * TAU);
        worst = worst.max((f64::from(oscillator.sample::<f32>()) - exact).abs());
    }
    // Both ways: a bound far above the true value would be worthless.
    assert!(worst <= OSCILLATOR_SINE_ERROR, "error {worst}");
    assert!(
        worst > 0.8 * OSCILLATOR_SINE_ERROR,
        "the stated bound is loose: {worst}"
    );
}

/// The approximation joins pieces at the quadrants' edges: the floats next to them have no wild
/// values.
#[test]
fn oscillator_sine_at_the_edges() {
    for edge in [-PI, -FRAC_PI_2, 0.0, FRAC_PI_2, PI] {
        let centre = edge as f32;
        let around = [centre.next_down(), centre, centre.next_up()];
        for angle in around {
            let error = f64::from(Real::oscillator_sin(angle)) - libm::sin(angle.into());
            // The approximation is exact at the edges up to rounding.
            assert!(error.abs() < 1e-6, "sin({angle}) is off by {error}");
        }
    }
}

/// The mean of a polynomial of degree 31 is exact with 16 nodes: for u^30 it is the central
/// binomial over 2^30.
#[test]
fn quadrature_is_exact_for_polynomials() {
    let mean = SineMean::<f64>::new();
    for power in 1..=31_i32 {
        let exact = if power % 2 == 1 {
            0.0
        } else {
            (1..=power / 2).fold(1.0, |product, k| {
                product * f64::from(2 * k - 1) / f64::from(2 * k)
            })
        };
        let value = mean.of(
            |u: f64| (0..power).fold(1.0, |product, _| product * u),
            0.0,
            1.0,
        );
        assert!(
            (value - exact).abs() < 1e-15,
            "mean of u^{power} is {value}, not {exact}"
        );
    }
}

/// Mean of `f` over a sine by brute force: the trapezoidal rule over a period, which converges as
/// fast as the function is smooth.
fn sine_mean(f: impl Fn(f64) -> f64, y: f64, amplitude: f64) -> f64 {
    const POINTS: u32 = 4096;
    let at = |k: u32| f(y + amplitude * libm::sin((f64::from(k) + 0.5) / f64::from(POINTS) * TAU));
    (0..POINTS).map(at).sum::<f64>() / f64::from(POINTS)
}

/// Largest error of the mean of set A's Magic Formulas, in units of the peak force, by dither
/// amplitude. The formula has poles beside the real axis, the rear tyre's the nearer ones, so the
/// error grows fast with the amplitude.
#[test]
fn quadrature_of_the_magic_formula() {
    for (amplitude_rad, bound) in [(0.05, 2e-14), (0.1, 1e-11), (0.2, 1e-6), (0.3, 2e-5)] {
        for tire in [LOW_FRICTION_ROAD.0, LOW_FRICTION_ROAD.1] {
            let force = |alpha| tire.force(alpha) / tire.peak_n;
            for y in (0..=200).map(|k| f64::from(k) * 0.005) {
                let value = SineMean::new().of(force, y, amplitude_rad);
                let error = (value - sine_mean(force, y, amplitude_rad)).abs();
                assert!(
                    error <= bound,
                    "off by {error} at {y} rad, amplitude {amplitude_rad} rad"
                );
            }
        }
    }
}
