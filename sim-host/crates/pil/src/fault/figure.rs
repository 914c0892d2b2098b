//! Matrix of faults by manoeuvres: shares of the verdicts and worst latency.

use super::judge::Verdict;
use super::row::Row;
use plot::canvas::{Anchor, Area, Colour, TextStyle};
use plot::figure::{Sample, figure};
use plot::style::{FAINT_INK, INK, TEXT_FONT, TICK_FONT, WIDTH, text_width};
use plot::text::wrap;

/// Margins of the matrix: left, top and right.
const LEFT: i32 = 450;
const TOP: i32 = 190;
const RIGHT: i32 = 16;
const CELL_HEIGHT: i32 = 36;
const GAP: i32 = 3;
const NUMBER_WIDTH: i32 = 24;
/// Font size of a column's heading: the longest word of a manoeuvre's name fits the column.
const HEAD_FONT: u32 = 20;
const LINE_STEP: i32 = 28;

/// Verdicts from dark to light, and the colour of text on each shade.
const SHADES: [(Verdict, &str, Colour, Colour); 4] = [
    (
        Verdict::Detected,
        "detected: safe state, restart or neutral",
        Colour(0x24, 0x44, 0x77),
        WHITE,
    ),
    (
        Verdict::Tolerated,
        "detected and tolerated",
        Colour(0x74, 0x93, 0xbd),
        BLACK,
    ),
    (
        Verdict::Undetected,
        "undetected, with waiver",
        Colour(0xf0, 0xb8, 0x5a),
        BLACK,
    ),
    (
        Verdict::NoEffect,
        "no effect",
        Colour(0xe6, 0xe8, 0xe6),
        BLACK,
    ),
];
const WHITE: Colour = Colour(0xff, 0xff, 0xff);
const BLACK: Colour = Colour(0, 0, 0);
/// Undetected and without waiver.
const FAILURE: Colour = Colour(0xc0, 0x10, 0x10);

/// The matrix of all kinds of faults by all manoeuvres, as an SVG document.
pub fn draw(rows: &[Row]) -> String {
    let kinds = distinct(rows.iter().map(|row| row.kind));
    let manoeuvres = distinct(rows.iter().map(|row| row.manoeuvre.as_str()));
    let heading = "Verdicts by fault and manoeuvre; number: worst latency, ticks of 1 ms";
    let height = TOP + CELL_HEIGHT * kinds.len() as i32 + RIGHT;
    let mut legend: Vec<_> = SHADES
        .iter()
        .map(|(_, name, shade, _)| ((*name).to_owned(), Sample::Shade(*shade)))
        .collect();
    if rows.iter().any(Row::is_failure) {
        legend.push(("undetected, without waiver".into(), Sample::Shade(FAILURE)));
    }
    figure(heading, &legend, height, |area| {
        let width = column_width(manoeuvres.len());
        names(area, &kinds, &manoeuvres, width);
        for (k, kind) in kinds.iter().enumerate() {
            for (m, manoeuvre) in manoeuvres.iter().enumerate() {
                let is_here = |row: &&Row| row.kind == *kind && row.manoeuvre == *manoeuvre;
                let here: Vec<&Row> = rows.iter().filter(is_here).collect();
                let corner = (LEFT + width * m as i32, TOP + CELL_HEIGHT * k as i32);
                cell(area, corner, width, &here);
            }
        }
    })
}

fn column_width(columns: usize) -> i32 {
    (WIDTH - LEFT - RIGHT) / columns.max(1) as i32
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut distinct = Vec::new();
    for name in names {
        if !distinct.contains(&name) {
            distinct.push(name);
        }
    }
    distinct
}

fn names(area: &Area, kinds: &[&str], manoeuvres: &[&str], width: i32) {
    let right = TextStyle::new(TICK_FONT, INK).anchored(Anchor::End);
    let middle = TextStyle::new(HEAD_FONT, INK).anchored(Anchor::Middle);
    for (k, kind) in kinds.iter().enumerate() {
        let y = TOP + CELL_HEIGHT * k as i32 + CELL_HEIGHT / 2;
        area.text(kind, (LEFT - 12, y), right);
    }
    for (m, manoeuvre) in manoeuvres.iter().enumerate() {
        let lines = head(manoeuvre, width);
        let x = LEFT + width * m as i32 + width / 2;
        for (n, line) in lines.iter().rev().enumerate() {
            let y = TOP - LINE_STEP / 2 - 6 - LINE_STEP * n as i32;
            area.text(line, (x, y), middle);
        }
    }
    let axes = TextStyle::new(TEXT_FONT, FAINT_INK);
    area.text("manoeuvre \u{2192}", (LEFT - 190, TOP - 50), axes);
    area.text("kind of fault \u{2193}", (LEFT - 190, TOP - 20), axes);
}

/// A manoeuvre's name, wrapped to the width of its column.
fn head(manoeuvre: &str, width: i32) -> Vec<String> {
    let letters = "abcdefghijklmnopqrstuvwxyz";
    let fitting = width * letters.len() as i32 / text_width(letters, HEAD_FONT);
    wrap(manoeuvre, fitting as usize)
}

/// Shares of the verdicts from left to right, with the worst latency on the first.
fn cell(area: &Area, (left, top): (i32, i32), width: i32, rows: &[&Row]) {
    if rows.is_empty() {
        return;
    }
    let usable = f64::from(width - GAP);
    let place = |count: usize| left + (usable * count as f64 / rows.len() as f64).round() as i32;
    let mut before = 0;
    let failures = rows.iter().filter(|row| row.is_failure()).count();
    let mut ink = None;
    let listed = SHADES.iter().map(|(verdict, _, shade, on_it)| {
        let is_it = |row: &&&Row| row.verdict == *verdict && !row.is_failure();
        (rows.iter().filter(is_it).count(), *shade, *on_it)
    });
    for (count, shade, on_it) in [(failures, FAILURE, WHITE)].into_iter().chain(listed) {
        if count == 0 {
            continue;
        }
        // The colour for the shade under most of the number.
        if place(before + count) > left + NUMBER_WIDTH {
            ink.get_or_insert(on_it);
        }
        let corners = [
            (place(before), top),
            (place(before + count), top + CELL_HEIGHT - GAP),
        ];
        area.rectangle(corners, shade);
        before += count;
    }
    if let Some(latency) = rows.iter().filter_map(|row| row.latency_ticks).max() {
        let style = TextStyle::new(TICK_FONT, ink.unwrap_or(INK));
        let place = (left + 8, top + (CELL_HEIGHT - GAP) / 2);
        area.text(&latency.to_string(), place, style);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::manoeuvres;

    #[test]
    fn headings_fit_their_columns_and_words_are_not_split() {
        let manoeuvres = manoeuvres::all().unwrap();
        // The processor has an additional column.
        let width = column_width(manoeuvres.len() + 1);
        for (_, manoeuvre) in &manoeuvres {
            let lines = head(&manoeuvre.name, width);
            assert_eq!(lines.join(" "), manoeuvre.name);
            let widest = lines.iter().map(|line| text_width(line, HEAD_FONT)).max();
            assert!(widest.unwrap() <= width, "{lines:?}");
        }
    }
}
