//! The first cells of schedules out of a map over the same grid.

use super::cells::Cell;
use super::plan::Plan;
use crate::attractor::Kind;
use crate::map::cell;
use crate::map::plan::{Grid, Plan as MapPlan, PlanError, Sheet, Start};
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// Greatest difference of the ends of grids that are the same, as a share.
const SAME_END: f64 = 1e-9;

/// The plan of the map that schedules of square wave and sine, over the same speeds, begin with.
///
/// # Errors
/// If there is no such map: it needs motions that the engine can follow.
pub fn fitting(scenario: &Scenario<f64>, square: &Plan, sine: &Plan) -> Result<MapPlan, PlanError> {
    let sheets = [Start::Given, Start::Mirrored]
        .into_iter()
        .flat_map(|start| {
            [(Waveform::Square, square), (Waveform::Sine, sine)].map(|(waveform, plan)| Sheet {
                waveform,
                start,
                amplitudes_v: plan.amplitudes_v.into(),
            })
        });
    let speeds_rpm = square.speeds_rpm.into();
    MapPlan::new(*scenario, sheets.collect(), speeds_rpm, square.timing)
}

/// In what a map differs from the fitting one, in words; nothing if it fits. Sheets that it has
/// beyond those do no harm.
pub fn misfits(map: &MapPlan, fitting: &MapPlan) -> Vec<String> {
    let mut misfits = Vec::new();
    for sheet in &fitting.sheets {
        let what = format!(
            "{:?} dither from the {:?} start",
            sheet.waveform, sheet.start
        );
        match sheet_of(map, sheet.waveform, sheet.start) {
            None => misfits.push(format!("it lacks the {what}")),
            Some(k) if !is_same(&map.sheets[k].amplitudes_v, &sheet.amplitudes_v) => {
                let [own, other] = [&map.sheets[k], sheet].map(|s| words(&s.amplitudes_v, "V"));
                misfits.push(format!(
                    "the amplitudes of its {what} are {own}, not {other}"
                ));
            }
            Some(_) => {}
        }
    }
    if !is_same(&map.speeds_rpm, &fitting.speeds_rpm) {
        let [own, other] = [map, fitting].map(|plan| words(&plan.speeds_rpm, "rpm"));
        misfits.push(format!("its wheel speeds are {own}, not {other}"));
    }
    // What is compared above, and what each cell has of its own.
    let mut rest = MapPlan {
        sheets: fitting.sheets.clone(),
        speeds_rpm: fitting.speeds_rpm,
        ..map.clone()
    };
    let (own, other) = (&mut rest.scenario, &fitting.scenario);
    own.run.wheel_speed_rpm = other.run.wheel_speed_rpm;
    own.dither.waveform = other.dither.waveform;
    own.dither.amplitude_v = other.dither.amplitude_v;
    own.dither.application = other.dither.application;
    own.dither.start_time_s = other.dither.start_time_s;
    let others = rest.differences(fitting);
    misfits.extend(
        others
            .into_iter()
            .map(|difference| format!("its {difference}")),
    );
    misfits
}

fn words(grid: &Grid, unit: &str) -> String {
    format!("{} from {} to {} {unit}", grid.count, grid.from, grid.to)
}

fn is_same(one: &Grid, other: &Grid) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= SAME_END * a.abs().max(b.abs());
    one.count == other.count && close(one.from, other.from) && close(one.to, other.to)
}

fn sheet_of(map: &MapPlan, waveform: Waveform, start: Start) -> Option<usize> {
    let is_it = |sheet: &Sheet| sheet.waveform == waveform && sheet.start == start;
    map.sheets.iter().position(is_it)
}

/// A waveform's cells of the plan out of a map that fits, in the plan's order; none without the
/// waveform's sheets.
pub fn first_cells(
    map: &MapPlan,
    cells: &[cell::Cell],
    waveform: Waveform,
    plan: &Plan,
) -> Option<Vec<Cell>> {
    let [given, mirrored] = [Start::Given, Start::Mirrored].map(|start| {
        let a_sheet = plan.speeds_rpm.count() * plan.amplitudes_v.count();
        cells.chunks(a_sheet).nth(sheet_of(map, waveform, start)?)
    });
    let of_speed = |rpm| plan.amplitudes_v.iter().map(move |volts| (rpm, volts));
    let places = plan.speeds_rpm.iter().flat_map(of_speed);
    let cell = |((wheel_speed_rpm, amplitude_v), (given, mirrored))| Cell {
        wheel_speed_rpm,
        amplitude_v,
        given: kind(given),
        mirrored: kind(mirrored),
    };
    Some(places.zip(given?.iter().zip(mirrored?)).map(cell).collect())
}

