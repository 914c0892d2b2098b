//! Messages of the program: on standard output, unless data is written there.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static DATA_IS_THERE: AtomicBool = AtomicBool::new(false);
static FAILURE: OnceLock<io::Error> = OnceLock::new();

/// Prints a line as `println!` does. A failure is stored for [`finish`], and nothing is printed
/// after it.
macro_rules! say {
    ($($line:tt)*) => {
        $crate::cli::stdout::print(format_args!($($line)*))
    };
}

/// Moves all further lines to standard error.
pub fn leave_to_data() {
    DATA_IS_THERE.store(true, Ordering::Relaxed);
}

/// See `say!`.
pub fn print(line: Arguments) {
    if FAILURE.get().is_some() {
        return;
    }
    let line = format!("{line}\n");
    let printed = if DATA_IS_THERE.load(Ordering::Relaxed) {
        io::stderr().write_all(line.as_bytes())
    } else {
        io::stdout().write_all(line.as_bytes())
    };
    if let Err(error) = printed {
        FAILURE.get_or_init(|| error);
    }
}

/// Reports a failed print. A reader that closes the pipe early (`| head`) is not a failure.
pub fn finish() -> anyhow::Result<()> {
    if let Err(error) = io::stdout().flush() {
        FAILURE.get_or_init(|| error);
    }
    match FAILURE.get() {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => {
            anyhow::bail!("cannot write to standard output: {error}")
        }
        _ => Ok(()),
    }
}
