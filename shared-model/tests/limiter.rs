//! The gate at the PWM rate: each sample of the dither, and the duty on the pin.

use shared_model::Scenario;
use shared_model::dither::{OSCILLATOR_SINE_ERROR, Oscillator, Waveform};
use shared_model::gate::{Fault, Faults, Limiter, Setpoint};
use std::f64::consts::PI;

const NEUTRAL_CODE: u16 = 1250;
/// PWM rates at which 5000 rad/s has two samples or more in half a period.
const RATES_HZ: [f32; 7] = [
    3200.0, 4000.0, 5000.0, 8000.0, 10_000.0, 20_000.0, 100_000.0,
];
const WAVEFORMS: [Waveform; 2] = [Waveform::Square, Waveform::Sine];

fn scenario(waveform: Waveform, pwm_rate_hz: f32, frequency_rad_per_s: f32) -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.pwm_rate_hz = pwm_rate_hz;
    scenario.dither.waveform = waveform;
    scenario.dither.square_frequency_rad_per_s = frequency_rad_per_s;
    scenario.dither.sine_frequency_rad_per_s = frequency_rad_per_s;
    scenario
}

fn limiter() -> Limiter<f32> {
    Limiter::new(&scenario(Waveform::Square, 10_000.0, 2000.0), NEUTRAL_CODE)
}

fn setpoint(dither_amplitude_v: f32) -> Setpoint<f32> {
    Setpoint {
        motor_v: 3.0,
        dither_amplitude_v,
    }
}

/// Runs a dither that sets in at sample `onset`; the sample at which a fault is found, counted from
/// there.
fn found(scenario: &Scenario<f32>, onset: u32, samples: u32) -> Option<u32> {
    let mut oscillator = Oscillator::new(&scenario.dither, scenario.run.pwm_rate_hz);
    let mut limiter = Limiter::new(scenario, NEUTRAL_CODE);
    for sample in 0..onset + samples {
        // Ramped in, as the controller does.
        let since = sample.saturating_sub(onset);
        let amplitude_v = if sample < onset {
            0.0
        } else {
            0.1 * ((1 + since) as f32 * 0.01).min(1.0)
        };
        let dither: f32 = oscillator.sample();
        limiter.run(&setpoint(amplitude_v), amplitude_v * dither);
        if !limiter.faults().is_empty() {
            assert_eq!(limiter.faults(), Fault::DitherFrequency.into());
            return Some(since);
        }
    }
    None
}

/// Frequency with `samples` samples in half a period.
fn with_half_period(pwm_rate_hz: f32, samples: f64) -> f32 {
    (PI * f64::from(pwm_rate_hz) / samples) as f32
}

fn half_period(pwm_rate_hz: f32, frequency_rad_per_s: f32) -> f64 {
    PI * f64::from(pwm_rate_hz) / f64::from(frequency_rad_per_s)
}

#[test]
fn no_allowed_frequency_raises_an_alarm() {
    let limits = Scenario::<f32>::reconstruction().gate;
    let (slowest, fastest) = (
        limits.dither_frequency_min_rad_per_s,
        limits.dither_frequency_max_rad_per_s,
    );
    for pwm_rate_hz in RATES_HZ {
        let grid = (0..=300).map(|k| slowest + (fastest - slowest) * k as f32 / 300.0);
        // Where samples fall onto the zeros of the sine, and next to it, where they drift across.
        let whole = (2..70).flat_map(|k| [-1e-4, -1e-6, 0.0, 1e-6, 1e-4].map(|d| f64::from(k) + d));
        let whole = whole.map(|samples| with_half_period(pwm_rate_hz, samples));
        let edges = [slowest.next_up(), fastest.next_down()];
        for frequency in grid.chain(whole).chain(edges) {
            if !(slowest..=fastest).contains(&frequency) {
                continue;
            }
            for waveform in WAVEFORMS {
                let scenario = scenario(waveform, pwm_rate_hz, frequency);
                let onset = (frequency as u32) % 37;
                assert_eq!(
                    found(&scenario, onset, 2000),
                    None,
                    "{waveform:?} of {frequency} rad/s at {pwm_rate_hz} Hz"
                );
            }
        }
    }
}

