//! Kinds of motion over wheel speed N and dither amplitude W.

use super::Plan;
use crate::chaos::attractor::{Kind, attractor};
use crate::chaos::sweep::{Parameter, SweepError, Timing, Watch, mirrored};
use rayon::prelude::*;
use shared_model::Scenario;

/// The worse of the motions from both starts; from good to bad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Both at rest.
    Rest,
    /// At least one of period one, the other too or at rest.
    PeriodOne,
    /// One of a higher period.
    PeriodN,
    /// One that does not repeat: chaos, or a transient that outlasts the run.
    NoPeriod,
    /// One leaves all bounds.
    Diverges,
}

impl Class {
    /// All classes, from good to bad.
    pub const ALL: [Self; 5] = [
        Self::Rest,
        Self::PeriodOne,
        Self::PeriodN,
        Self::NoPeriod,
        Self::Diverges,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "at rest",
            Self::PeriodOne => "period one",
            Self::PeriodN => "period n",
            Self::NoPeriod => "no period",
            Self::Diverges => "diverges",
        }
    }

    /// At rest or of period one: what a schedule is after.
    pub fn is_calm(self) -> bool {
        self <= Self::PeriodOne
    }

    fn of(kind: Kind) -> Self {
        match kind {
            Kind::Equilibrium => Self::Rest,
            Kind::Periodic(1) => Self::PeriodOne,
            Kind::Periodic(_) => Self::PeriodN,
            Kind::Chaos | Kind::BandedChaos(_) | Kind::Undecided => Self::NoPeriod,
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
    /// Kind of the motion from the scenario's start; [`Kind::Undecided`] stands for all that do not repeat.
    pub given: Kind,
    /// The same from the mirrored start, on the other lobe of the steering angle.
    pub mirrored: Kind,
}

impl Cell {
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

/// The motions of a scenario from both starts under the mean of its dither, which is on from the start.
///
/// # Errors
/// If the scenario is not valid.
pub fn cell(scenario: &Scenario<f64>, timing: Timing) -> Result<Cell, SweepError> {
    let kind = |scenario: &Scenario<f64>| Ok(attractor(scenario, timing, false)?.kind);
    both(scenario, kind)
}

/// The scenario's cell, given how to tell a motion's kind.
pub(super) fn both(
    scenario: &Scenario<f64>,
    kind: impl Fn(&Scenario<f64>) -> Result<Kind, SweepError>,
) -> Result<Cell, SweepError> {
    Ok(Cell {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        amplitude_v: scenario.dither.amplitude_v,
        given: kind(scenario)?,
        mirrored: kind(&mirrored(scenario))?,
    })
}

/// The column of each wheel speed of the plan; `None` if it was stopped.
///
/// Edges are bisected between rest, period one and all else; those within all else are not.
pub(super) fn columns(
    scenario: &Scenario<f64>,
    plan: &Plan,
    watch: Watch,
) -> Result<Option<Vec<Column>>, SweepError> {
    let at = |rpm, volts| {
        let scenario = Parameter::Speed.set(scenario, rpm);
        Parameter::Amplitude.set(&scenario, volts)
    };
    let of_speed = |rpm| plan.amplitudes_v.iter().map(move |volts| at(rpm, volts));
    let scenarios: Vec<_> = plan.speeds_rpm.iter().flat_map(of_speed).collect();
    let coarse = watch.points(&scenarios, |scenario| cell(scenario, plan.timing));
    let Some(coarse) = coarse.into_iter().collect::<Option<Result<Vec<_>, _>>>() else {
        return Ok(None);
    };
    let coarse = coarse?;
    let measure = |rpm, volts| watch.point(|| cell(&at(rpm, volts), plan.timing));
    let refined = coarse
        .par_windows(2)
        .with_max_len(1)
        .map(|pair| refine(&pair[0], &pair[1], plan.edge_width_v, &measure))
        .collect::<Option<Result<Vec<_>, _>>>();
    let Some(refined) = refined else {
        return Ok(None);
    };
    let mut cells = coarse;
    cells.extend(refined?.into_iter().flatten());
    let column = |wheel_speed_rpm| {
        let own = |cell: &&Cell| cell.wheel_speed_rpm == wheel_speed_rpm;
        let mut cells: Vec<Cell> = cells.iter().filter(own).copied().collect();
        cells.sort_by(|a, b| a.amplitude_v.total_cmp(&b.amplitude_v));
        Column {
            wheel_speed_rpm,
            cells,
        }
    };
    Ok(Some(plan.speeds_rpm.iter().map(column).collect()))
}

/// The cells that a bisection between two of a column adds; `None` if it was stopped.
fn refine(
    lower: &Cell,
    upper: &Cell,
    width_v: f64,
    measure: &impl Fn(f64, f64) -> Option<Result<Cell, SweepError>>,
) -> Option<Result<Vec<Cell>, SweepError>> {
    let same_column = lower.wheel_speed_rpm == upper.wheel_speed_rpm;
    let wide = upper.amplitude_v - lower.amplitude_v > width_v;
    let (below, above) = (lower.class(), upper.class());
    let edge = below != above && (below.is_calm() || above.is_calm());
    if !(same_column && wide && edge) {
        return Some(Ok(Vec::new()));
    }
    let middle_v = 0.5 * (lower.amplitude_v + upper.amplitude_v);
    let middle = match measure(lower.wheel_speed_rpm, middle_v)? {
        Ok(middle) => middle,
        Err(error) => return Some(Err(error)),
    };
    let halves = [(lower, &middle), (&middle, upper)];
    let mut cells = vec![middle];
    for (lower, upper) in halves {
        match refine(lower, upper, width_v, measure)? {
            Ok(more) => cells.extend(more),
            Err(error) => return Some(Err(error)),
        }
    }
    Some(Ok(cells))
}
