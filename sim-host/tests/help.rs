//! The examples of all help texts, run in sequence in one empty folder, as a reader would copy
//! them.
//!
//! Examples that need the firmware must reach its missing file; long examples must begin their
//! work.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Subcommands whose examples need QEMU or what was made in it.
const WITH_FIRMWARE: [&str; 6] = [
    "verify",
    "pil",
    "firmware configure",
    "firmware image",
    "firmware run",
    "firmware decode",
];
/// Where the firmware's images are.
const IMAGES: &str = "thumbv7em-none-eabihf";
/// Examples of some seconds of work and more.
const LONG: [&str; 18] = [
    "sim-host reproduce --quick # everything in seconds",
    "sim-host reproduce # full quality, in target/reproduction",
    "sim-host reproduce --config vehicle.toml --out target/vehicle",
    "sim-host faults --quick",
    "sim-host schedule --out schedule_table.rs",
    "sim-host schedule --from 1700 --to 1800 --csv schedule.csv --figure schedule.svg",
    "sim-host schedule --config vehicle.toml --from 1500 --to 1600 --step 50 --margin 0.5 --json schedule.json",
    "sim-host feedback --from 1750 --to 1750 --region --gain-from 2 --gain-to 12 --gain-step 2 --time 100 --out region.csv --figure region.svg",
    "sim-host feedback --step 40 --out feedback.csv --figure feedback.svg",
    "sim-host regions --from 1820 --to 1860 --step 1 --width 0.1 --transient 1000 --time 2000 --json regions.json",
    "sim-host regions --from 1600 --to 1900 --step 5 --figure regions.svg # the paper's regions I to IV",
    "sim-host map --speeds 64 --amplitudes 64 --out map.csv --parquet map.parquet --figure map.svg",
    "sim-host feedback --from 1560 --step 20 --table table.rs # for the ECU",
    "sim-host regions --over amplitude --dither square --from 0 --to 0.14 --step 0.002 --out regions-square.csv",
    "sim-host map --dither square --from 1700 --to 1800 --step 2 --square-to 0.1 --square-step 0.002 --figure map-detail.svg",
    "sim-host lyapunov --rpm 1600 --method printed-response # equation (20)",
    "sim-host averaging --dither square --amplitude-v 0.1",
    "sim-host averaging --dither sine --amplitude-v 1 --from 500 --to 20000 --points 9 --figure averaging.svg",
];
/// After this long work has begun, and bad arguments have been refused.
const BEGUN: Duration = Duration::from_millis(800);

fn help(at: &Path, arguments: &[&str], columns: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sim-host"));
    command
        .args(arguments)
        .current_dir(at)
        .env("COLUMNS", columns);
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{arguments:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// The names in a list of commands.
fn listed(help: &str, from: &str, to: &str) -> Vec<String> {
    let list = help.split(from).nth(1).expect("a list of commands");
    let list = list.split(to).next().unwrap_or_default();
    let is_name = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let names = list.lines().filter(is_name);
    let names = names.filter_map(|line| line.split_whitespace().next());
    names
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect()
}

/// All subcommands, those of `firmware` with its name.
fn subcommands(at: &Path) -> Vec<String> {
    let all = listed(&help(at, &["--help"], "200"), "Verification", "Options:");
    let expanded = |name: String| match name.as_str() {
        "firmware" => {
            let tools = listed(
                &help(at, &["firmware", "--help"], "200"),
                "Commands:",
                "Options:",
            );
            tools
                .iter()
                .map(|tool| format!("firmware {tool}"))
                .collect()
        }
        _ => vec![name],
    };
    all.into_iter().flat_map(expanded).collect()
}

/// The examples of a subcommand, each on one line.
fn examples(at: &Path, subcommand: &str, columns: &str) -> Vec<String> {
    let words = subcommand.split(' ').chain(["--help"]);
    let help = help(at, &words.collect::<Vec<_>>(), columns);
    let after = help
        .lines()
        .skip_while(|line| !line.starts_with("Examples"));
    let block = after.skip(1).take_while(|line| line.starts_with("  "));
    let block: Vec<&str> = block.map(str::trim).collect();
    let lines = block.join("\n").replace("\\\n", "");
    let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    lines
        .lines()
        .map(words)
        .filter(|line| !line.starts_with('#'))
        .collect()
}

/// The example in a shell, `sim-host` being the program under test.
fn shell(at: &Path, example: &str) -> Command {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_sim-host"));
    let mut path = OsString::from(program.parent().expect("a folder"));
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let mut command = Command::new("sh");
    // In the shell's place, so that a long one can be ended.
    command
        .args(["-c", &format!("exec {example}")])
        .env("PATH", path)
        // Without images, wherever the program is.
        .env("DITHERSTEER_FIRMWARE", at.join("no images"));
    command.current_dir(at);
    command
}

fn outcome(output: &Output) -> (Option<i32>, String) {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), message)
}

/// Begins its work and is ended.
fn begin(at: &Path, example: &str) {
    let mut command = shell(at, example);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().expect("a shell");
    let start = Instant::now();
    while start.elapsed() < BEGUN {
        let ended = child.try_wait().expect("it can be waited for");
        assert!(ended.is_none_or(|status| status.success()), "{example}");
        std::thread::sleep(BEGUN / 20);
    }
    child.kill().expect("it can be ended");
    child.wait().expect("it has ended");
}

#[test]
fn all_examples_run_one_after_the_other() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let at = folder.path();
    let mut all = BTreeSet::new();
    for subcommand in subcommands(at) {
        let examples = examples(at, &subcommand, "200");
        assert!(!examples.is_empty(), "{subcommand} has no example");
        for example in examples.iter().filter(|line| line.starts_with("sim-host ")) {
            if LONG.contains(&example.as_str()) {
                begin(at, example);
            } else {
                let (code, message) = outcome(&shell(at, example).output().expect("a shell"));
                let needs_firmware =
                    WITH_FIRMWARE.contains(&subcommand.as_str()) || example.contains(IMAGES);
                if needs_firmware && example != "sim-host config > vehicle.toml" {
                    assert_eq!(code, Some(2), "{example}: {message}");
                    let is_missing = |reason: &&str| message.contains(reason);
                    let reasons = ["No such file", "no firmware image"];
                    assert!(reasons.iter().any(is_missing), "{example}: {message}");
                } else {
                    assert_eq!(code, Some(0), "{example}: {message}");
                }
            }
            all.insert(example.clone());
        }
    }
    assert!(all.len() > 50, "{all:?}");
    assert!(LONG.iter().all(|example| all.contains(*example)), "{all:?}");
}

/// On a terminal of the usual width no line is broken, so none within an option.
#[test]
fn no_example_is_broken_on_80_columns() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    for subcommand in subcommands(folder.path()) {
        let [narrow, wide] =
            ["80", "200"].map(|columns| examples(folder.path(), &subcommand, columns));
        assert_eq!(narrow, wide, "{subcommand}");
    }
}
