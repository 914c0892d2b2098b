//! Which amplitude for which wheel speed.

use super::cells::{Class, Column};

/// Amplitudes are rounded to a multiple of this, V.
pub(super) const RESOLUTION_V: f64 = 1e-4;

/// What an entry of the schedule was chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// Without dither the motion is of period one or at rest.
    Undithered,
    /// The amplitude gives period one.
    PeriodOne,
    /// No amplitude gives period one; this one brings the motion to rest.
    Rest,
    /// No amplitude gives either; the dither is off.
    Nothing,
}

/// A range of amplitudes, V; its ends were looked at and belong to it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Range {
    /// Its lower end.
    pub from_v: f64,
    /// Its upper end.
    pub to_v: f64,
}

impl Range {
    fn width_v(&self) -> f64 {
        self.to_v - self.from_v
    }

    fn common(&self, other: &Self) -> Self {
        Self {
            from_v: self.from_v.max(other.from_v),
            to_v: self.to_v.min(other.to_v),
        }
    }
}

/// An entry of the schedule.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Entry {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Amplitude W, V.
    pub amplitude_v: f64,
    /// What it was chosen for.
    pub choice: Choice,
    /// The range of W that it was chosen from; none without dither.
    pub range: Option<Range>,
    /// Without dither, the paper's attractor or another motion coexists with an equilibrium here.
    pub coexist_undithered: bool,
}

/// The entry of each column. `margin` is the share of the range by which an amplitude lies above
/// the range's lower end, and it keeps at least `room_v` from both ends.
///
/// A range is good at its column's speed and at the neighbouring ones, because the table is used in
/// steps: the amplitude of a speed also acts anywhere up to its neighbours. There, rest is good
/// too.
pub(super) fn choose(columns: &[Column], margin: f64, room_v: f64) -> Vec<Entry> {
    let entry = |k: usize| {
        let neighbours = &columns[k.saturating_sub(1)..columns.len().min(k + 2)];
        entry(&columns[k], neighbours, margin, room_v)
    };
    (0..columns.len()).map(entry).collect()
}

fn entry(column: &Column, neighbours: &[Column], margin: f64, room_v: f64) -> Entry {
    let undithered = &column.cells[0];
    let none = Entry {
        wheel_speed_rpm: column.wheel_speed_rpm,
        amplitude_v: 0.0,
        choice: Choice::Undithered,
        range: None,
        coexist_undithered: undithered.coexist(),
    };
    if undithered.class().is_calm() {
        return none;
    }
    for (choice, class) in [
        (Choice::PeriodOne, Class::PeriodOne),
        (Choice::Rest, Class::Rest),
    ] {
        let own = ranges(column, |other| other == class);
        let calm = neighbours.iter().map(|n| ranges(n, Class::is_calm));
        let common = calm.fold(own, |one, other| intersection(&one, &other));
        let wide = common.into_iter().find(|r| r.width_v() >= 2.0 * room_v);
        if let Some(range) = wide {
            let wanted_v = range.from_v + margin * range.width_v();
            let amplitude_v = wanted_v.clamp(range.from_v + room_v, range.to_v - room_v);
            return Entry {
                amplitude_v: rounded(amplitude_v),
                choice,
                range: Some(range),
                ..none
            };
        }
    }
    Entry {
        choice: Choice::Nothing,
        ..none
    }
}

/// To the resolution; divided, so that the decimal number comes out as it is written.
fn rounded(amplitude_v: f64) -> f64 {
    (amplitude_v / RESOLUTION_V).round() / (1.0 / RESOLUTION_V).round()
}

/// The ranges of W in which all cells are of an accepted class, ascending.
fn ranges(column: &Column, accept: impl Fn(Class) -> bool) -> Vec<Range> {
    let alike = column
        .cells
        .chunk_by(|a, b| accept(a.class()) == accept(b.class()));
    let accepted = alike.filter(|cells| accept(cells[0].class()));
    accepted
        .map(|cells| Range {
            from_v: cells[0].amplitude_v,
            to_v: cells[cells.len() - 1].amplitude_v,
        })
        .collect()
}

