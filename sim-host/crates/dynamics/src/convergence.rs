//! The ECU's fixed step against the reference integrator, over the length of the step.

use crate::sweep::SweepError;
use engine::Stepper;
use engine::reference::Reference;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use serde::Serialize;
use shared_model::Scenario;

/// Tolerance of the reference: far below the least error of the fixed step.
const REFERENCE_TOLERANCE: f64 = 1e-14;
/// A PWM rate that is a multiple of all the steps' rates. The averaged motion does not depend on
/// it.
const PWM_RATE_HZ: f64 = 16_000.0;

/// Error of the fixed step at one length.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Error {
    /// Length of the step, s.
    pub step_s: f64,
    /// Greatest difference of a component from the reference at the end, rad or rad/s.
    pub error: f64,
    /// Order observed from the row before; none in the first.
    pub order: Option<f64>,
}

/// Errors after `time_s` of the scenario's motion with steps of 4 ms and six halvings of it.
///
/// With friction events single orders scatter, because an event lies elsewhere in its step each
/// time; the trend is second order.
///
/// # Errors
/// If the scenario is not valid at one of the steps, or the motion leaves all bounds.
///
/// ```
/// let errors = dynamics::convergence::errors(&shared_model::Scenario::reconstruction(), 1.0)?;
/// assert_eq!(errors.len(), 7);
/// assert!(errors[6].error < errors[0].error);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn errors(scenario: &Scenario<f64>, time_s: f64) -> Result<Vec<Error>, SweepError> {
    let end = *Reference::new(scenario, REFERENCE_TOLERANCE)?.run(time_s)?;
    let mut errors: Vec<Error> = Vec::new();
    for halvings in 0..=6 {
        let mut scenario = *scenario;
        scenario.run.control_rate_hz = 250.0 * f64::from(1 << halvings);
        scenario.run.pwm_rate_hz = PWM_RATE_HZ;
        let mut motion = Stepper::new(&scenario)?;
        let error = (motion.run(time_s).x - end.x).amax();
        errors.push(Error {
            step_s: 1.0 / scenario.run.control_rate_hz,
            error,
            order: errors.last().map(|coarser| (coarser.error / error).log2()),
        });
    }
    Ok(errors)
}

/// Errors after `time_s` over the length of the step.
pub fn chart(errors: &[Error], time_s: f64) -> Chart {
    let points = errors.iter().map(|error| (error.step_s, error.error));
    Chart {
        heading: "Fixed step against the reference integrator".into(),
        panels: vec![Panel {
            caption: format!("greatest error of a component after {time_s} s"),
            x: AxisSpec::logarithmic("step (s)"),
            y: AxisSpec::logarithmic("error (rad, rad/s)"),
            series: vec![Series {
                label: "fixed step".into(),
                points: points.collect(),
                look: Look::Line(0),
            }],
            ..Panel::default()
        }],
    }
}
