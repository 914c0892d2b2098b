//! Orbit diagram (bifurcation diagram): where the motion's orbit meets a section, over a parameter.

use crate::component::Component;
use crate::observe::observe;
use crate::period::{AT_REST_RAD_PER_S, maxima_of_turns};
use crate::simulate::started_at;
use crate::sweep::{Parameter, RunControl, SweepError, Timing, Values, scenarios};
use engine::taylor::{Observables, Trajectory};
use engine::{EarlyEnd, Reason};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::vehicle::{State, YAW_RATE};
use shared_model::{InvalidScenario, Scenario};

/// Where the orbit is looked at.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// At the local maxima of the yaw rate, as in the paper's diagrams; their heights are shown.
    YawRateMaxima,
    /// Where a component rises through a level; the yaw rate is shown, or the sideslip angle where
    /// the component is the yaw rate.
    Rising {
        /// The component.
        component: Component,
        /// Its level, in its unit.
        level: f64,
    },
}

impl Section {
    /// What is shown.
    pub fn shown(self) -> Component {
        match self {
            Self::Rising {
                component: Component::YAW_RATE,
                ..
            } => Component::SIDESLIP,
            _ => Component::YAW_RATE,
        }
    }

    /// The component whose maxima or crossings are looked at.
    fn component(self) -> Component {
        match self {
            Self::YawRateMaxima => Component::YAW_RATE,
            Self::Rising { component, .. } => component,
        }
    }

    /// What the engine has to look at: rest shows in the yaw rate.
    fn observables(self) -> Observables {
        let mut turns = [false; 4];
        turns[YAW_RATE] = true;
        turns[self.component().index] = true;
        let section = match self {
            Self::YawRateMaxima => None,
            Self::Rising { component, level } => Some((component.index, level)),
        };
        Observables { turns, section }
    }
}

/// From where each point's motion starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// From the scenario's start.
    Fixed,
    /// From where the next lower point ended; the lowest from the scenario's start.
    Up,
    /// From where the next higher point ended; the highest from the scenario's start.
    Down,
}

/// What an orbit shows at one value of the parameter.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// It meets the section.
    Meets {
        /// What is shown at each meeting, in order of time.
        values: Vec<f64>,
    },
    /// It moves, but does not meet the section.
    Misses,
    /// It rests.
    Rests {
        /// What is shown, at rest.
        value: f64,
    },
    /// It leaves all bounds.
    Diverges {
        /// When, s.
        time_s: f64,
    },
    /// The integrator could not follow it.
    NotFollowed(EarlyEnd),
}

/// One value of the parameter.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Point {
    /// The parameter's value.
    pub value: f64,
    /// What the orbit does.
    #[serde(flatten)]
    pub orbit: Outcome,
    /// Least and greatest value of the section's component.
    #[serde(skip)]
    pub extent: (f64, f64),
}

/// The orbit diagram. Points are in ascending order of the parameter; those not begun are left out.
///
/// From a fixed start the points are independent and made side by side; a continued diagram is made
/// in sequence, and after a motion that diverged it begins anew at the scenario's start. Memory
/// grows with the number of points shown, not with the length of the runs. Time grows with the
/// number of values times the length of a run.
///
/// # Errors
/// If a point's scenario is not valid, or the section is crossed at none of the values though the
/// motions are not at rest.
///
/// ```
/// use dynamics::orbit::{Outcome, Section, Start, diagram};
/// use dynamics::sweep::{Parameter, RunControl, Timing, Values};
///
/// let scenario = shared_model::Scenario::reconstruction();
/// let values = Values::new("wheel speed (rpm)", 1500.0, 1600.0, 100.0)?;
/// let timing = Timing::new(100.0, 150.0)?;
/// let (parameter, section) = (Parameter::Speed, Section::YawRateMaxima);
/// let points = diagram(&scenario, parameter, &values, section, timing, Start::Fixed, RunControl::none())?;
/// let Outcome::Meets { values } = &points[0].orbit else { panic!() };
/// assert!(values.iter().all(|maximum| (maximum - values[0]).abs() < 1e-4)); // period one
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn diagram(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    section: Section,
    timing: Timing,
    start: Start,
    control: RunControl,
) -> Result<Vec<Point>, SweepError> {
    let scenarios = scenarios(scenario, parameter, values)?;
    let follow = |scenarios: &[Scenario<f64>]| {
        let observables = section.observables();
        observe(
            scenarios,
            timing,
            observables,
            control,
            |scenario, found| (point(parameter.of(scenario), section, found), found.end),
        )
    };
    let mut points: Vec<Point> = match start {
        Start::Fixed => {
            let made = follow(&scenarios)?.into_iter().flatten();
            made.map(|(point, _)| point).collect()
        }
        Start::Up => continued(scenarios.iter(), follow)?,
        Start::Down => continued(scenarios.iter().rev(), follow)?,
    };
    if start == Start::Down {
        points.reverse();
    }
    check_crossed(section, &points)?;
    Ok(points)
}

