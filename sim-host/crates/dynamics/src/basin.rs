//! Basins of attraction: which start ends on which attractor.

use crate::attractor::{Attractor, Kind, attractors};
use crate::equilibria;
use crate::sweep::{RunControl, SweepError, Timing, Values};
use plot::chart::{AxisSpec, Chart, Panel, large_dots};
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
/// Trajectories are told apart by kind and extent ([`Attractor::is_same`]); the first on each
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
