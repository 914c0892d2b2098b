//! A full disk: measurement files and bus logs are refused with an error, and nothing of them is
//! left.
//!
//! The disk is a file system of 64 KiB in memory, which exists for one process alone. Where the
//! machine does not permit to mount it, this is untested.

use shared_model::dither::{Application, Waveform};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};
use tests::{TIME_OUT, image, run, scenario, sim_host};

/// Name of the folder that is the disk.
const DISK: &str = "disk";
/// Mounts the disk, puts a file on it, runs the other arguments, and lists what is on it then.
const SCRIPT: &str = "mount -t tmpfs -o size=64k none disk || exit 9
printf mine > disk/earlier
\"$@\"
code=$?
cd disk && for file in *; do echo \"left: $file $(wc -c < $file)\"; done
exit $code";

/// The arguments of `unshare` with which this machine mounts the disk; `None` with a message if it
/// does not.
fn permission() -> Option<&'static [&'static str]> {
    let folder = folder();
    let ways: [&[&str]; 2] = [&["--mount"], &["--map-root-user", "--mount"]];
    let permitted = ways.into_iter().find(|way| {
        let output = on_disk(folder.path(), way, &["true"]);
        output.is_some_and(|output| output.status.success())
    });
    if permitted.is_none() {
        // Past the test harness, which would keep it.
        let _ = writeln!(
            std::io::stderr(),
            "UNTESTED: outputs on a full disk: this machine permits no mount (unshare --mount)"
        );
    }
    permitted
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    fs::create_dir(folder.path().join(DISK)).expect("a folder can be made");
    folder
}

fn on_disk(folder: &Path, way: &[&str], command: &[&str]) -> Option<Output> {
    let mut unshare = Command::new("unshare");
    unshare.args(way).args(["sh", "-c", SCRIPT, "sh"]);
    unshare.args(command).current_dir(folder).output().ok()
}

/// Runs the program and expects its exit code, a part of its message, and the lines about the disk.
#[track_caller]
fn assert_ends(folder: &Path, way: &[&str], line: &str, code: i32, part: &str, left: &[&str]) {
    let program = sim_host();
    let mut command = vec![program.to_str().expect("a plain path")];
    command.extend(line.split_whitespace());
    let output = on_disk(folder, way, &command).expect("unshare starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{line}: {message}");
    assert!(message.contains(part), "{line}: {message} lacks {part:?}");
    let found = String::from_utf8_lossy(&output.stdout);
    let found: Vec<&str> = found
        .lines()
        .filter_map(|line| line.strip_prefix("left: "))
        .collect();
    assert_eq!(found, left, "{line}");
}

/// A few seconds of each output take more than the disk has.
#[test]
fn nothing_is_left_of_a_file_that_does_not_fit() {
    let Some(way) = permission() else { return };
    let folder = folder();
    let at = folder.path();
    let bench = image("bench");
    let mut settings = qemu::settings::of(&scenario(Waveform::Sine, Application::Averaged));
    settings.push("telemetry=run.bin".into());
    run(&bench, qemu::Machine::Mps2An386, &settings, at, TIME_OUT).expect("it ends");
    let pil = format!("pil --time 1 --firmware {}", bench.path.display());
    for line in [
        "simulate --time 10 --mdf4 disk/a.mf4",
        "simulate --time 10 --mdf4 disk/earlier --force",
        "firmware decode run.bin --mdf4 disk/a.mf4",
        &format!("{pil} --mdf4 disk/a.mf4"),
        &format!("{pil} --can-log disk/a.log"),
        &format!("{pil} --can-log disk/a.asc"),
        &format!("{pil} --can-log disk/earlier --force"),
    ] {
        assert_ends(at, way, line, 2, "No space left on device", &["earlier 4"]);
    }
    // The disk takes what fits.
    let short = "simulate --time 0.001 --mdf4 disk/a.mf4";
    let left = [
        &format!("a.mf4 {}", ordinary_length(at, short)),
        "earlier 4",
    ];
    assert_ends(at, way, short, 0, "", &left);
}

/// Length of the same file in the folder below the disk, bytes.
fn ordinary_length(at: &Path, line: &str) -> u64 {
    let mut command = Command::new(sim_host());
    let command = command.args(line.split_whitespace()).current_dir(at);
    assert!(command.output().expect("it starts").status.success());
    let file = fs::metadata(at.join("disk/a.mf4"));
    file.expect("it is there").len()
}
