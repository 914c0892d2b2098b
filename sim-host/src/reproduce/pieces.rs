//! The pieces of the reproduction.

use super::job::{Options, Quality};
use super::material::{Made, Material, Named};
use super::product::Product;
use super::{beyond, characteristics, errata, figures, measures, sensitivity, sweeps};
use dynamics::observe::is_supported;
use dynamics::sweep::RunControl;
use std::path::Path;

/// A piece of the reproduction.
pub struct Piece {
    /// Name for files.
    pub name: String,
    /// Name for people.
    pub title: String,
    /// Ids of the paper's claims that its figures show.
    pub claims: &'static [&'static str],
    /// Its share of the time.
    pub weight: f64,
    /// The preset or vehicle.
    pub scenario: Named,
    /// Computes its contents.
    pub make: fn(&Named, Quality, RunControl) -> Made,
}

/// A part that is computed for each scenario.
struct Part {
    name: &'static str,
    title: &'static str,
    claims: &'static [&'static str],
    /// Its share of the time, measured in seconds on two cores at full quality: with the engine,
    /// and with the fixed step.
    weights: [f64; 2],
    make: fn(&Named, Quality, RunControl) -> Made,
}

const fn part(
    name: &'static str,
    title: &'static str,
    claims: &'static [&'static str],
    weights: [f64; 2],
    make: fn(&Named, Quality, RunControl) -> Made,
) -> Part {
    Part {
        name,
        title,
        claims,
        weights,
        make,
    }
}

/// Parts of the first scenario only: the compared readings include the other preset's.
const ONCE: [Part; 2] = [
    part(
        "sensitivity",
        "Sensitivity of the edges",
        &[],
        [2.3, 2.3],
        sensitivity::sensitivity,
    ),
    part(
        "beyond",
        "Beyond the paper: delayed feedback, within the motor's torque",
        &[],
        [50.0, 50.0],
        beyond::beyond,
    ),
];

const PARTS: [Part; 10] = [
    part(
        "characteristics",
        "Figures 2, 9 to 11 and 14 to 16: tyres and effective nonlinearities; realisability",
        &[],
        [0.1, 0.1],
        characteristics::characteristics,
    ),
    part(
        "speed",
        "Figures 6 and 7: sweep over the speed",
        &["C1", "C2", "C3", "C4"],
        [0.3, 12.8],
        sweeps::speed,
    ),
    part(
        "square",
        "Figure 8: sweep over the square dither's amplitude",
        &["C5", "C6"],
        [0.1, 6.6],
        sweeps::square,
    ),
    part(
        "sine",
        "Figure 13: sweep over the sine dither's amplitude",
        &["C7", "C8"],
        [0.2, 9.1],
        sweeps::sine,
    ),
    part(
        "suppression",
        "Figures 12 and 17: chaos suppressed",
        &["C6", "C8"],
        [0.1, 0.1],
        figures::suppression,
    ),
    part(
        "exponents",
        "All Lyapunov exponents, by three methods",
        &[],
        [8.5, 10.9],
        measures::exponents,
    ),
    part(
        "lengths",
        "Lengths of transient and run",
        &[],
        [0.5, 8.4],
        measures::lengths,
    ),
    part(
        "motion",
        "Poincar\u{e9} section and frequency spectrum",
        &[],
        [0.2, 0.3],
        measures::motion,
    ),
    part(
        "averaging",
        "Averaged system against the true signal",
        &[],
        [5.5, 5.0],
        figures::averaging,
    ),
    part(
        "errata",
        "Errors of the print",
        &[],
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
                claims: part.claims,
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
    /// The product of an earlier run with the same parameters, if its files are intact.
    pub fn kept(&self, folder: &Path, options: &Options) -> Option<Product> {
        Product::read(folder, &self.name, &self.fingerprint(options))
    }

    /// Writes the piece.
    pub fn write(
        &self,
        folder: &Path,
        options: &Options,
        material: Material,
    ) -> anyhow::Result<Product> {
        let fingerprint = self.fingerprint(options);
        Product::write(folder, (&self.name, &self.title), fingerprint, material)
    }

    /// Identifies the inputs of the piece.
    fn fingerprint(&self, options: &Options) -> String {
        let parameters = dynamics::config::to_toml(&self.scenario.scenario);
        format!(
            "{} {:?}\n{parameters}",
            env!("CARGO_PKG_VERSION"),
            options.quality
        )
    }
}
