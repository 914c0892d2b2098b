//! A piece of the reproduction: made at once, written at once, kept for the next run.

use super::claims::Judgement;
use super::{
    Made, Options, Quality, characteristics, errata, figures, measures, sensitivity, sweeps,
};
use dynamics::observe::is_supported;
use dynamics::sweep::RunControl;
use files::input;
use files::output::{make_folder, write_json, write_text};
use plot::chart::Chart;
use serde::{Deserialize, Serialize};
use shared_model::Scenario;
use std::path::Path;

/// A piece that is to be made.
pub struct Piece {
    /// Name for files.
    pub name: String,
    /// Name for people.
    pub title: String,
    /// Its share of the time.
    pub weight: f64,
    /// What it is made of.
    pub scenario: Named,
    /// Makes it.
    pub make: fn(&Named, Quality, RunControl) -> Made,
}

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
    /// What is to be seen.
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

/// A piece as it is kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Product {
    /// What it was made from: another one makes it anew.
    fingerprint: String,
    /// CRC-32 of all else and of the figures' files: where a byte of them was changed, it is made anew.
    #[serde(default)]
    crc32: String,
    /// Title.
    pub title: String,
    /// Figures: name and caption.
    pub figures: Vec<(String, String)>,
    /// Claims judged by it.
    pub judgements: Vec<Judgement>,
    /// Findings.
    pub findings: Vec<(String, String)>,
}

/// A part that is made of each scenario.
struct Part {
    name: &'static str,
    title: &'static str,
    /// Its share of the time, measured in seconds on two cores at full quality: where the engine follows the motions, and where the
    /// fixed step does.
    weights: [f64; 2],
    make: fn(&Named, Quality, RunControl) -> Made,
}

const fn part(
    name: &'static str,
    title: &'static str,
    weights: [f64; 2],
    make: fn(&Named, Quality, RunControl) -> Made,
) -> Part {
    Part {
        name,
        title,
        weights,
        make,
    }
}

/// Of the first scenario only: the readings that are compared include the other preset's.
const ONCE: [Part; 1] = [part(
    "sensitivity",
    "How the edges move",
    [2.3, 2.3],
    sensitivity::sensitivity,
)];

const PARTS: [Part; 10] = [
    part(
        "characteristics",
        "Figures 2, 9 to 11 and 14 to 16: tyres and effective nonlinearities; realisability",
        [0.1, 0.1],
        characteristics::characteristics,
    ),
    part(
        "speed",
        "Figures 6 and 7: sweep over the speed",
        [0.3, 12.8],
        sweeps::speed,
    ),
    part(
        "square",
        "Figure 8: sweep over the square dither's amplitude",
        [0.1, 6.6],
        sweeps::square,
    ),
    part(
        "sine",
        "Figure 13: sweep over the sine dither's amplitude",
        [0.2, 9.1],
        sweeps::sine,
    ),
    part(
        "suppression",
        "Figures 12 and 17: chaos suppressed",
        [0.1, 0.1],
        figures::suppression,
    ),
    part(
        "exponents",
        "All Lyapunov exponents, by three methods",
        [8.5, 10.9],
        measures::exponents,
    ),
    part(
        "lengths",
        "How long is long enough",
        [0.5, 8.4],
        measures::lengths,
    ),
    part(
        "motion",
        "Poincar\u{e9} section and frequency spectrum",
        [0.2, 0.3],
        measures::motion,
    ),
    part(
        "averaging",
        "Averaging against the true signal",
        [5.5, 5.0],
        figures::averaging,
    ),
    part(
        "errata",
        "What the print gets wrong",
        [0.7, 1.1],
        errata::errata,
    ),
];

/// All pieces in the order of the page.
pub fn all(options: &Options) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (k, (name, scenario)) in options.scenarios.iter().enumerate() {
        let once = if k == 0 { ONCE.as_slice() } else { &[] };
        let by_engine = is_supported(scenario).unwrap_or(false);
        for part in PARTS.iter().chain(once) {
            pieces.push(Piece {
                name: format!("{}-{name}", part.name),
                title: format!("{} ({name})", part.title),
                weight: part.weights[usize::from(!by_engine)],
                scenario: Named {
                    name: name.clone(),
                    scenario: *scenario,
                },
                make: part.make,
            });
        }
    }
    pieces
}

impl Piece {
    /// The piece as an earlier run left it, if it was made of the same.
    pub fn kept(&self, folder: &Path, options: &Options) -> Option<Product> {
        let text = input::read_text(&self.record(folder), input::TEXT_BYTES).ok()?;
        let product: Product = serde_json::from_str(&text).ok()?;
        let same = product.fingerprint == self.fingerprint(options);
        let whole = || {
            product
                .checksum(folder)
                .is_ok_and(|sum| sum == product.crc32)
        };
        (same && whole()).then_some(product)
    }

    /// Writes the piece, its record last.
    pub fn write(
        &self,
        folder: &Path,
        options: &Options,
        material: Material,
    ) -> anyhow::Result<Product> {
        let figures = folder.join("figures");
        make_folder(&figures)?;
        for drawing in &material.drawings {
            let at = |ending| figures.join(format!("{}.{ending}", drawing.name));
            write_text(&at("svg"), &drawing.chart.svg(), true)?;
            write_text(&at("csv"), &drawing.csv, true)?;
        }
        let mut product = Product {
            fingerprint: self.fingerprint(options),
            crc32: String::new(),
            title: self.title.clone(),
            figures: material
                .drawings
                .into_iter()
                .map(|drawing| (drawing.name, drawing.caption))
                .collect(),
            judgements: material.judgements,
            findings: material.findings,
        };
        product.crc32 = product.checksum(folder)?;
        write_json(&self.record(folder), &product, true)?;
        Ok(product)
    }

    fn record(&self, folder: &Path) -> std::path::PathBuf {
        folder.join(format!("figures/{}.json", self.name))
    }

    /// What the piece is made from.
    fn fingerprint(&self, options: &Options) -> String {
        let parameters = dynamics::config::to_toml(&self.scenario.scenario);
        format!(
            "{} {:?}\n{parameters}",
            env!("CARGO_PKG_VERSION"),
            options.quality
        )
    }
}

impl Product {
    /// Of all but the check sum itself, and of the figures' files.
    fn checksum(&self, folder: &Path) -> anyhow::Result<String> {
        const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
        let own = Self {
            crc32: String::new(),
            ..self.clone()
        };
        let mut digest = CHECKSUM.digest();
        digest.update(&serde_json::to_vec(&own)?);
        for (name, _) in &self.figures {
            for ending in ["svg", "csv"] {
                let path = folder.join(format!("figures/{name}.{ending}"));
                digest.update(&input::read(&path, input::RECORDING_BYTES, |_| true)?);
            }
        }
        Ok(format!("{:08x}", digest.finalize()))
    }
}

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
