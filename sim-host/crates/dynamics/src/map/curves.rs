//! Curves of bifurcations over a sheet of the map: period doublings and folds of the orbits in the
//! widest ranges of amplitudes with a period.

use super::cell::{Cell, Kind};
use super::plan::{Place, Plan, Sheet};
use crate::bifurcations::{self, bifurcations};
use crate::sweep::Parameter;

/// Integration tolerance: a curve is drawn, not read to many digits.
const TOLERANCE: f64 = 1e-10;
/// Transient before the orbit, s.
const TRANSIENT_S: f64 = 200.0;

/// Places of the orbits to begin with, as shares of the range of speeds.
const PLACES: [f64; 2] = [0.5, 0.85];
/// Curves nearer than this at a point, as a share of both ranges, are one.
const SAME: f64 = 0.01;

/// Points of a curve: wheel speed, rpm, and amplitude, V.
pub(super) type Curve = Vec<(f64, f64)>;

/// The curves of a sheet; none where no cell has a period.
pub(super) fn curves(plan: &Plan, sheet: &Sheet, cells: &[Cell]) -> Vec<Curve> {
    let (speeds, amplitudes) = (&plan.speeds_rpm, &sheet.amplitudes_v);
    if speeds.count < 2 || amplitudes.count < 2 {
        return Vec::new();
    }
    let spans = (speeds.to - speeds.from, amplitudes.to - amplitudes.from);
    let mut all: Vec<Curve> = Vec::new();
    for place in PLACES {
        let column = (place * speeds.count as f64) as usize;
        for curve in curves_from(plan, sheet, cells, column) {
            let Some(&(rpm, amplitude_v)) = curve.get(curve.len() / 2) else {
                continue;
            };
            let passes = |&(x, y): &(f64, f64)| {
                ((x - rpm) / spans.0).hypot((y - amplitude_v) / spans.1) < SAME
            };
            if !all.iter().flatten().any(passes) {
                all.push(curve);
            }
        }
    }
    all
}

/// The curves of the orbit in the widest range of amplitudes with a period in a column.
fn curves_from(plan: &Plan, sheet: &Sheet, cells: &[Cell], column: usize) -> Vec<Curve> {
    let (speeds, amplitudes) = (&plan.speeds_rpm, &sheet.amplitudes_v);
    let is_periodic = |row: usize| cells[column * amplitudes.count + row].kind == Kind::Periodic;
    let Some(row) = middle_of_longest(amplitudes.count, is_periodic) else {
        return Vec::new();
    };
    let scenario = plan.motion(&Place {
        wheel_speed_rpm: speeds.from + speeds.step() * column as f64,
        dither_amplitude_v: amplitudes.from + amplitudes.step() * row as f64,
        waveform: sheet.waveform,
        start: sheet.start,
    });
    let found = bifurcations(&bifurcations::Plan {
        scenario,
        parameter: Parameter::Amplitude.key().into(),
        range: (amplitudes.from, amplitudes.to),
        second: Some((Parameter::Speed.key().into(), (speeds.from, speeds.to))),
        cycles: None,
        transient_s: TRANSIENT_S,
        doublings: 0,
        tolerance: TOLERANCE,
    });
    let curves = found.map(|found| found.curves).unwrap_or_default();
    let of_orbits = curves.into_iter().filter(|curve| curve.kind != "Hopf");
    let points = |curve: bifurcations::Curve| {
        let points = curve
            .points
            .iter()
            .map(|point| (point.parameters[1], point.parameters[0]));
        points.collect()
    };
    of_orbits.map(points).collect()
}

/// The middle of the longest run of indices with a property.
fn middle_of_longest(count: usize, has: impl Fn(usize) -> bool) -> Option<usize> {
    let indices: Vec<usize> = (0..count).filter(|&k| has(k)).collect();
    let runs = indices.chunk_by(|a, b| a + 1 == *b);
    let longest = runs.max_by_key(|run| run.len())?;
    longest.get(longest.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_run_is_chosen() {
        let has = |k: usize| [1, 3, 4, 5, 9].contains(&k);
        assert_eq!(middle_of_longest(10, has), Some(4));
        assert_eq!(middle_of_longest(10, |_| false), None);
    }
}
