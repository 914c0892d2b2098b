//! Regions of a parameter in which the motion is of one kind, and their edges.

use crate::attractor::{Attractor, Kind, attractors};
use crate::equilibria;
use crate::observe::is_supported;
use crate::settled::end_of_orbit;
use crate::simulate::started_at;
use crate::sweep::{Parameter, RunControl, SweepError, Timing, Values, scenarios, side_by_side};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::Scenario;
use shared_model::vehicle::Model;

/// Further transients of a trajectory that is undecided, in lengths of a run.
const LONGER: [f64; 1] = [10.0];
/// The longest of them, s.
const LONGEST_S: f64 = 10_000.0;
/// How far beyond an edge its bifurcation is searched for, in widths of its interval.
const BEYOND: f64 = 20.0;

/// The motion at one value of the parameter.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Sample {
    /// The parameter's value.
    pub value: f64,
    /// What the motion ends on.
    pub attractor: Attractor,
}

/// A bifurcation at an edge, by continuation of the orbit on one side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct EdgeBifurcation {
    /// Its kind.
    pub kind: &'static str,
    /// The parameter's value.
    pub value: f64,
    /// Its error.
    pub error: f64,
}

/// A change of kind, located to an interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Edge {
    /// The lower end of the interval, where the motion is of the kind `below`.
    pub lower: f64,
    /// Its upper end, where it is of the kind `above`.
    pub upper: f64,
    /// Kind at the lower end.
    pub below: Kind,
    /// Kind at the upper end.
    pub above: Kind,
    /// The bifurcation at which the orbit of one side ends or loses its stability. It may be outside the
    /// interval: where attractors coexist, the trajectory may leave an orbit before that.
    pub bifurcation: Option<EdgeBifurcation>,
    /// Orbits of as many cycles on both sides: one of them has another maximum, an inflection of the same
    /// orbit, which is no bifurcation.
    pub is_inflection: bool,
}

impl Edge {
    /// Where it is: at the bifurcation if that is in the interval, else in the middle.
    pub fn value(&self) -> f64 {
        let width = self.upper - self.lower;
        let interval = self.lower - width..=self.upper + width;
        let exact = self.bifurcation.map(|bifurcation| bifurcation.value);
        exact
            .filter(|value| interval.contains(value))
            .unwrap_or(self.middle())
    }

    /// Uncertainty of that value.
    pub fn error(&self) -> f64 {
        match self.bifurcation {
            Some(bifurcation) if bifurcation.value == self.value() => bifurcation.error,
            _ => 0.5 * (self.upper - self.lower),
        }
    }

    /// Chaos in one band begins or ends here: some above and none below, or the other way round.
    pub fn is_of_chaos(&self, begins: bool) -> bool {
        let (from, to) = if begins {
            (self.below, self.above)
        } else {
            (self.above, self.below)
        };
        from != Kind::Chaos && to == Kind::Chaos
    }

    /// The middle of the interval.
    pub fn middle(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// There is a number between its ends.
    fn can_be_halved(&self) -> bool {
        self.lower < self.middle() && self.middle() < self.upper
    }
}

/// A stretch of the parameter with one kind of motion at all values looked at.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Region {
    /// Its lower end: the middle of an edge, or the end of the sweep.
    pub from: f64,
    /// Its upper end.
    pub to: f64,
    /// The kind of motion.
    pub kind: Kind,
}

/// A sweep from one start.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Regions {
    /// The values looked at, those of the bisections included, ascending.
    pub samples: Vec<Sample>,
    /// The edges found, ascending.
    pub edges: Vec<Edge>,
    /// The regions between them.
    pub regions: Vec<Region>,
    /// Every value was looked at, and every edge bisected to the width asked for.
    pub complete: bool,
}

/// Classifies the motion from the scenario's start at each of the values, and bisects between
/// neighbours of unlike kind until the edge is in an interval no wider than `width`. Where an orbit ends or
/// loses its stability there, continuation locates the bifurcation.
///
/// All edges are halved side by side. Where the kind in the middle is neither of the two, both
/// halves have an edge, so cascades unfold. Windows narrower than the step of the sweep between
/// values of the same kind are not seen. Time grows with the number of values, plus
/// log2(step/width) for each edge, times the length of a run.
///
/// # Errors
/// If a value's scenario is not valid.
///
/// ```
/// use dynamics::regions::regions;
/// use dynamics::sweep::{Parameter, RunControl, Timing, Values};
///
/// let scenario = shared_model::Scenario::reconstruction();
/// let values = Values::new("wheel speed (rpm)", 1500.0, 1700.0, 100.0)?;
/// let timing = Timing::new(200.0, 400.0)?;
/// let found = regions(&scenario, Parameter::Speed, &values, 10.0, timing, RunControl::none())?;
/// assert!(found.complete && !found.edges.is_empty()); // a cycle at 1500 rpm, chaos at 1700 rpm
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn regions(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    width: f64,
    timing: Timing,
    control: RunControl,
) -> Result<Regions, SweepError> {
    sweep(scenario, parameter, values, (width, timing), true, control)
}

