//! The methods for Lyapunov exponents by their names, and what each finds of a vehicle's motion.

use crate::flow::{Unmeasured, VehicleFlow, settle};
use crate::lyapunov::{Exponent, Segments};
use crate::observe::observe;
use crate::sweep::{RunControl, Timing};
use crate::synchronisation::{self, NoThreshold, Search};
use crate::two_particle;
use engine::taylor::{Compiled, Observables, Tangents};
use engine::{EarlyEnd, Reason};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::{InvalidScenario, Scenario};

/// How an exponent is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The largest one by tangent dynamics: the engine with one tangent vector.
    Tangent,
    /// All four by tangent dynamics: the engine with four tangent vectors.
    Spectrum,
    /// The largest one by two neighbouring motions: [`two_particle::largest`].
    Twin,
    /// The largest one by synchronisation: [`synchronisation::largest`].
    Synchronisation,
    /// The threshold of equation (20) as printed, which is a conditional exponent:
    /// [`synchronisation::literal`].
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

    /// What a motion costs by the method, in seconds of motion at the ECU's fixed step; rounded
    /// measurements.
    pub fn cost_s(self, timing: Timing, search: Search) -> f64 {
        let (transient, observed) = match self {
            Self::Tangent => (0.012, 0.026),
            Self::Spectrum => (0.012, 0.057),
            Self::Twin => (1.0, 2.0),
            Self::Synchronisation | Self::PrintedResponse => {
                (1.0, 1.0 + f64::from(search.couplings_tried()))
            }
        };
        transient * timing.transient_s + observed * timing.observed_s
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

/// The exponents of each scenario's motion behind its transient: one estimate, or four of the
/// spectrum. Results are in the scenarios' order; motions that were not begun have none.
///
/// A motion that diverges, or a search that finds nothing, is an estimate that says so.
///
/// # Errors
/// If a scenario is not valid.
pub fn estimates(
    scenarios: &[Scenario<f64>],
    method: Method,
    timing: Timing,
    search: Search,
    control: RunControl,
) -> Result<Vec<Option<Vec<Estimate>>>, InvalidScenario> {
    match method {
        Method::Tangent => by_engine::<1>(scenarios, method, timing, control),
        Method::Spectrum => by_engine::<4>(scenarios, method, timing, control),
        Method::Twin | Method::Synchronisation | Method::PrintedResponse => {
            let one = |scenario: &Scenario<f64>| {
                let flow = VehicleFlow::new(scenario)?;
                let largest = by_flow(&flow, method, timing, search).map(|largest| vec![largest]);
                let tolerance_per_s = method.searches().then_some(search.tolerance_per_s);
                Ok(in_words(scenario, method, tolerance_per_s, largest))
            };
            let made = control.points(scenarios, one);
            made.into_iter().map(Option::transpose).collect()
        }
    }
}

/// By the engine's tangent vectors.
fn by_engine<const K: usize>(
    scenarios: &[Scenario<f64>],
    method: Method,
    timing: Timing,
    control: RunControl,
) -> Result<Vec<Option<Vec<Estimate>>>, InvalidScenario>
where
    Tangents<K>: Compiled<K>,
{
    let observables = Observables::default();
    observe(
        scenarios,
        timing,
        observables,
        control,
        |scenario, found| {
            let segments = Segments::<K>::of(found, timing.observed_s);
            let exponents = match found.early_end {
                Some(end) => Err(Unmeasured::from(end).into()),
                None => Ok(segments.spectrum().to_vec()),
            };
            in_words(scenario, method, None, exponents)
        },
    )
}

/// The largest exponent by a method that steps a flow; `None` is minus infinity.
fn by_flow(
    flow: &VehicleFlow,
    method: Method,
    timing: Timing,
    search: Search,
) -> Result<Option<Exponent>, NoThreshold> {
    let x = settle(flow, &flow.start(), timing.transient_s)?;
    let time_s = timing.observed_s;
    Ok(match method {
        Method::Twin => two_particle::largest(flow, &x, time_s)?,
        Method::PrintedResponse => {
            Some(synchronisation::literal(flow, &x, time_s, search)?.exponent)
        }
        _ => Some(synchronisation::largest(flow, &x, time_s, search)?.exponent),
    })
}

/// Estimates of exponents in descending order, of which `None` is minus infinity.
fn in_words(
    scenario: &Scenario<f64>,
    method: Method,
    tolerance_per_s: Option<f64>,
    exponents: Result<Vec<Option<Exponent>>, NoThreshold>,
) -> Vec<Estimate> {
    let without = |index, finding| Estimate::without(scenario, method, index, finding);
    match exponents {
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
                NoThreshold::Unmeasured(Unmeasured::EndsEarly(EarlyEnd {
                    reason: Reason::Diverges,
                    ..
                })) => Finding::Diverges,
                _ => Finding::Untested,
            };
            vec![Estimate {
                reason: Some(error.to_string()),
                ..without(1, finding)
            }]
        }
    }
}

/// A panel for each method, for the spectrum one for each pair of exponents.
pub fn chart(estimates: &[Estimate], methods: &[Method], timing: Timing) -> Chart {
    let panel = |caption: &str, method: Method, first: usize, labels: &[&str]| Panel {
        caption: caption.into(),
        x: AxisSpec::linear("wheel speed (rpm)"),
        y: AxisSpec::linear("exponent (1/s)"),
        series: labels
            .iter()
            .enumerate()
            .flat_map(|(line, label)| {
                let chosen = move |e: &&Estimate| e.method == method && e.index == first + line;
                series(label, estimates.iter().filter(chosen), line)
            })
            .collect(),
        levels: if first == 1 { vec![0.0] } else { vec![] },
        ..Panel::default()
    };
    const PAIR: [&str; 2] = ["first or third exponent", "second or fourth"];
    let panels = methods.iter().flat_map(|&method| match method {
        Method::Spectrum => vec![
            panel("spectrum: first and second", method, 1, &PAIR),
            panel(
                "spectrum: third and fourth (none where stick takes a dimension away)",
                method,
                3,
                &PAIR,
            ),
        ],
        _ => vec![panel(method.name(), method, 1, &[""])],
    });
    Chart {
        heading: format!(
            "Lyapunov exponents over {} s, with one standard error",
            timing.observed_s
        ),
        panels: panels.collect(),
    }
}

/// The exponents as a line, and their standard errors as bars.
fn series<'a>(
    label: &str,
    estimates: impl Iterator<Item = &'a Estimate> + Clone,
    line: usize,
) -> [Series; 2] {
    const GAP: (f64, f64) = (f64::NAN, f64::NAN);
    let point = |e: &Estimate| {
        e.exponent_per_s
            .map_or(GAP, |exponent| (e.wheel_speed_rpm, exponent))
    };
    let bar = |e: &Estimate| {
        let (rpm, exponent) = point(e);
        let error = e.error_per_s().unwrap_or(f64::NAN);
        [(rpm, exponent - error), (rpm, exponent + error), GAP]
    };
    [
        Series {
            label: label.into(),
            points: estimates.clone().map(point).collect(),
            look: Look::Line(line),
        },
        Series {
            label: String::new(),
            points: estimates.flat_map(bar).collect(),
            look: Look::Line(line),
        },
    ]
}
