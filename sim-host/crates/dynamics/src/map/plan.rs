//! Which cells a map has, and the motion of each.

use crate::observe::is_supported;
use crate::sweep::{SweepError, Timing, Values, mirrored};
use crate::words::counted;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use shared_model::dither::Waveform;
use shared_model::{InvalidScenario, Scenario};

/// Cells of a tile: so many that no lane of the engine waits long for another.
pub const CELLS_A_TILE: usize = 128;
/// Most sheets of a map: one of each waveform and start.
pub(crate) const MOST_SHEETS: usize = 6;
/// Longest run of a cell, s: that of a scenario.
pub(crate) const MOST_TIME_S: f64 = 1e6;
/// Most cells of a map: their rows take some GB.
pub(crate) const MOST_CELLS: usize = 10_000_000;

/// Equally spaced values, both ends among them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// The least, rpm or V.
    pub from: f64,
    /// The greatest, rpm or V.
    pub to: f64,
    /// How many: at least 1.
    pub count: usize,
}

impl From<Values> for Grid {
    fn from(values: Values) -> Self {
        Self {
            from: values.first(),
            to: values.last(),
            count: values.count(),
        }
    }
}

impl Grid {
    /// Distance of neighbours, rpm or V; 0 without any.
    pub fn step(&self) -> f64 {
        (self.to - self.from) / (self.count - 1).max(1) as f64
    }

    /// Its values, bit for bit those of a sweep in the same decimal steps.
    fn values(&self, what: &'static str) -> Result<Values, PlanError> {
        if self.from > self.to {
            return Err(PlanError::Descending { what });
        }
        Ok(Values::between(what, self.from, self.to, self.count)?)
    }
}

/// Where the motions of a sheet start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At the scenario's start.
    Given,
    /// At the start with the opposite signs, on the other lobe of the steering angle.
    Mirrored,
}

/// The cells of one waveform from one start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// The waveform: square wave or sine.
    pub waveform: Waveform,
    /// Where the motions start.
    pub start: Start,
    /// Its amplitudes W, V.
    pub amplitudes_v: Grid,
}

/// What a map is made from: the same plan gives the same map, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the program.
    pub version: String,
    /// The vehicle and its start. Wheel speed, waveform and amplitude are those of each cell; the
    /// dither acts through its mean and from the start.
    pub scenario: Scenario<f64>,
    /// The sheets, each with as many amplitudes.
    pub sheets: Vec<Sheet>,
    /// The wheel speeds N of all sheets, rpm.
    pub speeds_rpm: Grid,
    /// What of each run is not looked at, s.
    pub transient_s: f64,
    /// What of each run is looked at, s.
    pub observed_s: f64,
}

/// Why a map cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A range is none.
    #[error(transparent)]
    Range(#[from] SweepError),
    /// An axis from its greatest value to its least.
    #[error("{what}: the ends of a map's axis must ascend")]
    Descending {
        /// What the axis shows.
        what: &'static str,
    },
    /// A map without cells, or with too many to hold.
    #[error("the map has {}; it must have 1 to {MOST_CELLS}", counted(*.cells, "cell"))]
    Size {
        /// Its cells.
        cells: usize,
    },
    /// A map without sheets, or with more than there are waveforms and starts.
    #[error("the map has {sheets} sheets; it must have 1 to {MOST_SHEETS}")]
    Sheets {
        /// Its sheets.
        sheets: usize,
    },
    /// Runs that nobody could wait for.
    #[error("each run of the map takes {time_s} s; it must take at most {MOST_TIME_S} s")]
    Time {
        /// Length of a run, s.
        time_s: f64,
    },
    /// Sheets of different sizes.
    #[error("the sheets of a map must have as many amplitudes each")]
    Uneven,
    /// A cell's scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The engine cannot follow the motions.
    #[error(
        "the map cannot follow this friction: it is under the mean of a sine, or the motion may slide along a step of it; \
         choose another law or leave it undithered"
    )]
    Friction,
}

impl Plan {
    /// A plan of this version of the program.
    ///
    /// # Errors
    /// If a range is none, a cell's scenario is not valid, or the engine cannot follow its motion.
    pub fn new(
        scenario: Scenario<f64>,
        sheets: Vec<Sheet>,
        speeds_rpm: Grid,
        timing: Timing,
    ) -> Result<Self, PlanError> {
        let plan = Self {
            version: env!("CARGO_PKG_VERSION").into(),
            scenario,
            sheets,
            speeds_rpm,
            transient_s: timing.transient_s,
            observed_s: timing.observed_s,
        };
        plan.validate()?;
        Ok(plan)
    }

