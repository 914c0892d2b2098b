//! Basins of attraction: which start ends on which attractor, and which share of the starts does.

use crate::attractor::{Attractor, Kind, attractors};
use crate::equilibria;
use crate::sweep::{Parameter, RunControl, SweepError, Timing, Values, scenarios};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series, large_dots};
use shared_model::Scenario;

/// One start, and where it ends.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Cell {
    /// Sideslip angle at the start, rad.
    pub sideslip_rad: f64,
    /// Steering angle at the start, rad.
    pub steering_angle_rad: f64,
    /// Index of the attractor.
    pub attractor: usize,
}

/// Which start ends where.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Basin {
    /// The attractors, in the order in which the starts meet them; motions that diverge count as
    /// one.
    pub attractors: Vec<Attractor>,
    /// The starts, by steering angle within sideslip angle; those not begun are left out.
    pub cells: Vec<Cell>,
}

/// Follows the motion from each start of the grid; yaw rate and steering rate start as in the
/// scenario.
///
/// Trajectories are told apart by kind and extent; the first on each
/// attractor without period has its exponent worked out, which tells chaos from a transient that
/// outlasts the run. Time grows with the number of starts times the length of a run; starts that
/// diverge end early.
///
/// # Errors
/// If a start's scenario is not valid.
///
/// ```
/// use dynamics::basin::basin;
/// use dynamics::sweep::{RunControl, Timing, Values};
///
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.run.wheel_speed_rpm = 1600.0;
/// let angles = Values::new("angle (rad)", -0.02, 0.02, 0.04)?;
/// let basin = basin(&scenario, &angles, &angles, Timing::new(100.0, 200.0)?, RunControl::none())?;
/// assert_eq!(basin.cells.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn basin(
    scenario: &Scenario<f64>,
    sideslips_rad: &Values,
    steering_angles_rad: &Values,
    timing: Timing,
    control: RunControl,
) -> Result<Basin, SweepError> {
    let at = |beta, delta| {
        let mut scenario = *scenario;
        scenario.run.sideslip_rad = beta;
        scenario.run.steering_angle_rad = delta;
        scenario.validate().map(|()| scenario)
    };
    let row = |beta| steering_angles_rad.iter().map(move |delta| at(beta, delta));
    let starts = sideslips_rad
        .iter()
        .flat_map(row)
        .collect::<Result<Vec<_>, _>>()?;
    let ends = attractors(&starts, timing, false, control)?;
    let equilibria = equilibria::find(scenario)?;
    let mut found: Vec<(usize, Attractor)> = Vec::new();
    let mut cells = Vec::new();
    for (k, (start, end)) in starts.iter().zip(ends).enumerate() {
        let Some(end) = end else { continue };
        let known = found.iter().position(|(_, a)| a.is_same(&end, &equilibria));
        let attractor = known.unwrap_or(found.len());
        if known.is_none() {
            found.push((k, end));
        }
        cells.push(Cell {
            sideslip_rad: start.run.sideslip_rad,
            steering_angle_rad: start.run.steering_angle_rad,
            attractor,
        });
    }
    let unnamed = |(_, end): &&(usize, Attractor)| end.kind == Kind::Undecided;
    let unnamed: Vec<_> = found.iter().filter(unnamed).map(|f| starts[f.0]).collect();
    let mut named = attractors(&unnamed, timing, true, RunControl::none())?
        .into_iter()
        .flatten();
    let name = |(_, end): (usize, Attractor)| match end.kind {
        Kind::Undecided => named.next().expect("nobody stops it"),
        _ => end,
    };
    let attractors = found.into_iter().map(name).collect();
    Ok(Basin { attractors, cells })
}

/// Share of the starts that end on attractors of a kind on one side.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Share {
    /// Kind of the attractors.
    pub kind: Kind,
    /// Side of the steering angle on which they are: positive, negative or both.
    pub lobe: &'static str,
    /// Starts that end there.
    pub starts: usize,
    /// Their share of all.
    pub share: f64,
    /// Its binomial standard error, as if the starts were drawn at random: sqrt(p (1 - p) / n).
    pub standard_error: f64,
}

/// Basin stability at one value of a parameter.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Stability {
    /// The parameter's value.
    pub value: f64,
    /// The shares, the greatest first.
    pub shares: Vec<Share>,
}

