//! The regime of the settled motion, by the measures of the host's programs.

use crate::feedback;
use crate::motion::{Motion, record};
use measures::period::{RIPPLE_TOLERANCE, TOLERANCE, period, yaw_rate_maxima};
use measures::{exponent, regime};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Application;

/// Initial transient to discard, from the start of the dither on, and length of the motion
/// measured, s.
const AVERAGED_S: (f32, f32) = (100.0, 200.0);
/// The same where the model is stepped at the PWM rate.
const SIGNAL_S: (f32, f32) = (20.0, 60.0);
/// End of the motion that is drawn, s: enough for the shape of a chaotic attractor.
const DRAWN_S: f64 = 100.0;

/// The measures of a motion.
#[derive(Serialize)]
pub struct Measured {
    /// The regime in words; none if the motion leaves all bounds.
    regime: Option<String>,
    is_chaotic: bool,
    /// Whether the motion has an exponent here: under delayed feedback it is not measured.
    has_exponent: bool,
    /// The period in words.
    period: String,
    /// Largest Lyapunov exponent, 1/s.
    exponent_per_s: Option<f64>,
    /// Its standard error, 1/s.
    standard_error_per_s: Option<f64>,
    /// What it must exceed to count as positive, 1/s.
    threshold_per_s: Option<f64>,
    /// Time between two states of the end of the motion, s.
    step_s: f64,
    /// Transient and length, s.
    transient_s: f64,
    observed_s: f64,
    /// Time at which the state leaves all bounds, s.
    leaves_bounds_at_s: Option<f64>,
}

/// Measures the motion of a scenario after its transient, and returns the end of that motion.
///
/// # Errors
/// If the page has no room for a motion of that length.
pub fn measure(scenario: &Scenario<f32>) -> Result<(Measured, Motion), String> {
    let ((transient_s, observed_s), tolerance) = match scenario.dither.application {
        // The steps of the PWM move the maxima a little.
        _ if feedback::is_chosen(scenario) => (AVERAGED_S, RIPPLE_TOLERANCE),
        Application::Averaged => (AVERAGED_S, TOLERANCE),
        Application::Signal => (SIGNAL_S, RIPPLE_TOLERANCE),
    };
    let transient_s = scenario.dither.start_time_s + transient_s;
    let mut longer = *scenario;
    longer.run.duration_s = transient_s + observed_s;
    let mut trace = record(&longer)?;
    // They are not drawn.
    trace.duties = Vec::new();
    let leaves_bounds_at_s = trace.leaves_bounds_at_s();
    let from = trace.index_after(transient_s.into());
    let (period, exponent, kind) = if leaves_bounds_at_s.is_some() {
        (String::new(), None, None)
    } else {
        let period = period(&trace, from, tolerance);
        // The linearised step has no delay.
        let has_exponent = !feedback::is_chosen(scenario);
        let exponent = || exponent::largest(&longer.map(&f64::from), &trace, from);
        let exponent = has_exponent.then(exponent).flatten();
        let maxima = yaw_rate_maxima(&trace, from);
        let kind = regime::kind(period, exponent, has_exponent, &maxima);
        (period.to_string(), exponent, Some(kind))
    };
    let measured = Measured {
        regime: kind.map(|kind| kind.to_string()),
        has_exponent: !feedback::is_chosen(scenario),
        is_chaotic: kind.is_some_and(|kind| kind.is_chaotic()),
        period,
        exponent_per_s: exponent.map(|exponent| exponent.per_s),
        standard_error_per_s: exponent.map(|exponent| exponent.standard_error_per_s),
        threshold_per_s: exponent.map(|exponent| exponent.threshold_per_s()),
        step_s: trace.step_s,
        transient_s: transient_s.into(),
        observed_s: observed_s.into(),
        leaves_bounds_at_s,
    };
    let drawn = (DRAWN_S / trace.step_s) as usize;
    let first = from.max(trace.states.len().saturating_sub(drawn));
    Ok((measured, Motion::of(&longer, trace, first)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::scenario;

    /// The regimes of the paper, with the exponents of `sim-host lyapunov`.
    #[test]
    fn regimes_are_those_of_the_paper() {
        for (settings, regime) in [
            ("", "chaos"),
            ("run.wheel_speed_rpm=1600", "period-2"),
            ("dither.waveform=square&dither.amplitude_v=0.1", "period-1"),
            ("dither.waveform=sine&dither.amplitude_v=1", "period-1"),
            (
                "dither.waveform=square&dither.amplitude_v=0.14",
                "equilibrium",
            ),
        ] {
            let (measured, _) = measure(&scenario(settings).unwrap()).unwrap();
            assert_eq!(measured.regime.as_deref(), Some(regime), "{settings}");
            let exponent = measured.exponent_per_s;
            assert_eq!(measured.is_chaotic, exponent.is_some_and(|e| e > 0.2));
        }
    }

    /// Without any of its transient.
    #[test]
    fn the_end_of_a_true_signals_motion_is_settled() {
        let settings = "dither.waveform=sine&dither.amplitude_v=1&dither.application=signal";
        let (measured, end) = measure(&scenario(settings).unwrap()).unwrap();
        assert_eq!(measured.regime.as_deref(), Some("period-1"));
        assert_eq!(end.states.len(), 600_000);
        let greatest = end.states.iter().map(|state| state[1]).fold(0.0, f32::max);
        assert!(greatest < 0.9, "{greatest} rad/s: without dither it is 1.8");
    }

    /// The usual sign of a vehicle's tyre force, which the paper does not have.
    #[test]
    fn a_motion_without_bounds_has_no_regime() {
        let settings = "tires.front.peak_n=-2574.7&tires.rear.peak_n=-1749.7";
        let (measured, _) = measure(&scenario(settings).unwrap()).unwrap();
        assert_eq!((measured.regime, measured.exponent_per_s), (None, None));
        assert!(
            measured
                .leaves_bounds_at_s
                .is_some_and(|time_s| time_s < 2.0)
        );
    }
}
