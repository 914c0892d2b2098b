//! The lines of docs/map.md that read a map in Python, run as they are printed there.

use std::process::Command;
use tests::{python, root, sim_host};

#[test]
fn the_lines_of_the_page_read_every_column_with_its_unit() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let map = "map --speeds 9 --amplitudes 7 --out map.csv --parquet map.parquet";
    let mut command = Command::new(sim_host());
    let command = command
        .args(map.split_whitespace())
        .current_dir(folder.path());
    let output = command.output().expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");

    let mut script = python::script("check_map.py");
    script.arg(root().join("docs/map.md"));
    let script = script.current_dir(folder.path());
    let output = script.output().expect("Python starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
}
