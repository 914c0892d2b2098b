//! `sim-host firmware configure`: the configuration in the ECU's flash.

use crate::cli::emulator::open_image;
use crate::cli::options::load_file;
use crate::cli::outcome::Outcome;
use crate::cli::output::{check, named};
use anyhow::{Context, ensure};
use dynamics::config::{over_preset, to_commented_toml, validate};
use dynamics::words::counted;
use files::output;
use image::Image;
use qemu::configured::{configured, place};
use shared_model::Scenario;
use shared_model::configuration::{ERASED, decode, load};
use shared_model::ecu::Ecu;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Write a configuration into the flash of the ECU's image, or print the one that is there.
///
/// The image is not rebuilt. The flash has two blocks, each with a checksum: the application's
/// parameters, and the gate's limits. A [gate] table in the file is refused without --calibrate, so
/// that a change of the application cannot change a limit.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host config > vehicle.toml
  sim-host firmware configure --config vehicle.toml --out ecu-vehicle.elf \\
      target/thumbv7em-none-eabihf/firmware/ecu
  sim-host firmware configure --show ecu-vehicle.elf
  sim-host firmware configure --config vehicle.toml --calibrate \\
      --out ecu.hex ecu-vehicle.elf

The format follows from the name of the output: .bin (from the first address, gaps as erased flash), .hex (Intel HEX), else ELF.
Without --config the parameters are the preset's. The start time of the dither is 0 in the image: that of the paper belongs to its
experiment.")]
pub struct Arguments {
    /// TOML file with parameters that replace the preset's
    #[arg(long, value_name = "FILE", conflicts_with = "show")]
    config: Option<PathBuf>,
    /// Write the gate's limits of --config too
    #[arg(long, requires = "config")]
    calibrate: bool,
    /// Board of the image
    #[arg(long, value_name = "NAME", value_parser = boards(), default_value = "mps2")]
    board: String,
    /// Print the configuration of the image as TOML instead
    #[arg(long)]
    show: bool,
    /// Image to write
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present = "show",
        conflicts_with = "show"
    )]
    out: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
    /// The ECU's image (ELF)
    image: PathBuf,
}

/// The boards, and the clock of their PWM timers, Hz.
const BOARDS: [(&str, f64); 4] = [
    ("mps2", 25e6),
    ("netduinoplus2", 16e6),
    ("nrf52840dk", 16e6),
    ("nucleog474re", 16e6),
];

fn boards() -> clap::builder::PossibleValuesParser {
    BOARDS.map(|(name, _)| name).into()
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let image = open_image(&arguments.image)?;
    let place = place(&image).with_context(|| {
        format!(
            "{} has no configuration section: give the image `ecu`, built by `cargo xtask firmware`",
            arguments.image.display()
        )
    })?;
    let flash = &image.bytes[place];
    if arguments.show {
        return show(arguments, flash);
    }
    let out = arguments.out.as_deref().context("--out is missing")?;
    let inputs = [("the image", arguments.image.as_path())];
    let config = named("--config", &arguments.config);
    check(
        inputs.into_iter().chain(config),
        [Some(("--out", out))],
        arguments.force,
    )?;
    let scenario = arguments.scenario(flash)?;
    let configured = configured(&image, &scenario, &arguments.board).context("it has the place")?;
    let bytes = content(&configured, out);
    output::write(out, arguments.force, |to| Ok(to.write_all(&bytes)?))?;
    say!(
        "{}: {} for the board {}",
        out.display(),
        counted(bytes.len(), "byte"),
        arguments.board
    );
    Ok(Outcome::Success)
}

impl Arguments {
    fn timer_clock_hz(&self) -> f64 {
        let mut boards = BOARDS.into_iter();
        let board = boards.find(|(name, _)| *name == self.board);
        board.map_or(f64::NAN, |(_, clock_hz)| clock_hz)
    }