/// Limits that are whole half periods are the hardest to keep to.
#[test]
fn limits_of_whole_half_periods_raise_no_alarm() {
    for pwm_rate_hz in [5000.0, 10_000.0, 33_000.0] {
        for samples in [3.0, 4.0, 7.0, 8.0] {
            for waveform in WAVEFORMS {
                for frequency in [
                    with_half_period(pwm_rate_hz, samples),
                    with_half_period(pwm_rate_hz, 20.0),
                ] {
                    let mut scenario = scenario(waveform, pwm_rate_hz, frequency);
                    scenario.gate.dither_frequency_max_rad_per_s =
                        with_half_period(pwm_rate_hz, samples);
                    scenario.gate.dither_frequency_min_rad_per_s =
                        with_half_period(pwm_rate_hz, 20.0);
                    assert_eq!(found(&scenario, 5, 20_000), None);
                }
            }
        }
    }
}

#[test]
fn sr12_a_frequency_a_sample_outside_is_found_in_its_first_period() {
    let limits = Scenario::<f32>::reconstruction().gate;
    for pwm_rate_hz in RATES_HZ {
        let shortest = half_period(pwm_rate_hz, limits.dither_frequency_max_rad_per_s).floor();
        let longest = half_period(pwm_rate_hz, limits.dither_frequency_min_rad_per_s).ceil();
        for waveform in WAVEFORMS {
            for onset in 0..20 {
                for samples in [
                    shortest - 1.0,
                    0.5 * shortest,
                    longest + 1.0,
                    2.0 * longest,
                    10.0 * longest,
                ] {
                    let frequency = with_half_period(pwm_rate_hz, samples.max(1.3));
                    if samples < 1.3
                        || shortest <= 2.0 && samples < shortest && waveform == Waveform::Sine
                    {
                        // The limit itself is next to half the PWM rate: a faster sine shows its
                        // beat, see below.
                        continue;
                    }
                    let scenario = scenario(waveform, pwm_rate_hz, frequency);
                    // The half period in which it sets in, and a whole one to the sample after it.
                    let latest = 2.0 * samples.min(longest) + 3.0;
                    let found = found(&scenario, onset, 1000).unwrap();
                    assert!(
                        f64::from(found) <= latest,
                        "{samples} samples at {pwm_rate_hz} Hz: at {found}"
                    );
                }
            }
        }
    }
}

/// Between the limit and the next whole number of samples it takes until the samples have drifted
/// by one.
#[test]
fn a_frequency_barely_outside_is_found_by_its_drift() {
    for waveform in WAVEFORMS {
        // At 10 kHz the least half period is 6 samples, the longest 21.
        for (samples, latest) in [
            (5.9, 80),
            (5.5, 30),
            (5.1, 20),
            (21.1, 300),
            (21.5, 80),
            (21.9, 50),
        ] {
            let scenario = scenario(waveform, 10_000.0, with_half_period(10_000.0, samples));
            let found = found(&scenario, 3, 1000).unwrap();
            assert!(found <= latest, "{samples} samples: at {found}");
        }
        for samples in [6.05, 20.9] {
            let scenario = scenario(waveform, 10_000.0, with_half_period(10_000.0, samples));
            assert_eq!(found(&scenario, 3, 20_000), None, "finer than a sample");
        }
    }
}

/// Runs half periods of these many samples, the first one positive, at amplitude 0.1 V; the fault
/// and the sample it comes at.
fn squares(limiter: &mut Limiter<f32>, half_periods: &[u32]) -> Option<u32> {
    let signs = half_periods.iter().zip([1.0, -1.0].into_iter().cycle());
    let samples = signs.flat_map(|(&samples, sign)| std::iter::repeat_n(sign, samples as usize));
    let mut found = None;
    for (at, sign) in samples.enumerate() {
        limiter.run(&setpoint(0.1), 0.1 * sign);
        if found.is_none() && limiter.faults().contains(Fault::DitherFrequency) {
            found = Some(at as u32);
        }
    }
    found
}

