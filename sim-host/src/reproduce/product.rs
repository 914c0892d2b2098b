//! A piece as it is kept in the folder.

use super::material::{Judgement, Material};
use files::input;
use files::output::{make_folder, write_json, write_text};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A piece as it is kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Product {
    /// Identifies its inputs: with other inputs it is computed again.
    fingerprint: String,
    /// CRC-32 of all other fields and of the figures' files: with another one it is computed
    /// again.
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

impl Product {
    /// The kept piece of that name, if it has the fingerprint and its files are intact.
    pub fn read(folder: &Path, name: &str, fingerprint: &str) -> Option<Self> {
        let text = input::read_text(&record(folder, name), input::TEXT_BYTES).ok()?;
        let product: Self = serde_json::from_str(&text).ok()?;
        let intact = || {
            product
                .checksum(folder)
                .is_ok_and(|sum| sum == product.crc32)
        };
        (product.fingerprint == fingerprint && intact()).then_some(product)
    }

    /// Writes the figures and their data, then the record.
    pub fn write(
        folder: &Path,
        (name, title): (&str, &str),
        fingerprint: String,
        material: Material,
    ) -> anyhow::Result<Self> {
        let figures = folder.join("figures");
        make_folder(&figures)?;
        for drawing in &material.drawings {
            let at = |ending| figures.join(format!("{}.{ending}", drawing.name));
            write_text(&at("svg"), &drawing.chart.svg(), true)?;
            write_text(&at("csv"), &drawing.csv, true)?;
        }
        let mut product = Self {
            fingerprint,
            crc32: String::new(),
            title: title.into(),
            figures: material
                .drawings
                .into_iter()
                .map(|drawing| (drawing.name, drawing.caption))
                .collect(),
            judgements: material.judgements,
            findings: material.findings,
        };
        product.crc32 = product.checksum(folder)?;
        write_json(&record(folder, name), &product, true)?;
        Ok(product)
    }

    /// CRC-32 of all other fields and of the figures' files.
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

fn record(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("figures/{name}.json"))
}