    /// The scenario to write; the gate's limits are those of the flash, or the preset's where it has
    /// none, unless they are calibrated.
    fn scenario(&self, flash: &[u8]) -> anyhow::Result<Scenario<f32>> {
        let mut scenario = match &self.config {
            Some(file) => load_file(file, None)?,
            None => over_preset(toml::Table::new(), None)?,
        };
        if scenario.dither.start_time_s != 0.0 {
            eprintln!(
                "note: dither.start_time_s = {} belongs to the experiment; the image gets 0, and its dither starts as soon as the speed demands it",
                scenario.dither.start_time_s
            );
            scenario.dither.start_time_s = 0.0;
        }
        scenario.servo.timer_clock_hz = self.timer_clock_hz();
        let mut own = scenario.map(&|value| value as f32);
        if !self.calibrate {
            let present = decode(flash, &self.board).unwrap_or(Scenario::reconstruction());
            ensure!(
                own.gate == present.gate || own.gate == Scenario::reconstruction().gate,
                "{}: its [gate] differs from the image's: give --calibrate to write limits, or leave the table out",
                self.config
                    .as_deref()
                    .unwrap_or(Path::new("--config"))
                    .display()
            );
            own.gate = present.gate;
        }
        validate(&own.map(&f64::from))?;
        // The ECU's own check: its gate must pass its controller's commands.
        Ecu::new(&own, 1)?;
        Ok(own)
    }
}

fn show(arguments: &Arguments, flash: &[u8]) -> anyhow::Result<Outcome> {
    let name = arguments.image.display();
    let clock_hz = arguments.timer_clock_hz() as u32;
    match load(flash, &arguments.board, clock_hz) {
        Ok(scenario) => {
            say!(
                "{}",
                to_commented_toml(&scenario.map(&f64::from)).trim_end()
            );
            Ok(Outcome::Success)
        }
        Err(error) => {
            say!("{name}: configuration refused: {}", error.reason());
            Ok(Outcome::Failed)
        }
    }
}

/// The image in the format that its name asks for.
fn content(image: &Image, out: &Path) -> Vec<u8> {
    match out.extension().and_then(|extension| extension.to_str()) {
        Some("bin") => binary(&image.flash()),
        Some("hex") => intel_hex(&image.flash()).into_bytes(),
        _ => image.bytes.clone(),
    }
}

/// The flash from its first to its last byte.
fn binary(parts: &[(u32, &[u8])]) -> Vec<u8> {
    let first = parts.first().map_or(0, |(address, _)| *address);
    let mut bytes = Vec::new();
    for (address, part) in parts {
        let start = (address - first) as usize;
        if bytes.len() < start {
            bytes.resize(start, ERASED);
        }
        bytes.truncate(start);
        bytes.extend_from_slice(part);
    }
    bytes
}

/// Data records of 16 bytes, each with its upper address before it where that changes, and the end.
fn intel_hex(parts: &[(u32, &[u8])]) -> String {
    const RECORD: usize = 16;
    let mut text = String::new();
    let mut upper = None;
    for (start, part) in parts {
        let mut address = *start;
        let mut rest = *part;
        while !rest.is_empty() {
            // A record does not cross a border of 64 KiB.
            let to_border = 0x1_0000 - (address as usize & 0xFFFF);
            let length = RECORD.min(rest.len()).min(to_border);
            let (record, after) = rest.split_at(length);
            if upper != Some(address >> 16) {
                upper = Some(address >> 16);
                push_record(&mut text, 0, 4, &((address >> 16) as u16).to_be_bytes());
            }
            push_record(&mut text, address as u16, 0, record);
            address = address.wrapping_add(length as u32);
            rest = after;
        }
    }
    push_record(&mut text, 0, 1, &[]);
    text
}

fn push_record(text: &mut String, address: u16, kind: u8, data: &[u8]) {
    let [high, low] = address.to_be_bytes();
    let head = [data.len() as u8, high, low, kind];
    let bytes = || head.iter().chain(data);
    let sum = bytes().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    text.push(':');
    for byte in bytes().chain(&[sum.wrapping_neg()]) {
        text.push_str(&format!("{byte:02X}"));
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intel_hex_as_in_its_specification() {
        // The example record of the format's specification, revision A, 1988.
        let data = [
            0x21, 0x46, 0x01, 0x36, 0x01, 0x21, 0x47, 0x01, 0x36, 0x00, 0x7E, 0xFE, 0x09, 0xD2,
            0x19, 0x01,
        ];
        let text = intel_hex(&[(0x0100, &data)]);
        assert_eq!(
            text,
            ":020000040000FA\n:10010000214601360121470136007EFE09D2190140\n:00000001FF\n"
        );
        let border = intel_hex(&[(0x0800_FFFC, &[0xFF; 8])]);
        assert_eq!(
            border.lines().count(),
            5,
            "two addresses, two records, the end"
        );
    }

    #[test]
    fn gaps_of_a_binary_are_erased_flash() {
        assert_eq!(
            binary(&[(0x100, &[1, 2]), (0x104, &[3])]),
            [1, 2, 0xFF, 0xFF, 3]
        );
    }
}
