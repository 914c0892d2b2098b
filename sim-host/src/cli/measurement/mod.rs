//! Measurement files in MDF 4: a trajectory of the model, or a drive with the ECU in the loop.

mod channels;
pub mod drive;
pub mod trajectory;

use files::output;
use mdf4::{File, Group};
use std::path::Path;

/// Writes the groups as a measurement file.
fn write(path: &Path, force: bool, comment: String, groups: Vec<Group>) -> anyhow::Result<()> {
    let file = File {
        program: env!("CARGO_PKG_NAME"),
        version: env!("CARGO_PKG_VERSION"),
        comment,
        groups,
    };
    Ok(output::write(path, force, |to| Ok(file.write(to)?))?)
}