/// As [`regions`], by what trajectories show in their time alone: transients near bifurcations included, and
/// several times as fast.
///
/// # Errors
/// If a value's scenario is not valid.
pub fn regions_of_trajectories(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    width: f64,
    timing: Timing,
    control: RunControl,
) -> Result<Regions, SweepError> {
    sweep(scenario, parameter, values, (width, timing), false, control)
}

fn sweep(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    (width, timing): (f64, Timing),
    is_exact: bool,
    control: RunControl,
) -> Result<Regions, SweepError> {
    let mut level = scenarios(scenario, parameter, values)?;
    let mut samples: Vec<Sample> = Vec::new();
    let mut complete = true;
    while complete && !level.is_empty() {
        let mut found = attractors(&level, timing, true, control)?;
        complete = found.iter().all(Option::is_some);
        if is_exact {
            decide(&level, &mut found);
            prolong(&level, &mut found, timing, control)?;
        }
        let sampled = level.iter().zip(found).filter_map(|(scenario, attractor)| {
            let value = parameter.of(scenario);
            attractor.map(|attractor| Sample { value, attractor })
        });
        samples.extend(sampled);
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let wide = edges(&samples)
            .into_iter()
            .filter(|edge| edge.upper - edge.lower > width && edge.can_be_halved());
        level = wide
            .map(|edge| parameter.set(scenario, edge.middle()))
            .collect();
    }
    let mut edges = edges(&samples);
    if complete && is_exact {
        for edge in &mut edges {
            edge.bifurcation = bifurcation_at(scenario, parameter, &samples, edge);
        }
    }
    Ok(Regions {
        regions: stretches(&samples, &edges),
        samples,
        edges,
        complete,
    })
}

/// Decides trajectories that have not settled by the orbit or equilibrium beside them.
fn decide(scenarios: &[Scenario<f64>], found: &mut [Option<Attractor>]) {
    let decided = side_by_side(found.len(), |k| {
        let attractor = found[k].clone();
        attractor.map(|attractor| attractor.decided(&scenarios[k]))
    });
    found.clone_from_slice(&decided);
}

/// Continues the trajectories that are undecided for longer: near a bifurcation they leave an orbit as
/// slowly as they would approach it.
fn prolong(
    scenarios: &[Scenario<f64>],
    found: &mut [Option<Attractor>],
    timing: Timing,
    control: RunControl,
) -> Result<(), SweepError> {
    for factor in LONGER {
        let undecided: Vec<(usize, Scenario<f64>)> = (0..found.len())
            .filter_map(|k| {
                let attractor = found[k].as_ref()?;
                let state = Model::new(&scenarios[k]).state(attractor.end.into());
                let continued = started_at(&scenarios[k], &state);
                let is_undecided = attractor.kind == Kind::Undecided;
                let supported = is_undecided && is_supported(&continued).is_ok_and(|yes| yes);
                supported.then_some((k, continued))
            })
            .collect();
        let continued: Vec<Scenario<f64>> =
            undecided.iter().map(|(_, scenario)| *scenario).collect();
        let longer = Timing {
            transient_s: (factor * timing.time_s()).min(LONGEST_S),
            ..timing
        };
        let mut again = attractors(&continued, longer, true, control)?;
        decide(&continued, &mut again);
        for ((k, _), attractor) in undecided.into_iter().zip(again) {
            found[k] = attractor.or(found[k].take());
        }
    }
    Ok(())
}

fn edges(samples: &[Sample]) -> Vec<Edge> {
    let unlike = |pair: &[Sample]| {
        let edge = Edge {
            lower: pair[0].value,
            upper: pair[1].value,
            below: pair[0].attractor.kind,
            above: pair[1].attractor.kind,
            bifurcation: None,
            is_inflection: is_inflection(pair),
        };
        (edge.below != edge.above).then_some(edge)
    };
    samples.windows(2).filter_map(unlike).collect()
}

fn is_inflection(pair: &[Sample]) -> bool {
    let cycles = |sample: &Sample| match sample.attractor.kind {
        Kind::Periodic(_) => sample.attractor.cycles,
        _ => None,
    };
    let (below, above) = (cycles(&pair[0]), cycles(&pair[1]));
    below.is_some() && below == above
}