/// What two ascending lists of ranges have in common, ascending.
fn intersection(one: &[Range], other: &[Range]) -> Vec<Range> {
    let pairs = one.iter().flat_map(|a| other.iter().map(|b| a.common(b)));
    pairs.filter(|range| range.width_v() >= 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::Kind;
    use crate::schedule::cells::Cell;

    const REST: Kind = Kind::Equilibrium;
    const ONE: Kind = Kind::Periodic(1);
    const TWO: Kind = Kind::Periodic(2);

    /// A column with cells 10 mV apart, from both starts the same.
    fn column(wheel_speed_rpm: f64, kinds: &[Kind]) -> Column {
        let cell = |(k, &kind): (usize, &Kind)| Cell {
            wheel_speed_rpm,
            amplitude_v: k as f64 * 0.01,
            given: kind,
            mirrored: kind,
        };
        Column {
            wheel_speed_rpm,
            cells: kinds.iter().enumerate().map(cell).collect(),
        }
    }

    #[test]
    fn the_first_range_that_is_good_at_the_neighbours_too() {
        let columns = [
            column(1.0, &[ONE, TWO, ONE, ONE, ONE, ONE, ONE, REST]),
            column(2.0, &[TWO, ONE, TWO, ONE, ONE, ONE, ONE, ONE]),
            column(3.0, &[TWO, TWO, TWO, ONE, ONE, ONE, REST, TWO]),
        ];
        let entries = choose(&columns, 0.25, 0.004);
        assert_eq!(entries[0].choice, Choice::Undithered);
        assert_eq!(entries[0].amplitude_v, 0.0);
        // 0.03 to 0.06 V: the window at 0.01 V is none at the neighbours, 0.07 V is bad at the last
        // speed.
        assert_eq!(entries[1].choice, Choice::PeriodOne);
        assert_eq!(entries[1].amplitude_v, 0.0375);
        // 0.03 to 0.05 V, where the last speed itself has period one.
        assert_eq!(entries[2].amplitude_v, 0.035);
        let range = entries[2].range.unwrap();
        assert_eq!((range.from_v, range.to_v), (0.03, 0.05));
    }

    #[test]
    fn the_amplitude_keeps_its_room_at_both_ends() {
        let columns = [column(1.0, &[TWO, ONE, ONE, ONE, TWO])];
        for (margin, amplitude_v) in [(0.0, 0.014), (0.5, 0.02), (1.0, 0.026)] {
            assert_eq!(choose(&columns, margin, 0.004)[0].amplitude_v, amplitude_v);
        }
        // A range of 20 mV has no room of more than 10 mV.
        assert_eq!(choose(&columns, 0.5, 0.011)[0].choice, Choice::Nothing);
    }

    #[test]
    fn rest_where_there_is_no_period_one_and_off_where_nothing_helps() {
        let columns = [column(1.0, &[TWO, TWO, REST, REST, REST])];
        let entry = choose(&columns, 0.5, 0.004)[0];
        assert_eq!((entry.choice, entry.amplitude_v), (Choice::Rest, 0.03));
        let columns = [column(1.0, &[TWO; 5])];
        let entry = choose(&columns, 0.5, 0.004)[0];
        assert_eq!((entry.choice, entry.amplitude_v), (Choice::Nothing, 0.0));
        assert_eq!(entry.range, None);
    }

    #[test]
    fn the_worse_start_counts() {
        let mut bad = column(1.0, &[TWO, ONE, ONE, ONE, REST]);
        bad.cells[1].mirrored = Kind::Undecided;
        bad.cells[3].mirrored = REST;
        let entry = choose(&[bad], 0.0, 0.001)[0];
        let range = entry.range.unwrap();
        assert_eq!((range.from_v, range.to_v), (0.02, 0.03));
        assert!(!entry.coexist_undithered);
    }
}