#[test]
fn half_periods_are_counted() {
    // 10 kHz over 5000 rad/s is 6.28 samples, over 1500 rad/s 20.94.
    assert_eq!(squares(&mut limiter(), &[6, 6, 21, 21, 6, 21, 1]), None);
    assert_eq!(
        squares(&mut limiter(), &[1, 6, 6, 1]),
        None,
        "dither sets in anywhere"
    );
    assert_eq!(squares(&mut limiter(), &[3, 5, 6]), Some(8));
    assert_eq!(squares(&mut limiter(), &[6, 6, 5, 6]), Some(17));
    assert_eq!(squares(&mut limiter(), &[22]), Some(21));
    assert_eq!(squares(&mut limiter(), &[6, 22, 6]), Some(27));
    assert_eq!(squares(&mut limiter(), &[1, 1, 1]), Some(2));
}

#[test]
fn dither_that_was_off_begins_anew() {
    let mut limiter = limiter();
    for _ in 0..3 {
        assert_eq!(squares(&mut limiter, &[7, 7, 3]), None);
        for _ in 0..100 {
            assert_eq!(limiter.run(&setpoint(0.0), 0.0), 3.0);
        }
        assert_eq!(limiter.faults(), Faults::NONE);
    }
}

/// A dither that stays on one side, or within the error of zero, has no frequency.
#[test]
fn sr12_dither_that_does_not_swing_is_found() {
    let unsure = 0.1 * OSCILLATOR_SINE_ERROR as f32;
    for constant in [0.1, -0.1, 0.0, 0.99 * unsure, unsure, -unsure] {
        let mut limiter = limiter();
        for sample in 0..21 {
            let sign = if constant.abs() < 1e-3 && sample % 2 == 0 {
                -1.0
            } else {
                1.0
            };
            limiter.run(&setpoint(0.1), sign * constant);
        }
        assert_eq!(limiter.faults(), Faults::NONE);
        limiter.run(&setpoint(0.1), constant);
        assert_eq!(limiter.faults(), Fault::DitherFrequency.into());
    }
}

#[test]
fn sr12_a_sample_beyond_its_amplitude_does_not_go_out() {
    let error = OSCILLATOR_SINE_ERROR as f32;
    for sign in [1.0, -1.0] {
        for within in [0.0, 0.05, 0.1, 0.1 * (1.0 + 0.99 * error)] {
            let mut limiter = limiter();
            assert_eq!(
                limiter.run(&setpoint(0.1), sign * within),
                3.0 + sign * within
            );
            assert_eq!(limiter.faults(), Faults::NONE);
        }
        for beyond in [0.1 * (1.0 + 1.01 * error), 1.0, f32::INFINITY, f32::NAN] {
            let mut limiter = limiter();
            assert_eq!(limiter.run(&setpoint(0.1), sign * beyond), 3.0);
            assert_eq!(limiter.faults(), Fault::DitherAmplitude.into());
        }
        let mut without = limiter();
        assert_eq!(without.run(&setpoint(0.0), sign * 1e-30), 3.0);
        assert_eq!(without.faults(), Fault::DitherAmplitude.into());
    }
}

#[test]
fn found_is_found_until_restart() {
    let mut limiter = limiter();
    limiter.run(&setpoint(0.1), 1.0);
    for _ in 0..100 {
        limiter.run(&setpoint(0.0), 0.0);
    }
    assert_eq!(limiter.faults(), Fault::DitherAmplitude.into());
}

#[test]
fn the_pin_may_differ_once_but_not_twice() {
    let mut limiter = limiter();
    limiter.observe(NEUTRAL_CODE);
    for code in [0, 1000, 2500] {
        limiter.expect(code);
        limiter.observe(code);
        limiter.observe(code ^ 1);
        limiter.observe(code);
        limiter.observe(code ^ 0x8000);
        assert_eq!(limiter.faults(), Faults::NONE);
        limiter.observe(code);
    }
    limiter.expect(7);
    limiter.observe(2500);
    assert_eq!(limiter.faults(), Faults::NONE);
    limiter.observe(2500);
    assert_eq!(limiter.faults(), Fault::Readback.into());
}
