//! The archive of a unit: a zip file, the same bytes for the same input.

use crate::description;
use crate::model::Model;
use dynamics::config::to_toml;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use rawzip::time::UtcDateTime;
use rawzip::{CompressionMethod, ZipArchiveWriter};
use shared_model::Scenario;
use std::io::{self, Write};

/// The configuration within the folder of resources.
pub(crate) const CONFIGURATION: &str = "configuration.toml";
/// The folder of the binary: Linux on x86-64.
const BINARIES: &str = "binaries/linux64";

/// The earliest time that a zip archive can hold, 1980-01-01: the files of a unit have no other.
const EARLIEST_S: i64 = 315_532_800;

/// File name of the shared library that is the binary of both units.
pub const LIBRARY: &str = "libdithersteer_fmu.so";

/// Whether this is the content of the file [`LIBRARY`] of this version.
pub fn is_library(content: &[u8]) -> bool {
    let has = |text: &[u8]| content.windows(text.len()).any(|window| window == text);
    has(b"fmi2DoStep") && has(description::TOOL.as_bytes())
}

/// Writes the archive of a unit. `library` is the content of the file [`LIBRARY`] of this version.
///
/// # Errors
/// If `writer` fails.
pub fn write(
    model: Model,
    scenario: &Scenario<f64>,
    library: &[u8],
    writer: &mut dyn Write,
) -> io::Result<()> {
    let binary = format!("{BINARIES}/{}.so", model.identifier());
    let configuration = format!("resources/{CONFIGURATION}");
    let text = description::text(model, scenario);
    let mut archive = ZipArchiveWriter::new(writer);
    for (name, content, permissions) in [
        ("modelDescription.xml", text.as_bytes(), 0o644),
        (binary.as_str(), library, 0o755),
        (configuration.as_str(), to_toml(scenario).as_bytes(), 0o644),
    ] {
        add(&mut archive, name, content, permissions).map_err(io::Error::other)?;
    }
    archive.finish().map_err(io::Error::other)?;
    Ok(())
}

fn add(
    archive: &mut ZipArchiveWriter<&mut dyn Write>,
    name: &str,
    content: &[u8],
    permissions: u32,
) -> Result<(), rawzip::Error> {
    let file = archive.new_file(name).unix_permissions(permissions);
    let file = file.last_modified(UtcDateTime::from_unix(EARLIEST_S));
    let (mut entry, config) = file
        .compression_method(CompressionMethod::DEFLATE)
        .start()?;
    let mut data = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
    data.write_all(content)?;
    let (encoder, descriptor) = data.finish()?;
    encoder.finish()?;
    entry.finish(descriptor)?;
    Ok(())
}
