//! `sim-host firmware image`: size and worst stack of a firmware image.

use crate::cli::emulator::open_image;
use crate::cli::outcome::Outcome;
use crate::cli::output::{check, named};
use dynamics::words::counted;
use files::output::write_json;
use image::Image;
use image::stack::{Level, Stack};
use serde::Serialize;
use sim_host::firmware::PRIORITIES;
use std::path::PathBuf;

/// Report the size of an image and its worst stack with the chain of calls, computed from the
/// machine code.
///
/// The image must be compiled with `-Zemit-stack-sizes`, as by `cargo xtask proofs`. The worst
/// stack is an upper bound: the sum of the deepest stacks of main program, control task, PWM
/// interrupt, hard fault and watchdog, which preempt each other.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask proofs
  sim-host firmware image --json stack.json \\
      target/thumbv7em-none-eabihf/firmware/bench

The exit code is 1 if there is no bound (recursion, unknown frames), or if it exceeds the RAM.")]
pub struct Arguments {
    /// Firmware image (ELF)
    image: PathBuf,
    /// Write all figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

#[derive(Serialize)]
struct Results<'a> {
    compiler: &'a str,
    flash_bytes: u64,
    ram_bytes: u64,
    stack: &'a Stack,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let input = ("the image", arguments.image.as_path());
    check([input], [named("--json", &arguments.json)], arguments.force)?;
    let image = open_image(&arguments.image)?;
    let stack = Stack::analyse(&image.bytes, &PRIORITIES)?;
    show(&image, &stack);
    if let Some(path) = &arguments.json {
        let results = Results {
            compiler: &image.compiler,
            flash_bytes: image.flash_bytes,
            ram_bytes: image.ram_bytes,
            stack: &stack,
        };
        write_json(path, &results, arguments.force)?;
    }
    Ok(if stack.fits() {
        Outcome::Success
    } else {
        Outcome::Failed
    })
}

fn show(image: &Image, stack: &Stack) {
    say!("built by {}", image.compiler);
    say!(
        "{} of flash, {} of RAM without stack",
        counted(image.flash_bytes, "byte"),
        counted(image.ram_bytes, "byte")
    );
    say!(
        "worst stack {} of {} bytes: {} for exception frames, and",
        stack.worst_bytes,
        stack.room_bytes,
        stack.exception_frames_bytes
    );
    for Level { name, bytes, path } in &stack.levels {
        say!("  {bytes:6}  {name}");
        for (function, frame) in path {
            say!("          {frame:6}  {function}");
        }
    }
    say!(
        "frames: {} given by the compiler, {} of them confirmed by their instructions; {} computed from the instructions only",
        stack.stated_functions,
        stack.confirmed_functions,
        stack.counted_functions
    );
    say!(
        "callers through pointers, each to any of {}: {}",
        counted(stack.address_taken, "function"),
        stack.indirect_callers.join(", ")
    );
    for problem in &stack.problems {
        say!("no bound: {problem}");
    }
}
