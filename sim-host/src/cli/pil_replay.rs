//! `sim-host pil --replay`: the ECU's program with the inputs of a recorded run or a bus log.

use super::outcome::Outcome;
use anyhow::Context;
use dynamics::words::{counted, counted_as};
use files::{input, output};
use pil::can_log::{Reader, Row, Summary, replay};
use pil::comparison::{Depth, compare};
use pil::recording::{MAGIC, Recording};
use shared_model::Scenario;
use shared_model::gate::Faults;
use std::fs::File;
use std::io::{BufReader, Chain, Cursor, Read};
use std::path::Path;

/// Changes of mode that are listed on the terminal.
const MAX_LISTED: usize = 20;

/// A file to be replayed, from its beginning.
pub struct Input {
    /// Whether it is a recorded run; else it is taken for a bus log.
    pub is_recording: bool,
    bytes: Chain<Cursor<Vec<u8>>, File>,
}

/// Opens a file, once: it may be a pipe.
pub fn open(file: &Path) -> anyhow::Result<Input> {
    let unreadable = || format!("cannot read {}", file.display());
    let mut opened = File::open(file).with_context(unreadable)?;
    let mut start = Vec::new();
    (&mut opened)
        .take(MAGIC.len() as u64)
        .read_to_end(&mut start)
        .with_context(unreadable)?;
    Ok(Input {
        is_recording: start == MAGIC,
        bytes: Cursor::new(start).chain(opened),
    })
}

/// Replays a recorded run, and compares the duties and frames.
pub fn recording(file: &Path, input: Input) -> anyhow::Result<Outcome> {
    let name = file.display();
    let bytes = input::read_rest(input.bytes, input::RECORDING_BYTES)
        .with_context(|| format!("cannot read {name}"))?;
    let recording = Recording::read(&bytes).with_context(|| name.to_string())?;
    let replayed = recording.replay().with_context(|| name.to_string())?;
    let comparison = compare(&recording.exchanges, &replayed, Depth::Bytes);
    say!(
        "{} and {} replayed: {}",
        counted_as(comparison.duties, "duty", "duties"),
        counted(comparison.frames, "actuator frame"),
        comparison
    );
    Ok(if comparison.is_equal() {
        Outcome::Success
    } else {
        Outcome::Failed
    })
}

/// Feeds the ECU's program with a bus log, and lists the changes of its mode; with `out`, every
/// control tick as CSV.
pub fn log(
    file: &Path,
    input: Input,
    ecu: &Scenario<f32>,
    out: Option<&Path>,
    force: bool,
) -> anyhow::Result<Outcome> {
    let mut reader = Reader::new(BufReader::new(input.bytes));
    let mut modes = Modes::default();
    let mut replayed = None;
    let mut run = |on_row: &mut dyn FnMut(&Row) -> bool| {
        let result = replay(ecu, &mut reader, &mut |row| {
            modes.see(row);
            on_row(row)
        });
        replayed.insert(result).is_ok()
    };
    let written = match out {
        None => {
            run(&mut |_| true);
            Ok(())
        }
        Some(path) => output::write(path, force, |to| {
            let mut csv = csv::Writer::from_writer(to);
            let mut failure = None;
            run(&mut |row| {
                failure = csv.serialize(row).err();
                failure.is_none()
            })
            .then_some(())
            .ok_or("the log cannot be replayed")?;
            failure.map_or(Ok(()), Err)?;
            Ok(csv.flush()?)
        }),
    };
    // The log's own fault is the reason, not that nothing was written.
    if let Some(Err(error)) = replayed {
        let name = file.display();
        return Err(error).with_context(|| {
            format!("{name} is not a recording, and cannot be read as a bus log")
        });
    }
    written?;
    if let Some(Ok(summary)) = replayed {
        show(&summary, &modes);
    }
    Ok(Outcome::Success)
}

/// The changes of the ECU's mode and faults.
#[derive(Default)]
struct Modes {
    last: Option<(&'static str, u32)>,
    changes: Vec<(f64, &'static str, u32)>,
    unlisted: usize,
}

impl Modes {
    fn see(&mut self, row: &Row) {
        let now = (row.mode, row.faults);
        if self.last.replace(now) == Some(now) {
            return;
        }
        if self.changes.len() < MAX_LISTED {
            self.changes.push((row.time_s, row.mode, row.faults));
        } else {
            self.unlisted += 1;
        }
    }
}

fn show(summary: &Summary, modes: &Modes) {
    say!(
        "{}, {}: {} damaged, {} replaced by another in the same tick; {} of other kinds",
        counted(summary.ticks, "control tick"),
        counted(summary.sensor_frames, "sensor frame"),
        summary.damaged,
        summary.replaced,
        counted(summary.foreign, "frame")
    );
    if summary.recorded > 0 {
        say!(
            "{} of the log's {} are sent again, bit for bit",
            summary.equal,
            counted(summary.recorded, "actuator frame")
        );
    }
    for (time_s, mode, faults) in &modes.changes {
        let faults: Vec<&str> = Faults::from_bits(*faults)
            .iter()
            .map(|fault| fault.name())
            .collect();
        let faults = match faults.is_empty() {
            true => String::new(),
            false => format!(": {}", faults.join(", ")),
        };
        say!("{time_s:10.3} s {mode}{faults}");
    }
    if modes.unlisted > 0 {
        say!("and {} more", counted(modes.unlisted, "change"));
    }
}