    /// Checks a plan that comes from outside.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn validate(&self) -> Result<(), PlanError> {
        // First what all else is counted by.
        let sheets = self.sheets.len();
        if sheets == 0 || sheets > MOST_SHEETS {
            return Err(PlanError::Sheets { sheets });
        }
        self.timing()?;
        let axes = self.axes()?;
        let cells = self.cells();
        if cells == 0 || cells > MOST_CELLS {
            return Err(PlanError::Size { cells });
        }
        let amplitudes = |sheet: &Sheet| sheet.amplitudes_v.count;
        if self
            .sheets
            .windows(2)
            .any(|pair| amplitudes(&pair[0]) != amplitudes(&pair[1]))
        {
            return Err(PlanError::Uneven);
        }
        for corner in self.corners(&axes) {
            if !is_supported(&corner)? {
                return Err(PlanError::Friction);
            }
        }
        Ok(())
    }

    /// Times of each run, checked.
    ///
    /// # Errors
    /// If nothing of a run is observed, or one is too long.
    pub fn timing(&self) -> Result<Timing, PlanError> {
        let Self {
            transient_s,
            observed_s,
            ..
        } = *self;
        let time_s = transient_s + observed_s;
        if time_s > MOST_TIME_S {
            return Err(PlanError::Time { time_s });
        }
        Timing::new(transient_s, time_s)?;
        Ok(Timing {
            transient_s,
            observed_s,
        })
    }

    /// In what it differs from another plan, each as `key is its value, not the other's`.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let value = |plan| serde_json::to_value(plan).unwrap_or_default();
        let mut differences = Vec::new();
        differ("", &value(self), &value(other), &mut differences);
        differences
    }

    /// Cells in all sheets.
    pub fn cells(&self) -> usize {
        let cells = |sheet: &Sheet| {
            sheet
                .amplitudes_v
                .count
                .saturating_mul(self.speeds_rpm.count)
        };
        let cells = self.sheets.iter().map(cells);
        cells.fold(0, usize::saturating_add)
    }

    /// Tiles of the map.
    pub fn tiles(&self) -> usize {
        self.cells().div_ceil(CELLS_A_TILE)
    }

    /// Where each cell of a tile lies. Cells are counted by sheet, therein by wheel speed, therein
    /// by amplitude.
    pub fn places(&self, tile: usize) -> Vec<Place> {
        let first = tile * CELLS_A_TILE;
        let last = self.cells().min(first + CELLS_A_TILE);
        // A plan that is not valid has none.
        let axes = self.axes().ok();
        let places = axes.map(|axes| (first..last).map(|cell| self.place(&axes, cell)).collect());
        places.unwrap_or_default()
    }

    fn axes(&self) -> Result<Axes, PlanError> {
        let amplitudes = |sheet: &Sheet| sheet.amplitudes_v.values("dither amplitude (V)");
        Ok(Axes {
            speeds_rpm: self.speeds_rpm.values("wheel speed (rpm)")?,
            amplitudes_v: self
                .sheets
                .iter()
                .map(amplitudes)
                .collect::<Result<_, _>>()?,
        })
    }

    fn place(&self, axes: &Axes, cell: usize) -> Place {
        let amplitudes = self.sheets[0].amplitudes_v.count;
        let (column, amplitude) = (cell / amplitudes, cell % amplitudes);
        let (sheet, speed) = (
            column / self.speeds_rpm.count,
            column % self.speeds_rpm.count,
        );
        self.place_at(axes, sheet, speed, amplitude)
    }

    fn place_at(&self, axes: &Axes, sheet: usize, speed: usize, amplitude: usize) -> Place {
        Place {
            waveform: self.sheets[sheet].waveform,
            start: self.sheets[sheet].start,
            wheel_speed_rpm: axes.speeds_rpm.at(speed),
            dither_amplitude_v: axes.amplitudes_v[sheet].at(amplitude),
        }
    }

    /// The motion of a cell.
    pub fn motion(&self, place: &Place) -> Scenario<f64> {
        let mut scenario = self.scenario;
        scenario.run.wheel_speed_rpm = place.wheel_speed_rpm;
        scenario.dither.waveform = place.waveform;
        scenario.dither.amplitude_v = place.dither_amplitude_v;
        match place.start {
            Start::Given => scenario,
            Start::Mirrored => mirrored(&scenario),
        }
    }

    /// The motions of each sheet at the ends of its axes: all parameters have one range, so the
    /// cells between are valid too.
    fn corners(&self, axes: &Axes) -> Vec<Scenario<f64>> {
        let ends = |values: &Values| [0, values.count() - 1];
        let of_sheet = |sheet: usize| {
            ends(&axes.speeds_rpm).map(|speed| {
                ends(&axes.amplitudes_v[sheet])
                    .map(|amplitude| self.motion(&self.place_at(axes, sheet, speed, amplitude)))
            })
        };
        let sheets = (0..self.sheets.len()).flat_map(of_sheet);
        sheets.flatten().collect()
    }
}