/// Basin stability over a parameter: the shares of the same grid of starts that end on attractors of each kind
/// and side (P. J. Menck et al., Nature Physics 9 (2013) 89). The last value may be missing after an
/// interruption.
///
/// Time grows with the number of values times that of [`basin`].
///
/// # Errors
/// If a scenario is not valid.
///
/// ```
/// use dynamics::attractor::Kind;
/// use dynamics::basin::stability;
/// use dynamics::sweep::{Parameter, RunControl, Timing, Values};
///
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.friction.coefficient = 0.0;
/// let speeds = Values::new("wheel speed (rpm)", 1000.0, 1000.0, 1.0)?;
/// let angles = Values::new("angle (rad)", -0.2, 0.2, 0.4)?;
/// let timing = Timing::new(100.0, 200.0)?;
/// let found = stability(&scenario, Parameter::Speed, &speeds, (&angles, &angles), timing, RunControl::none())?;
/// // Without friction and at a low speed all starts come to rest, half of them on each side.
/// assert!(found[0].shares.iter().all(|share| share.kind == Kind::Equilibrium && share.share == 0.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn stability(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    (sideslips_rad, steering_angles_rad): (&Values, &Values),
    timing: Timing,
    control: RunControl,
) -> Result<Vec<Stability>, SweepError> {
    let starts = sideslips_rad.count() * steering_angles_rad.count();
    let mut found = Vec::new();
    for scenario in scenarios(scenario, parameter, values)? {
        let basin = basin(
            &scenario,
            sideslips_rad,
            steering_angles_rad,
            timing,
            control,
        )?;
        if basin.cells.len() < starts {
            break;
        }
        let value = parameter.of(&scenario);
        let shares = shares(&basin);
        found.push(Stability { value, shares });
    }
    Ok(found)
}

fn shares(basin: &Basin) -> Vec<Share> {
    let all = basin.cells.len();
    let mut shares: Vec<Share> = Vec::new();
    for (k, attractor) in basin.attractors.iter().enumerate() {
        let starts = basin
            .cells
            .iter()
            .filter(|cell| cell.attractor == k)
            .count();
        let (kind, lobe) = (attractor.kind, attractor.lobe());
        let same = |share: &&mut Share| share.kind == kind && share.lobe == lobe;
        match shares.iter_mut().find(same) {
            Some(share) => share.starts += starts,
            None => shares.push(Share {
                kind,
                lobe,
                starts,
                share: 0.0,
                standard_error: 0.0,
            }),
        }
    }
    for share in &mut shares {
        let p = share.starts as f64 / all as f64;
        share.share = p;
        share.standard_error = (p * (1.0 - p) / all as f64).sqrt();
    }
    shares.sort_by_key(|share| std::cmp::Reverse(share.starts));
    shares
}

/// The regime of a kind: fewer than there are periods.
fn regime(kind: Kind) -> &'static str {
    match kind {
        Kind::Equilibrium => "at rest",
        Kind::Periodic(_) => "periodic",
        Kind::Chaos | Kind::BandedChaos(_) => "chaos",
        Kind::Undecided | Kind::Diverges | Kind::NotFollowed(_) => "undecided or divergent",
    }
}

/// Shares of the initial states over the parameter, by regime and side.
pub fn stability_chart(found: &[Stability], parameter: Parameter) -> Chart {
    let group = |share: &Share| (regime(share.kind), share.lobe);
    let mut groups: Vec<_> = found
        .iter()
        .flat_map(|one| &one.shares)
        .map(group)
        .collect();
    groups.sort();
    groups.dedup();
    let series = |(k, &(regime, lobe)): (usize, &(&'static str, &'static str))| {
        let share_at = |one: &Stability| {
            let its = one
                .shares
                .iter()
                .filter(|share| group(share) == (regime, lobe));
            (one.value, its.map(|share| share.share).sum())
        };
        Series {
            label: format!("{regime}, steering angle {lobe}"),
            points: found.iter().map(share_at).collect(),
            look: Look::Line(k),
        }
    };
    Chart {
        heading: "Basin stability".into(),
        panels: vec![Panel {
            caption: "share of the initial states that approach attractors of each regime".into(),
            x: AxisSpec::linear(parameter.name()),
            y: AxisSpec::linear("share"),
            series: groups.iter().enumerate().map(series).collect(),
            ..Panel::default()
        }],
    }
}

/// Initial states by the attractor that they approach.
pub fn chart(basin: &Basin, wheel_speed_rpm: f64) -> Chart {
    let series = |(k, attractor): (usize, &Attractor)| {
        let cells = basin.cells.iter().filter(|cell| cell.attractor == k);
        let start = |cell: &Cell| (cell.sideslip_rad, cell.steering_angle_rad);
        large_dots(&attractor.describe(), k, cells.map(start).collect())
    };
    Chart {
        heading: format!("Basins of attraction at {wheel_speed_rpm} rpm"),
        panels: vec![Panel {
            caption: "where the motion ends, by its start".into(),
            x: AxisSpec::linear("sideslip angle at the start (rad)"),
            y: AxisSpec::linear("steering angle at the start (rad)"),
            series: basin
                .attractors
                .iter()
                .enumerate()
                .flat_map(series)
                .collect(),
            ..Panel::default()
        }],
    }
}
