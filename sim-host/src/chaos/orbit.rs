//! Orbit diagram (bifurcation diagram): where the motion's orbit meets a section, over a parameter.

use crate::chaos::extrema::Extrema;
use crate::chaos::period::AT_REST_RAD_PER_S;
use crate::chaos::sweep::{Parameter, SweepError, Timing, Values, Watch, scenarios};
use crate::component::Component;
use crate::motion::Motion;
use shared_model::Scenario;
use shared_model::vehicle::{State, YAW_RATE};

/// Where the orbit is looked at.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// At the local maxima of the yaw rate, as in the paper's diagrams; their heights are shown.
    YawRateMaxima,
    /// Where a component rises through a level; the yaw rate is shown, or the sideslip angle where the component is the yaw
    /// rate. The crossing is interpolated linearly over the step, an error of second order.
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
/// From a fixed start the points are independent and made side by side; a continued diagram is made in sequence, and behind
/// a motion that diverged it begins anew at the scenario's start. Memory grows with the number of points shown, not with
/// the length of the runs. Time grows with the number of values times the length of a run.
///
/// # Errors
/// If a point's scenario is not valid, or the section is crossed at none of the values though the motions are not at rest.
pub fn diagram(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    section: Section,
    timing: Timing,
    start: Start,
    watch: Watch,
) -> Result<Vec<Point>, SweepError> {
    let scenarios = scenarios(scenario, parameter, values)?;
    let make = |scenario: &Scenario<f64>, from| {
        let (orbit, extent, end) = orbit(scenario, section, timing, from)?;
        let value = parameter.of(scenario);
        let point = Point {
            value,
            orbit,
            extent,
        };
        Ok((point, end))
    };
    let mut points = match start {
        Start::Fixed => watch
            .points(&scenarios, |scenario| Ok(make(scenario, None)?.0))
            .into_iter()
            .flatten()
            .collect::<Result<Vec<_>, SweepError>>()?,
        Start::Up => continued(scenarios.iter(), make, watch)?,
        Start::Down => continued(scenarios.iter().rev(), make, watch)?,
    };
    if start == Start::Down {
        points.reverse();
    }
    check_crossed(section, &points)?;
    Ok(points)
}

fn continued<'a>(
    scenarios: impl Iterator<Item = &'a Scenario<f64>>,
    make: impl Fn(&Scenario<f64>, Option<State<f64>>) -> Result<(Point, Option<State<f64>>), SweepError>,
    watch: Watch,
) -> Result<Vec<Point>, SweepError> {
    let mut end = None;
    let mut points = Vec::new();
    for scenario in scenarios {
        let Some(made) = watch.point(|| make(scenario, end)) else {
            break;
        };
        let (point, next) = made?;
        end = next;
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

/// One point: what it shows, the extent of the section's component, and where it ends unless it diverges.
type Made = (Outcome, (f64, f64), Option<State<f64>>);

fn orbit(
    scenario: &Scenario<f64>,
    section: Section,
    timing: Timing,
    from: Option<State<f64>>,
) -> Result<Made, SweepError> {
    let mut motion = Motion::new(scenario)?;
    if let Some(from) = from {
        motion.set_state(from);
    }
    let diverges = |time_s| (Outcome::Diverges { time_s }, (0.0, 0.0), None);
    if let Err(diverged) = motion.observe(timing.transient_s, |_, _| {}) {
        return Ok(diverges(diverged.time_s));
    }
    let component = match section {
        Section::YawRateMaxima => Component::YAW_RATE,
        Section::Rising { component, .. } => component,
    };
    let step_s = motion.step_s();
    let shown = section.shown().index;
    let mut extrema = Extrema::default();
    let mut values = Vec::new();
    let mut previous = motion.state().x;
    let mut extent = (f64::INFINITY, f64::NEG_INFINITY);
    let seen = motion.observe(timing.observed_s, |time_s, state| {
        let now = state.x[component.index];
        extent = (extent.0.min(now), extent.1.max(now));
        extrema.push(time_s, step_s, state.x[YAW_RATE]);
        if let Section::Rising { level, .. } = section {
            let before = previous[component.index];
            if before < level && now >= level {
                let share = (level - before) / (now - before);
                values.push(previous[shown] + share * (state.x[shown] - previous[shown]));
            }
            previous = state.x;
        }
    });
    if let Err(diverged) = seen {
        return Ok(diverges(timing.transient_s + diverged.time_s));
    }
    if section == Section::YawRateMaxima {
        values = extrema.maxima().into_iter().map(|(_, h)| h).collect();
    }
    let end = *motion.state();
    let outcome = if extrema.range() < AT_REST_RAD_PER_S {
        Outcome::Rests {
            value: end.x[shown],
        }
    } else if values.is_empty() {
        Outcome::Misses
    } else {
        Outcome::Meets { values }
    };
    Ok((outcome, extent, Some(end)))
}
