//! The contents of a piece: figures with their data, judgements and findings.

use crate::paper::Reproduced;
use dynamics::sweep::SweepError;
use plot::chart::Chart;
use serde::{Deserialize, Serialize};
use shared_model::Scenario;

/// A preset or vehicle with its name.
#[derive(Debug, Clone)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// Its parameters.
    pub scenario: Scenario<f64>,
}

/// A table as CSV: a header row of names with units, and rows of numbers.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Names with units.
    pub header: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<String>>,
}

/// A figure with its data.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// Name for files, for instance `figure-07`.
    pub name: String,
    /// Contents of the figure.
    pub caption: String,
    /// The figure.
    pub chart: Chart,
    /// Its data, as CSV with a header row of names with units.
    pub csv: String,
}

/// What a piece is, before it is written.
#[derive(Debug, Default)]
pub struct Material {
    /// Figures.
    pub drawings: Vec<Drawing>,
    /// Claims judged by it.
    pub judgements: Vec<Judgement>,
    /// Findings in words: a heading and a sentence each.
    pub findings: Vec<(String, String)>,
}

/// A claim with its judgement under one preset.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Judgement {
    /// The claim's number.
    pub claim: String,
    /// The preset.
    pub preset: String,
    /// What was measured, with its uncertainty.
    pub measured: String,
    /// Distance from the claim.
    pub distance: String,
    /// The verdict.
    pub verdict: Reproduced,
}

/// The contents of a piece. If one point of a sweep fails, the piece fails.
pub type Made = Result<Material, SweepError>;

impl Table {
    /// A table with the given header.
    pub fn new(header: &[&str]) -> Self {
        Self {
            header: header.iter().map(|&name| name.into()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row of numbers.
    pub fn push(&mut self, row: &[f64]) {
        self.rows.push(row.iter().map(f64::to_string).collect());
    }

    /// The table as CSV.
    pub fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in std::iter::once(&self.header).chain(&self.rows) {
            writer.write_record(row).expect(IN_MEMORY);
        }
        text(writer)
    }
}

/// Rows of named fields as CSV.
pub fn csv_of(rows: impl IntoIterator<Item = impl Serialize>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).expect(IN_MEMORY);
    }
    text(writer)
}

const IN_MEMORY: &str = "plain rows of equal length can be written to memory";

fn text(writer: csv::Writer<Vec<u8>>) -> String {
    let bytes = writer.into_inner().expect(IN_MEMORY);
    String::from_utf8(bytes).expect("numbers and names are text")
}
