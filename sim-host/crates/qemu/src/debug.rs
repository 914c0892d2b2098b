//! A run under a debugger: the emulator with its gdb stub and its machine protocol.

use crate::emulator::Emulator;
use crate::gdb::Gdb;
use crate::log::LogDecoder;
use crate::machine::Machine;
use crate::qmp::Qmp;
use crate::run::{self, Finished, RunError};
use image::Image;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// A run under control. Dropping it ends the emulator.
pub struct Debugged {
    /// The core.
    pub gdb: Gdb,
    /// The machine around it.
    pub qmp: Qmp,
    decoder: LogDecoder,
    emulator: Emulator,
    _sockets: TempDir,
}

impl Debugged {
    /// Starts an image as [`run::run`] does, with the core stopped before its first instruction.
    /// `limit` is the time limit of each request.
    ///
    /// # Errors
    /// If the emulator is missing, fails, or does not start in time.
    pub fn start(
        image: &Image,
        machine: Machine,
        settings: &[String],
        directory: &Path,
        limit: Duration,
    ) -> Result<Self, RunError> {
        let sockets = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let gdb = sockets.path().join("gdb");
        let qmp = sockets.path().join("qmp");
        let listen = |path: &Path| format!("unix:{},server=on,wait=off", path.display());
        let (at_gdb, at_qmp) = (listen(&gdb), listen(&qmp));
        let options = [run::SILENT, &["-S", "-gdb", &at_gdb, "-qmp", &at_qmp]].concat();
        let decoder = LogDecoder::new(image)?;
        let emulator = run::start(image, machine, settings, directory, &options)?;
        Ok(Self {
            gdb: Gdb::connect(&gdb, limit)?,
            qmp: Qmp::connect(&qmp, limit)?,
            decoder,
            emulator,
            _sockets: sockets,
        })
    }

    /// Detaches from the core and waits for the end of the run. Until then the log is in a pipe,
    /// which holds some hundred lines.
    ///
    /// # Errors
    /// As [`run::run`].
    pub fn finish(self, limit: Duration) -> Result<Finished, RunError> {
        self.gdb.detach()?;
        run::attend(self.emulator, &self.decoder, limit, &|_| {})
    }
}
