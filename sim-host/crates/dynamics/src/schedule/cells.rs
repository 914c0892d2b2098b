//! Kinds of motion over wheel speed N and dither amplitude W.

use super::plan::Plan;
use crate::attractor::{Attractor, Kind, attractors};
use crate::sweep::{Parameter, RunControl, SweepError, Timing, mirrored};
use shared_model::{Scenario, listed};

listed! {
    /// The worse of the motions from both starts; from good to bad.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Class {
        /// Both at rest.
        Rest => "at rest",
        /// At least one of period one, the other too or at rest.
        PeriodOne => "period one",
        /// One of a higher period.
        PeriodN => "period n",
        /// One that does not repeat: chaos, or a transient that outlasts the run.
        NoPeriod => "no period",
        /// One leaves all bounds.
        Diverges => "diverges",
    }
}

impl Class {
    /// At rest or of period one: what a schedule is after.
    pub(crate) fn is_calm(self) -> bool {
        self <= Self::PeriodOne
    }

    fn of(kind: Kind) -> Self {
        match kind {
            Kind::Equilibrium => Self::Rest,
            Kind::Periodic(1) => Self::PeriodOne,
            Kind::Periodic(_) => Self::PeriodN,
            Kind::Chaos | Kind::BandedChaos(_) | Kind::Undecided | Kind::NotFollowed(_) => {
                Self::NoPeriod
            }
            Kind::Diverges => Self::Diverges,
        }
    }
}

/// The motions at one wheel speed under one amplitude.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Cell {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Amplitude W, V.
    pub amplitude_v: f64,
    /// Kind of the motion from the scenario's start; [`Kind::Undecided`] stands for all that do
    /// not repeat.
    pub given: Kind,
    /// The same from the mirrored start, on the other lobe of the steering angle.
    pub mirrored: Kind,
}

impl Cell {
    /// The scenario's cell.
    pub(super) fn of(scenario: &Scenario<f64>, given: Kind, mirrored: Kind) -> Self {
        Self {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            amplitude_v: scenario.dither.amplitude_v,
            given,
            mirrored,
        }
    }

    /// The worse of both.
    pub fn class(&self) -> Class {
        Class::of(self.given).max(Class::of(self.mirrored))
    }

    /// A motion and an equilibrium coexist: one start ends at rest and one does not.
    pub fn coexist(&self) -> bool {
        (self.given == Kind::Equilibrium) != (self.mirrored == Kind::Equilibrium)
    }
}

/// The cells of one wheel speed.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Column {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Its cells by ascending amplitude, those of the bisections included.
    pub cells: Vec<Cell>,
}

/// The motions of scenarios from both starts under the mean of their dither, which is on from the
/// start; `None` if it was stopped.
///
/// # Errors
/// If a scenario is not valid.
pub fn cells(
    scenarios: &[Scenario<f64>],
    timing: Timing,
    control: RunControl,
) -> Result<Option<Vec<Cell>>, SweepError> {
    let starts = |scenario: &Scenario<f64>| [*scenario, mirrored(scenario)];
    let starts: Vec<_> = scenarios.iter().flat_map(starts).collect();
    let ends = attractors(&starts, timing, false, control)?;
    let Some(ends) = ends.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let cell = |(scenario, ends): (&Scenario<f64>, &[Attractor])| {
        Cell::of(scenario, ends[0].kind, ends[1].kind)
    };
    Ok(Some(
        scenarios.iter().zip(ends.chunks(2)).map(cell).collect(),
    ))
}

/// The column of each wheel speed of the plan; `None` if it was stopped.
///
/// It begins with the plan's grid. Edges are bisected between rest, period one and all else, all of
/// them side by side; those within all else are not.
pub(super) fn columns(
    scenario: &Scenario<f64>,
    plan: &Plan,
    control: RunControl,
) -> Result<Option<Vec<Column>>, SweepError> {
    let at = |rpm, volts| {
        let scenario = Parameter::Speed.set(scenario, rpm);
        Parameter::Amplitude.set(&scenario, volts)
    };
    let of_speed = |rpm| plan.amplitudes_v.iter().map(move |volts| at(rpm, volts));
    let grid: Vec<_> = plan.speeds_rpm.iter().flat_map(of_speed).collect();
    let Some(mut all) = cells(&grid, plan.timing, control)? else {
        return Ok(None);
    };
    loop {
        let place = |cell: &Cell| (cell.wheel_speed_rpm, cell.amplitude_v);
        all.sort_by(|a, b| {
            let ((rpm, volts), (other_rpm, other_volts)) = (place(a), place(b));
            rpm.total_cmp(&other_rpm)
                .then(volts.total_cmp(&other_volts))
        });
        let middles = all.windows(2).filter_map(|pair| {
            middle_v(&pair[0], &pair[1], plan.edge_width_v)
                .map(|volts| at(pair[0].wheel_speed_rpm, volts))
        });
        let level: Vec<_> = middles.collect();
        if level.is_empty() {
            return Ok(Some(by_speed(&all)));
        }
        let Some(made) = cells(&level, plan.timing, control)? else {
            return Ok(None);
        };
        all.extend(made);
    }
}

/// The columns of cells that are sorted by speed.
fn by_speed(cells: &[Cell]) -> Vec<Column> {
    let columns = cells.chunk_by(|a, b| a.wheel_speed_rpm == b.wheel_speed_rpm);
    let column = |cells: &[Cell]| Column {
        wheel_speed_rpm: cells[0].wheel_speed_rpm,
        cells: cells.to_vec(),
    };
    columns.map(column).collect()
}

/// The amplitude between two cells of a column with an edge that is too wide between them, V.
fn middle_v(lower: &Cell, upper: &Cell, width_v: f64) -> Option<f64> {
    let same_column = lower.wheel_speed_rpm == upper.wheel_speed_rpm;
    let wide = upper.amplitude_v - lower.amplitude_v > width_v;
    let (below, above) = (lower.class(), upper.class());
    let edge = below != above && (below.is_calm() || above.is_calm());
    let middle_v = 0.5 * (lower.amplitude_v + upper.amplitude_v);
    // Neighbouring numbers have none between them.
    let between = lower.amplitude_v < middle_v && middle_v < upper.amplitude_v;
    (same_column && wide && edge && between).then_some(middle_v)
}
