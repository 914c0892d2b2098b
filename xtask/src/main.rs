//! The single door to the repository: `cargo xtask <command>`.
//!
//! It installs missing tools, builds, and starts programs. It contains no model: every verdict
//! comes from the program that it starts.

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
/// Exit codes of every command: 0 passed; 1 a test or a verdict failed; 2 it could not run.
/// The last line has the reason, and the next step.
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
                        cargo xtask doctor   installed and missing tools\n\n\
                        `cargo xtask help COMMAND` shows a command's own examples."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Shows the required tools, which of them are installed, and the steps of `setup`; changes
    /// nothing.
    ///
    /// Exit code 0 if everything is installed, 2 if something is missing.
    #[command(after_help = "Example:\n  cargo xtask doctor")]
    Doctor,

    /// Installs missing tools and builds the runner.
    ///
    /// Each installation is announced with its place before it begins. The compiler's target comes
    /// from rustup, or where rustup cannot download, from Debian's Rust packages; QEMU comes
    /// from the system's packages. The runner is the program that `cargo run` in firmware/
    /// starts. Python packages for the tests go into target/python; the system's Python is not
    /// changed. The page's test takes Chromium and Node.js from the system's packages; their driver goes
    /// into target/browser.
    #[command(
        after_help = "Example:\n  cargo xtask setup && cd firmware && cargo run --profile firmware --bin bench"
    )]
    Setup,

    /// Sets up, builds, runs firmware and host against each other, and writes
    /// target/report/index.html.
    #[command(after_help = "Examples:\n  cargo xtask demo\n  \
                            cargo xtask demo -- --help   the options that may follow the two dashes")]
    Demo {
        /// Arguments passed on to `sim-host verify`.
        #[arg(last = true)]
        args: Vec<String>,
    },

    /// Sets up, builds the firmware with its proofs, and runs every test; stops at the first
    /// failure.
    #[command(after_help = "Example:\n  cargo xtask test")]
    Test,

    /// Builds every board's firmware, and compares its proofs with tests/golden.
    ///
    /// Panic-free link, worst stack, flash and RAM, instructions of the tasks, jitter of the
    /// interrupts, and a reason for every `unsafe`.
    #[command(after_help = "Examples:\n  cargo xtask proofs\n  \
                            cargo xtask proofs --overwrite-expected && git diff tests/golden")]
    Proofs {
        /// Write the figures into tests/golden instead of comparing them; limits still apply.
        #[arg(long)]
        overwrite_expected: bool,
    },

    /// Counts the instructions of the model's step and the ECU's tasks on the target, beside the C
    /// reference by GCC -O3.
    ///
    /// Fails if a bit of their outputs differs, or if Rust takes more. Needs arm-none-eabi-gcc; the
    /// error message names the package.
    #[command(after_help = "Example:\n  cargo xtask target-cost")]
    TargetCost {
        /// Write the figures into tests/golden/cost.txt instead of comparing them; the limit still
        /// applies.
        #[arg(long)]
        overwrite_expected: bool,
    },

    /// Checks the format, the API documentation, and runs clippy on host and firmware; warnings are
    /// errors.
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

    /// Builds the page for the browser, target/page/index.html: the model, its plots and its regimes in one file.
    ///
    /// The compiler's target comes from rustup, or where rustup cannot download, from Debian's Rust packages.
    #[command(after_help = "Example:\n  cargo xtask page && xdg-open target/page/index.html")]
    Page,

    /// Packs every publishable package, and builds each from its package alone. Publishes nothing.
    #[command(after_help = "Example:\n  cargo xtask package")]
    Package,

    /// Measures the line coverage of the model's tests; fails if a line of gate or controller is
    /// not covered.
    ///
    /// Needs LLVM's llvm-profdata and llvm-cov; the error message names the package.
    #[command(after_help = "Example:\n  cargo xtask coverage")]
    Coverage,

    /// Mutation tests of gate, controller and ECU program; fails if a mutation passes the tests.
    ///
    /// Equivalent mutations are listed, with the reason, in shared-model/mutants-survivors.txt.
    /// Takes about half an hour on two cores, so it is no part of `test`. Installs
    /// cargo-mutants into target/tools.
    #[command(after_help = "Example:\n  cargo xtask mutants")]
    Mutants,

    /// Coverage-guided fuzzing of every reader of external data; fails at the first input that
    /// makes one panic, hang or take too much memory.
    ///
    /// Needs a C++ compiler for libFuzzer. Takes some hours, so it is no part of `test`, which runs
    /// the corpus and a fixed number of mutations. Inputs found are kept in target/fuzz, and
    /// the next run continues from them.
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
        Command::Page => jobs::page::run(),
        Command::Package => jobs::package::run(),
        Command::Coverage => jobs::coverage::run(),
        Command::Mutants => jobs::mutants::run(),
        Command::Fuzz { target, inputs } => jobs::fuzz::run(target.as_deref(), inputs),
    };
    outcome::report(result)
}