fn continued<'a>(
    scenarios: impl Iterator<Item = &'a Scenario<f64>>,
    follow: impl Fn(&[Scenario<f64>]) -> Result<Vec<Option<(Point, State<f64>)>>, InvalidScenario>,
) -> Result<Vec<Point>, SweepError> {
    let mut end = None;
    let mut points = Vec::new();
    for scenario in scenarios {
        let scenario = end.map_or(*scenario, |end| started_at(scenario, &end));
        let Some((point, state)) = follow(&[scenario])?.pop().flatten() else {
            break;
        };
        let ends_early = matches!(
            point.orbit,
            Outcome::Diverges { .. } | Outcome::NotFollowed(_)
        );
        end = (!ends_early).then_some(state);
        points.push(point);
    }
    Ok(points)
}

fn check_crossed(section: Section, points: &[Point]) -> Result<(), SweepError> {
    let Section::Rising { component, level } = section else {
        return Ok(());
    };
    let missed = |p: &&Point| p.orbit == Outcome::Misses;
    let crossed = |p: &Point| matches!(p.orbit, Outcome::Meets { .. });
    if points.iter().any(crossed) || !points.iter().any(|p| missed(&p)) {
        return Ok(());
    }
    let empty = (f64::INFINITY, f64::NEG_INFINITY);
    let join = |(low, high): (f64, f64), p: &Point| (low.min(p.extent.0), high.max(p.extent.1));
    let (low, high) = points.iter().filter(missed).fold(empty, join);
    Err(SweepError::SectionNotCrossed {
        component: component.column.into(),
        level,
        low,
        high,
    })
}

/// What a motion shows.
fn point(value: f64, section: Section, found: &Trajectory<0>) -> Point {
    if let Some(end) = found.early_end {
        return Point {
            value,
            orbit: match end.reason {
                Reason::Diverges => Outcome::Diverges { time_s: end.time_s },
                _ => Outcome::NotFollowed(end),
            },
            extent: (0.0, 0.0),
        };
    }
    let range = found.upper[YAW_RATE] - found.lower[YAW_RATE];
    let shown = section.shown().index;
    let values: Vec<f64> = match section {
        Section::YawRateMaxima => maxima_of_turns(&found.turns[YAW_RATE], range)
            .into_iter()
            .map(|(_, height)| height)
            .collect(),
        Section::Rising { .. } => {
            let rising = found.crossings.iter().filter(|crossing| crossing.rising);
            rising.map(|crossing| crossing.x[shown]).collect()
        }
    };
    let orbit = if range < AT_REST_RAD_PER_S {
        Outcome::Rests {
            value: found.end.x[shown],
        }
    } else if values.is_empty() {
        Outcome::Misses
    } else {
        Outcome::Meets { values }
    };
    let component = section.component().index;
    Point {
        value,
        orbit,
        extent: (found.lower[component], found.upper[component]),
    }
}

/// The orbit diagram.
pub fn chart(points: &[Point], parameter: Parameter, section: Section, start: Start) -> Chart {
    let values = |point: &Point| -> Vec<(f64, f64)> {
        let at = |&value: &f64| (point.value, value);
        match &point.orbit {
            Outcome::Meets { values } => values.iter().map(at).collect(),
            Outcome::Rests { value } => vec![(point.value, *value)],
            Outcome::Misses | Outcome::Diverges { .. } | Outcome::NotFollowed(_) => Vec::new(),
        }
    };
    let (name, shown) = (parameter.name(), section.shown().label());
    let first = points.first().map_or(0.0, |p| p.value);
    let last = points.last().map_or(0.0, |p| p.value);
    let caption = match section {
        Section::YawRateMaxima => "local maxima of the yaw rate".into(),
        Section::Rising { component, level } => {
            format!(
                "{shown} where the {} rises through {level}",
                component.label()
            )
        }
    };
    let from = match start {
        Start::Fixed => "each from the same start",
        Start::Up => "continued upwards",
        Start::Down => "continued downwards",
    };
    let axis = AxisSpec::linear(name);
    Chart {
        heading: format!("Orbit diagram over {name}"),
        panels: vec![Panel {
            caption: format!("{caption}, {from}"),
            x: if first < last {
                axis.from_to(first, last)
            } else {
                axis
            },
            y: AxisSpec::linear(shown),
            series: vec![Series {
                label: String::new(),
                points: points.iter().flat_map(values).collect(),
                look: Look::Dots,
            }],
            ..Panel::default()
        }],
    }
}