/// The values of a plan's axes.
struct Axes {
    speeds_rpm: Values,
    /// Those of each sheet.
    amplitudes_v: Vec<Values>,
}

/// Collects the keys at which two values differ, with both.
fn differ(key: &str, own: &Value, other: &Value, differences: &mut Vec<String>) {
    match (own.as_object(), other.as_object()) {
        (Some(own), Some(other)) => {
            for (name, value) in own {
                let key = if key.is_empty() {
                    name.clone()
                } else {
                    format!("{key}.{name}")
                };
                let other = other.get(name).unwrap_or(&Value::Null);
                differ(&key, value, other, differences);
            }
        }
        _ if own != other => differences.push(format!("{key} is {own}, not {other}")),
        _ => {}
    }
}

/// Where a cell lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The dither's waveform.
    pub waveform: Waveform,
    /// Where the motion starts.
    pub start: Start,
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Dither amplitude W, V.
    pub dither_amplitude_v: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        from: 0.0,
        to: 0.2,
        count: 21,
    };

    fn plan() -> Plan {
        let sheet = |waveform| Sheet {
            waveform,
            start: Start::Given,
            amplitudes_v: GRID,
        };
        let speeds_rpm = Grid {
            from: 1000.0,
            to: 2000.0,
            count: 11,
        };
        let sheets = vec![sheet(Waveform::Square), sheet(Waveform::Sine)];
        let timing = Timing::new(1.0, 2.0).unwrap();
        Plan::new(Scenario::reconstruction(), sheets, speeds_rpm, timing).unwrap()
    }

    #[test]
    fn the_tiles_hold_each_cell_once_in_order() {
        let plan = plan();
        let places: Vec<Place> = (0..plan.tiles()).flat_map(|n| plan.places(n)).collect();
        assert_eq!((places.len(), plan.cells()), (462, 462));
        let ends = [places[0], places[461]];
        assert_eq!(ends.map(|p| p.waveform), [Waveform::Square, Waveform::Sine]);
        assert_eq!(ends.map(|p| p.wheel_speed_rpm), [1000.0, 2000.0]);
        assert_eq!(ends.map(|p| p.dither_amplitude_v), [0.0, 0.2]);
        let key = |p: &Place| {
            (
                p.waveform == Waveform::Sine,
                p.wheel_speed_rpm,
                p.dither_amplitude_v,
            )
        };
        assert!(places.is_sorted_by(|a, b| key(a) < key(b)));
    }

    /// As `schedule --map` needs it; one speed and one amplitude are a map too.
    #[test]
    fn a_grid_has_the_values_of_the_sweep_that_it_comes_from() {
        for (from, to, step) in [
            (1000.0, 2000.0, 25.0),
            (0.0, 0.15, 0.005),
            (0.0, 1.35, 0.045),
            (1600.3, 1700.1, 0.1),
            (0.14, 0.14, 1.0),
            (0.3, 0.0, 0.1),
        ] {
            let sweep = Values::new("test", from, to, step).unwrap();
            let grid = Grid::from(sweep).values("test").unwrap();
            assert!(grid.iter().eq(sweep.iter()), "{from} {to} {step}");
        }
    }

    #[test]
    fn counts_that_make_no_map_are_refused() {
        let with = |change: fn(&mut Plan)| {
            let mut plan = plan();
            change(&mut plan);
            plan.validate().unwrap_err().to_string()
        };
        for (found, part) in [
            (with(|plan| plan.sheets.clear()), "0 sheets"),
            (
                with(|plan| plan.speeds_rpm.count = 0),
                "0 values from 1000 to 2000",
            ),
            (
                with(|plan| plan.speeds_rpm.count = 1),
                "1 value from 1000 to 2000",
            ),
            (
                with(|plan| plan.speeds_rpm.count = usize::MAX),
                "the same number",
            ),
            (
                with(|plan| plan.speeds_rpm.count = 1_000_000_000_000),
                "cells",
            ),
            (with(|plan| plan.speeds_rpm.from = 3000.0), "must ascend"),
            (
                with(|plan| plan.sheets[1].amplitudes_v.count = 20),
                "as many amplitudes",
            ),
            (with(|plan| plan.speeds_rpm.to = f64::NAN), "finite"),
        ] {
            assert!(found.contains(part), "{found} lacks {part:?}");
        }
    }

    #[test]
    fn a_plan_is_read_back_as_it_was_written() {
        let mut plan = plan();
        plan.scenario.vehicle.mass_kg = 1_234.567_890_123_456_7;
        let json = serde_json::to_string(&plan).unwrap();
        let read: Plan = serde_json::from_str(&json).unwrap();
        assert_eq!(read, plan);
    }
}