/// The bifurcation at which the orbit below an edge, or else the one above it, ends or loses its
/// stability.
fn bifurcation_at(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    samples: &[Sample],
    edge: &Edge,
) -> Option<EdgeBifurcation> {
    if edge.is_inflection {
        return None;
    }
    let beyond = BEYOND * (edge.upper - edge.lower);
    let sides = [
        (edge.lower, edge.upper + beyond),
        (edge.upper, edge.lower - beyond),
    ];
    sides.into_iter().find_map(|(value, to)| {
        let sample = samples.iter().find(|sample| sample.value == value)?;
        if !matches!(sample.attractor.kind, Kind::Periodic(_)) {
            return None;
        }
        let point = parameter.set(scenario, value);
        let (kind, value, error) = end_of_orbit(&point, parameter, &sample.attractor.end, to)?;
        Some(EdgeBifurcation { kind, value, error })
    })
}

fn stretches(samples: &[Sample], edges: &[Edge]) -> Vec<Region> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Vec::new();
    };
    let froms = std::iter::once(first.value).chain(edges.iter().map(Edge::value));
    let tos = edges
        .iter()
        .map(Edge::value)
        .chain(std::iter::once(last.value));
    let kinds = std::iter::once(first.attractor.kind).chain(edges.iter().map(|e| e.above));
    let stretch = |((from, to), kind)| Region { from, to, kind };
    froms.zip(tos).zip(kinds).map(stretch).collect()
}

/// The values looked at in both sweeps at which they end on attractors that differ, ascending.
///
/// # Errors
/// If a value's scenario is not valid.
pub fn coexisting(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    one: &Regions,
    other: &Regions,
) -> Result<Vec<f64>, SweepError> {
    let mut values = Vec::new();
    for sample in &one.samples {
        let value = sample.value;
        let same_value = |s: &Sample| s.value.total_cmp(&value);
        let Ok(k) = other.samples.binary_search_by(same_value) else {
            continue;
        };
        let equilibria = match sample.attractor.kind {
            Kind::Equilibrium => equilibria::find(&parameter.set(scenario, value))?,
            _ => Vec::new(),
        };
        let met = &other.samples[k].attractor;
        if !sample.attractor.is_same(met, &equilibria) {
            values.push(value);
        }
    }
    Ok(values)
}

/// Maxima of the yaw rate and largest exponents over the parameter, of sweeps from several starts
/// by name.
pub fn chart(sweeps: &[(&str, &Regions)], parameter: Parameter) -> Chart {
    let name = parameter.name();
    let samples = || sweeps.iter().flat_map(|(_, found)| &found.samples);
    let values = || samples().map(|sample| sample.value);
    let first = values().fold(f64::INFINITY, f64::min);
    let last = values().fold(f64::NEG_INFINITY, f64::max);
    let series = |of: fn(&Sample) -> Vec<f64>, look: fn(usize) -> Look| -> Vec<Series> {
        let one = |(n, (start, found)): (usize, &(&str, &Regions))| Series {
            label: format!("from the {} start", start),
            points: found
                .samples
                .iter()
                .flat_map(|s| of(s).into_iter().map(|y| (s.value, y)))
                .collect(),
            look: look(n),
        };
        sweeps.iter().enumerate().map(one).collect()
    };
    let axis = || {
        let axis = AxisSpec::linear(name);
        if first < last {
            axis.from_to(first, last)
        } else {
            axis
        }
    };
    let maxima = |sample: &Sample| match sample.attractor.kind.stays() {
        false => Vec::new(),
        true if sample.attractor.maxima_rad_per_s.is_empty() => {
            vec![sample.attractor.yaw_rates_rad_per_s().1]
        }
        true => sample.attractor.maxima_rad_per_s.clone(),
    };
    let exponent = |sample: &Sample| sample.attractor.exponent_per_s.into_iter().collect();
    Chart {
        heading: format!("Kinds of motion over {name}"),
        panels: vec![
            Panel {
                caption: "local maxima of the yaw rate".into(),
                x: axis(),
                y: AxisSpec::linear("yaw rate (rad/s)"),
                series: series(maxima, |_| Look::Dots),
                ..Panel::default()
            },
            Panel {
                caption: "largest Lyapunov exponent".into(),
                x: axis(),
                y: AxisSpec::linear("exponent (1/s)"),
                series: series(exponent, Look::Line),
                levels: vec![0.0],
                ..Panel::default()
            },
        ],
    }
}
