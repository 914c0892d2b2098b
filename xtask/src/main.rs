//! The single door to the repository: `cargo xtask <command>`.
//!
//! It sets up what is missing, builds, and starts programs. It knows no model: every verdict is the business of
//! the program it starts.

mod doctor;
mod firmware;
mod host;
mod jobs;
mod outcome;
mod process;
mod rustup;
mod setup;
mod workspace;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Sets up, builds, tests and runs Dithersteer.
///
/// Exit codes of every command: 0 all is well; 1 a test or a verdict failed; 2 it could not run.
/// The last line says why, and what to do next.
#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    arg_required_else_help = true
)]
#[command(
    after_help = "Examples:\n  cargo xtask demo     set up, build, run the firmware in QEMU, write the report\n  \
                        cargo xtask test     set up, build, run every test\n  \
                        cargo xtask proofs   worst stack, sizes, instructions of the firmware\n  \
                        cargo xtask doctor   what is there, what is missing\n\n\
                        `cargo xtask help COMMAND` shows a command's own examples."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Shows what is needed, what is there, and what `setup` would do; changes nothing.
    ///
    /// Exit code 0 when everything is there, 2 when something is missing.
    #[command(after_help = "Example:\n  cargo xtask doctor")]
    Doctor,

    /// Installs what is missing, nothing twice, and builds the runner.
    ///
    /// Says what it installs, and where, before it does it. The compiler's target comes from rustup, or where
    /// rustup cannot download, from Debian's Rust packages; QEMU comes from the system's packages. The runner is
    /// the program that `cargo run` in firmware/ starts. Python packages that tests compare with go into
    /// target/python, and into no Python of this machine.
    #[command(
        after_help = "Example:\n  cargo xtask setup && cd firmware && cargo run --profile firmware --bin ecu"
    )]
    Setup,

    /// Sets up, builds, runs firmware and host against each other, and writes target/report/index.html.
    #[command(after_help = "Examples:\n  cargo xtask demo\n  \
                            cargo xtask demo -- --help   the options that may follow the two dashes")]
    Demo {
        /// Arguments passed on to `sim-host verify`.
        #[arg(last = true)]
        args: Vec<String>,
    },

    /// Sets up, builds the firmware with its proofs, and runs every test; stops at the first failure.
    #[command(after_help = "Example:\n  cargo xtask test")]
    Test,

    /// Builds every board's firmware, proves what can be proved of it, and compares it with tests/golden.
    ///
    /// Panic-free link, worst stack, flash and RAM, instructions of the tasks, spacing of the interrupts, and a reason for
    /// every `unsafe`.
    #[command(after_help = "Examples:\n  cargo xtask proofs\n  \
                            cargo xtask proofs --overwrite-expected && git diff tests/golden")]
    Proofs {
        /// Write the figures into tests/golden instead of comparing them; limits hold all the same.
        #[arg(long)]
        overwrite_expected: bool,
    },

    /// Counts the instructions of the model's step and the ECU's tasks on the target, and of the same in C by GCC -O3.
    ///
    /// Fails if a bit of their outputs differs, or if Rust takes more. Needs arm-none-eabi-gcc; says what to install where it is
    /// missing.
    #[command(after_help = "Example:\n  cargo xtask target-cost")]
    TargetCost {
        /// Write the figures into tests/golden/cost.txt instead of comparing them; the limit holds all the same.
        #[arg(long)]
        overwrite_expected: bool,
    },

    /// Checks the format, and runs clippy on host and firmware; warnings are errors.
    #[command(after_help = "Example:\n  cargo xtask lint")]
    Lint,

    /// Builds the firmware for a board; its last line of output is the path of the ELF file.
    #[command(
        after_help = "Examples:\n  cargo xtask firmware && arm-none-eabi-size \"$(cargo xtask firmware | tail -n 1)\"\n  \
                            cargo xtask firmware --board netduinoplus2\n  \
                            cargo xtask firmware --board all"
    )]
    Firmware {
        /// The board, a folder of firmware/src/board, or `all`.
        #[arg(long, default_value = firmware::USUAL_BOARD)]
        board: String,
    },

    /// Packs every publishable package, and builds each from its package alone. Publishes nothing.
    #[command(after_help = "Example:\n  cargo xtask package")]
    Package,

    /// Runs the model's tests with a counter in each line; fails if a line of gate or controller is run by none.
    ///
    /// Needs LLVM's llvm-profdata and llvm-cov; says what to install where they are missing.
    #[command(after_help = "Example:\n  cargo xtask coverage")]
    Coverage,

    /// Changes gate, controller and ECU program in hundreds of ways, and fails if the tests do not notice one.
    ///
    /// Those that cannot be noticed are named, with the reason, in shared-model/mutants-survivors.txt. Takes about half an
    /// hour on two cores, so it is no part of `test`. Installs cargo-mutants into target/tools.
    #[command(after_help = "Example:\n  cargo xtask mutants")]
    Mutants,

    /// Gives hostile bytes to every reader of what comes from outside, led by coverage; fails at the first that panics,
    /// hangs or takes too much memory.
    ///
    /// Needs a C++ compiler for libFuzzer. Takes some hours, so it is no part of `test`, which runs the corpus and a fixed
    /// number of mutations. What is found is kept in target/fuzz and continued from.
    #[command(
        after_help = "Examples:\n  cargo xtask fuzz telemetry\n  cargo xtask fuzz --inputs 100000"
    )]
    Fuzz {
        /// One reader, a folder of fuzz/corpus [default: all].
        target: Option<String>,
        /// Inputs for each, instead of its usual number.
        #[arg(long, value_name = "N")]
        inputs: Option<u64>,
    },
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Doctor => doctor::run(),
        Command::Setup => jobs::setup::run(),
        Command::Demo { args } => jobs::demo::run(&args),
        Command::Test => jobs::test::run(),
        Command::Proofs { overwrite_expected } => jobs::proofs::run(overwrite_expected),
        Command::TargetCost { overwrite_expected } => jobs::target_cost::run(overwrite_expected),
        Command::Lint => jobs::lint::run(),
        Command::Firmware { board } => jobs::firmware::run(&board),
        Command::Package => jobs::package::run(),
        Command::Coverage => jobs::coverage::run(),
        Command::Mutants => jobs::mutants::run(),
        Command::Fuzz { target, inputs } => jobs::fuzz::run(target.as_deref(), inputs),
    };
    outcome::report(result)
}
