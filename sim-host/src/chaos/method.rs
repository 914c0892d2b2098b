//! The methods for Lyapunov exponents by their names, and what each finds of a vehicle's motion.

use crate::chaos::flow::{Unmeasured, VehicleFlow, settle};
use crate::chaos::lyapunov::{Exponent, exponents};
use crate::chaos::sweep::Timing;
use crate::chaos::synchronisation::{self, NoThreshold, Search};
use crate::chaos::twin;
use shared_model::{InvalidScenario, Scenario};

/// How an exponent is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The largest one by tangent dynamics: [`exponents`] with one vector.
    Tangent,
    /// All four by tangent dynamics: [`exponents`] with four vectors.
    Spectrum,
    /// The largest one by two neighbouring motions: [`twin::largest`].
    Twin,
    /// The largest one by synchronisation: [`synchronisation::largest`].
    Synchronisation,
    /// The threshold of equation (20) as printed, which is a conditional exponent: [`synchronisation::literal`].
    PrintedResponse,
}

impl Method {
    /// Name, as messages and figures show it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tangent => "tangent",
            Self::Spectrum => "spectrum",
            Self::Twin => "twin",
            Self::Synchronisation => "synchronisation",
            Self::PrintedResponse => "printed response (20)",
        }
    }

    /// Whether a coupling is searched for.
    fn searches(self) -> bool {
        matches!(self, Self::Synchronisation | Self::PrintedResponse)
    }

    /// What the method costs, in steps of the model for each step of the motion; rounded measurements.
    pub fn steps_per_step(self, search: Search) -> f64 {
        match self {
            Self::Tangent | Self::Twin => 2.0,
            Self::Spectrum => 3.0,
            Self::Synchronisation | Self::PrintedResponse => {
                1.0 + f64::from(search.couplings_tried())
            }
        }
    }
}

/// What an exponent is found to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// Above what errors and length allow zero to show.
    Positive,
    /// Not to be told from zero.
    Zero,
    /// Below.
    Negative,
    /// A direction vanishes: stick takes one dimension away.
    MinusInfinity,
    /// The motion diverges and has no exponents.
    Diverges,
    /// The method gave no answer.
    Untested,
}

impl Finding {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Positive => "positive",
            Self::Zero => "zero",
            Self::Negative => "negative",
            Self::MinusInfinity => "minus infinity",
            Self::Diverges => "diverges",
            Self::Untested => "untested",
        }
    }
}

/// One exponent of one motion by one method. What is not known is absent, never NaN.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Wheel speed, rpm.
    pub wheel_speed_rpm: f64,
    /// How it was measured.
    pub method: Method,
    /// 1 for the largest exponent, 4 for the least.
    pub index: usize,
    /// What it is found to be.
    pub finding: Finding,
    /// The exponent, 1/s.
    pub exponent_per_s: Option<f64>,
    /// Its standard error, 1/s.
    pub standard_error_per_s: Option<f64>,
    /// The least rate that the length can tell from zero, 1/s.
    pub resolution_per_s: Option<f64>,
    /// Width of the interval that a search ended with, 1/s; absent where nothing is searched for.
    pub tolerance_per_s: Option<f64>,
    /// Length of the motion that it is taken over, s.
    pub counted_s: Option<f64>,
    /// Why there is no exponent.
    pub reason: Option<String>,
}

impl Estimate {
    fn without(scenario: &Scenario<f64>, method: Method, index: usize, finding: Finding) -> Self {
        Self {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            method,
            index,
            finding,
            exponent_per_s: None,
            standard_error_per_s: None,
            resolution_per_s: None,
            tolerance_per_s: None,
            counted_s: None,
            reason: None,
        }
    }

    fn with(mut self, exponent: &Exponent, tolerance_per_s: Option<f64>) -> Self {
        let threshold = exponent
            .threshold_per_s()
            .max(tolerance_per_s.unwrap_or(0.0));
        self.finding = if exponent.per_s > threshold {
            Finding::Positive
        } else if exponent.per_s < -threshold {
            Finding::Negative
        } else {
            Finding::Zero
        };
        self.exponent_per_s = Some(exponent.per_s);
        self.standard_error_per_s = Some(exponent.standard_error_per_s);
        self.resolution_per_s = Some(exponent.resolution_per_s);
        self.tolerance_per_s = tolerance_per_s;
        self.counted_s = Some(exponent.duration_s);
        self
    }

    /// Standard error and tolerance together, 1/s.
    pub fn error_per_s(&self) -> Option<f64> {
        let error = self.standard_error_per_s?;
        Some(error.hypot(self.tolerance_per_s.unwrap_or(0.0)))
    }
}

/// The exponents of the scenario's motion behind its transient: one estimate, or four of the spectrum.
///
/// A motion that diverges, or a search that finds nothing, is an estimate that says so.
///
/// # Errors
/// If the scenario is not valid.
pub fn estimate(
    scenario: &Scenario<f64>,
    method: Method,
    timing: Timing,
    search: Search,
) -> Result<Vec<Estimate>, InvalidScenario> {
    let flow = VehicleFlow::new(scenario)?;
    let without = |index, finding| Estimate::without(scenario, method, index, finding);
    let tolerance_per_s = method.searches().then_some(search.tolerance_per_s);
    Ok(match measure(&flow, method, timing, search) {
        Ok(exponents) => {
            let one = |(exponent, index): (Option<Exponent>, usize)| {
                let estimate = without(index, Finding::MinusInfinity);
                match exponent {
                    Some(exponent) => estimate.with(&exponent, tolerance_per_s),
                    None => estimate,
                }
            };
            exponents.into_iter().zip(1..).map(one).collect()
        }
        Err(error) => {
            let finding = match error {
                NoThreshold::Unmeasured(Unmeasured::Diverges { .. }) => Finding::Diverges,
                _ => Finding::Untested,
            };
            vec![Estimate {
                reason: Some(error.to_string()),
                ..without(1, finding)
            }]
        }
    })
}

/// The exponents in descending order; `None` is minus infinity.
fn measure(
    flow: &VehicleFlow,
    method: Method,
    timing: Timing,
    search: Search,
) -> Result<Vec<Option<Exponent>>, NoThreshold> {
    let x = settle(flow, &flow.start(), timing.transient_s)?;
    let time_s = timing.observed_s;
    let exponents = match method {
        Method::Tangent => exponents::<4, 1>(flow, &x, time_s).map(|all| all.to_vec())?,
        Method::Spectrum => exponents::<4, 4>(flow, &x, time_s).map(|all| all.to_vec())?,
        Method::Twin => vec![twin::largest(flow, &x, time_s)?],
        Method::Synchronisation => {
            let threshold = synchronisation::largest(flow, &x, time_s, search)?;
            vec![Some(threshold.exponent)]
        }
        Method::PrintedResponse => {
            let threshold = synchronisation::literal(flow, &x, time_s, search)?;
            vec![Some(threshold.exponent)]
        }
    };
    Ok(exponents)
}