/// The kind by the period alone, as a schedule's own runs judge it: the map calls a motion
/// undecided whose period the exponent contradicts, and keeps the period.
fn kind(cell: &cell::Cell) -> Kind {
    match (cell.kind, cell.period) {
        (cell::Kind::Diverges, _) => Kind::Diverges,
        (_, Some(0)) => Kind::Equilibrium,
        (_, Some(maxima)) => Kind::Periodic(maxima as usize),
        (_, None) => Kind::Undecided,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::cell::Kind as MapKind;
    use crate::sweep::{Timing, Values};

    fn plan(greatest_v: f64) -> Plan {
        Plan {
            speeds_rpm: Values::new("speed", 1500.0, 1600.0, 50.0).unwrap(),
            amplitudes_v: Values::new("amplitude", 0.0, greatest_v, 0.25 * greatest_v).unwrap(),
            edge_width_v: 0.001,
            margin: 0.25,
            timing: Timing::new(1.0, 3.0).unwrap(),
        }
    }

    fn map() -> MapPlan {
        fitting(&Scenario::reconstruction(), &plan(0.1), &plan(1.0)).unwrap()
    }

    #[test]
    fn grids_are_the_same_up_to_rounding_and_parameters_to_the_bit() {
        let mut other = map();
        other.speeds_rpm.to *= 1.0 + 1e-10;
        other.scenario.run.wheel_speed_rpm = 1.0;
        other.scenario.dither.waveform = Waveform::Sine;
        assert_eq!(misfits(&other, &map()), [] as [&str; 0]);
        other.speeds_rpm.to *= 1.0 + 1e-8;
        other.scenario.run.yaw_rate_rad_per_s += 1e-12;
        other.sheets.remove(3);
        let misfits = misfits(&other, &map());
        assert_eq!(misfits.len(), 3, "{misfits:?}");
    }

    /// The cells of a map, with sheets in another order, are told apart by a number as their
    /// period.
    #[test]
    fn each_cell_comes_from_its_two_in_the_map() {
        let mut map = map();
        map.sheets.rotate_left(1);
        let places = (0..map.tiles()).flat_map(|tile| map.places(tile));
        let mut cells = cell::cells(&map, &places.collect::<Vec<_>>()).unwrap();
        for (number, cell) in (1..).zip(&mut cells) {
            (cell.kind, cell.period) = (MapKind::Periodic, Some(number));
        }
        let first = first_cells(&map, &cells, Waveform::Sine, &plan(1.0)).unwrap();
        assert_eq!(first.len(), 15);
        for cell in &first {
            let of = |start| {
                let number = cells.iter().position(|one| {
                    one.waveform == Waveform::Sine
                        && one.start == start
                        && one.wheel_speed_rpm == cell.wheel_speed_rpm
                        && one.dither_amplitude_v == cell.amplitude_v
                });
                Kind::Periodic(1 + number.expect("the map has it"))
            };
            let found = [cell.given, cell.mirrored];
            assert_eq!(found, [Start::Given, Start::Mirrored].map(of));
        }
    }

    /// As in a schedule's own runs, which know no exponent.
    #[test]
    fn the_period_decides() {
        let map = map();
        let mut cell = cell::cells(&map, &map.places(0)[..1]).unwrap()[0];
        for (kind_in_map, period, expected) in [
            (MapKind::Equilibrium, Some(0), Kind::Equilibrium),
            (MapKind::Periodic, Some(3), Kind::Periodic(3)),
            (MapKind::Undecided, Some(1), Kind::Periodic(1)),
            (MapKind::Undecided, None, Kind::Undecided),
            (MapKind::Chaos, None, Kind::Undecided),
            (MapKind::Diverges, None, Kind::Diverges),
        ] {
            (cell.kind, cell.period) = (kind_in_map, period);
            assert_eq!(kind(&cell), expected);
        }
    }
}
