//! The true dither signal against the averaged system, over the dither's frequency: where averaging
//! starts to hold.

use crate::period::{Period, RIPPLE_TOLERANCE, TOLERANCE, period};
use crate::simulate::{settle, simulate, started_at};
use crate::sweep::{SweepError, side_by_side};
use crate::trace::Trace;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use serde::Serialize;
use shared_model::dither::{Application, Waveform};
use shared_model::vehicle::YAW_RATE;
use shared_model::{InvalidScenario, Scenario};

/// Transient before the dither, and with it, s.
const TRANSIENT_S: f64 = 200.0;
const DITHER_TRANSIENT_S: f64 = 20.0;
/// Length of the motion that is compared, s.
const MOTION_S: f64 = 40.0;
/// Model steps in a period of the dither, at least: the sampled sine's mean square is then that of
/// the true one.
const STEPS_A_PERIOD: f64 = 32.0;
/// Clock of a timer that any PWM rate of the sweep fits.
const TIMER_CLOCK_HZ: f64 = 1e8;

/// The true signal's motion at one frequency, beside the averaged one's.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Frequency of the dither, rad/s.
    pub frequency_rad_per_s: f64,
    /// Maxima of the yaw rate in a cycle under the true signal; none if it has no cycle.
    pub period: Option<usize>,
    /// The same in the averaged system.
    pub averaged_period: Option<usize>,
    /// Cycle time, true signal from averaged, in percent of it; none unless both have the same
    /// period.
    pub cycle_difference_percent: Option<f64>,
    /// Swing of the yaw rate (greatest less least), true signal from averaged, in percent of it.
    pub swing_difference_percent: Option<f64>,
}

/// Compares at each frequency. The scenario's own dither must have a waveform.
///
/// # Errors
/// If a scenario is not valid.
///
/// ```
/// use shared_model::dither::Waveform;
///
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.dither.waveform = Waveform::Square;
/// scenario.dither.amplitude_v = 0.1;
/// let compared = dynamics::averaging::compare(&scenario, &[2000.0])?;
/// assert_eq!((compared[0].period, compared[0].averaged_period), (Some(1), Some(1)));
/// assert!(compared[0].swing_difference_percent.unwrap().abs() < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compare(
    scenario: &Scenario<f64>,
    frequencies_rad_per_s: &[f64],
) -> Result<Vec<Comparison>, SweepError> {
    let start = settle(scenario, TRANSIENT_S)?;
    let mut base = started_at(scenario, &start);
    base.dither.start_time_s = 0.0;
    base.run.duration_s = DITHER_TRANSIENT_S + MOTION_S;
    base.servo.timer_clock_hz = TIMER_CLOCK_HZ;
    let compared = side_by_side(frequencies_rad_per_s.len(), |k| {
        compare_at(&base, frequencies_rad_per_s[k])
    });
    Ok(compared.into_iter().collect::<Result<_, _>>()?)
}

fn compare_at(
    base: &Scenario<f64>,
    frequency_rad_per_s: f64,
) -> Result<Comparison, InvalidScenario> {
    let mut scenario = *base;
    match scenario.dither.waveform {
        Waveform::Sine => scenario.dither.sine_frequency_rad_per_s = frequency_rad_per_s,
        _ => scenario.dither.square_frequency_rad_per_s = frequency_rad_per_s,
    }
    let control_hz = scenario.run.control_rate_hz;
    let wanted_hz = STEPS_A_PERIOD * frequency_rad_per_s / std::f64::consts::TAU;
    scenario.run.pwm_rate_hz = control_hz * (wanted_hz / control_hz).ceil().max(2.0);

    scenario.dither.application = Application::Averaged;
    let averaged = simulate(&scenario)?;
    scenario.dither.application = Application::Signal;
    let signal = simulate(&scenario)?;
    // Two periods of the dither: the ripple is gone, the slow motion is not touched.
    let signal = signal.smoothed(2.0 * std::f64::consts::TAU / frequency_rad_per_s);
    let from = |trace: &Trace| trace.index_after(DITHER_TRANSIENT_S);
    let averaged_period = period(&averaged, from(&averaged), TOLERANCE);
    let signal_period = period(&signal, from(&signal), RIPPLE_TOLERANCE);
    let swing = |trace: &Trace| {
        let (low, high) = trace.range(YAW_RATE, from(trace));
        high - low
    };
    let alike = averaged_period.maxima() == signal_period.maxima();
    let percent = |own: f64, other: f64| 100.0 * (own / other - 1.0);
    Ok(Comparison {
        frequency_rad_per_s,
        period: signal_period.maxima(),
        averaged_period: averaged_period.maxima(),
        cycle_difference_percent: match (signal_period, averaged_period) {
            (Period::Periodic { time_s: own, .. }, Period::Periodic { time_s: other, .. })
                if alike =>
            {
                Some(percent(own, other))
            }
            _ => None,
        },
        swing_difference_percent: alike.then(|| percent(swing(&signal), swing(&averaged))),
    })
}

/// Differences over the frequency.
pub fn chart(comparisons: &[Comparison]) -> Chart {
    let series = |label: &str, line, value: fn(&Comparison) -> Option<f64>| Series {
        label: label.into(),
        points: comparisons
            .iter()
            .filter_map(|c| Some((c.frequency_rad_per_s, value(c)?.abs())))
            .collect(),
        look: Look::Line(line),
    };
    Chart {
        heading: "Averaging: the true dither signal against the averaged system".into(),
        panels: vec![Panel {
            x: AxisSpec::logarithmic("dither frequency (rad/s)"),
            y: AxisSpec::logarithmic("difference (%)"),
            series: vec![
                series("cycle time", 0, |c| c.cycle_difference_percent),
                series("swing of the yaw rate", 1, |c| c.swing_difference_percent),
            ],
            ..Panel::default()
        }],
    }
}
