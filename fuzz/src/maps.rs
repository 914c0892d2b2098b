//! Tiles of a map.

use crate::target::Target;
use dynamics::map::cell::{Cell, cells};
use dynamics::map::plan::{Grid, Plan, Sheet, Start};
use dynamics::map::tiles;
use dynamics::sweep::Timing;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::sync::LazyLock;

/// A tile.
pub const TILE: Target = Target {
    name: "tile",
    read: read_tile,
    repair: |bytes| {
        if let Ok(text) = std::str::from_utf8(bytes) {
            *bytes = tiles::resealed(text).into();
        }
    },
    seeds: || vec![tiles::text(0, &MAP.0, &MAP.1).into()],
    // Copies of the text, and a row of CSV as a cell.
    multiple: 24,
    mutations: 100_000,
};

/// A small map.
static MAP: LazyLock<(Plan, Vec<Cell>)> = LazyLock::new(|| {
    let grid = |from, to| Grid { from, to, count: 3 };
    let sheet = |start| Sheet {
        waveform: Waveform::Square,
        start,
        amplitudes_v: grid(0.0, 0.1),
    };
    let sheets = [Start::Given, Start::Mirrored].map(sheet).into();
    let timing = Timing::new(1.0, 3.0).expect("something is observed");
    let speeds = grid(1600.0, 1700.0);
    let plan = Plan::new(Scenario::reconstruction(), sheets, speeds, timing).expect("it is a plan");
    let cells = cells(&plan, &plan.places(0)).expect("it can be made");
    (plan, cells)
});

fn read_tile(bytes: &[u8]) {
    if let Some((plan, cells)) = std::str::from_utf8(bytes)
        .ok()
        .and_then(|text| tiles::parsed(text).ok())
    {
        assert!(cells.len() <= plan.cells());
        plan.differences(&MAP.0);
    }
}
