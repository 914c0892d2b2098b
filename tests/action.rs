//! The job's summary of the action, as Markdown from a verdict.

use std::fs;
use std::path::Path;
use std::process::Command;
use tests::root;

/// The summary of a verdict; `None` without jq, which the action installs.
fn summary(verdict: &Path) -> Option<String> {
    if Command::new("jq").arg("--version").output().is_err() {
        println!("untested: jq is not installed");
        return None;
    }
    let output = Command::new(root().join(".github/summary.sh"))
        .arg(verdict)
        .output()
        .expect("the script starts");
    assert!(output.status.success(), "{output:?}");
    Some(String::from_utf8(output.stdout).expect("text"))
}

#[test]
fn the_summary_begins_with_what_did_not_pass() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let file = folder.path().join("verdict.json");
    let check = |title: &str, status: &str| {
        format!(
            r#"{{"id": "a", "title": "{title}", "measured": 2.5, "limit": "<= 1", "unit": "s", "status": "{status}"}}"#
        )
    };
    let checks = [
        check("first", "passed"),
        check("a | b", "failed"),
        check("c", "untested"),
    ];
    let verdict = format!(r#"{{"verdict": "fail", "checks": [{}]}}"#, checks.join(","));
    fs::write(&file, verdict).expect("it can be written");
    let Some(text) = summary(&file) else { return };
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "## Dithersteer: fail, 3 checks");
    let (open, all) = text.split_once("<details>").expect("all checks are folded");
    assert!(
        open.contains(r"| failed | a \| b | 2.5 | <= 1 s |"),
        "{open}"
    );
    assert!(
        open.contains("| untested | c |") && !open.contains("first"),
        "{open}"
    );
    assert!(all.contains("| passed | first | 2.5 | <= 1 s |"), "{all}");
}

#[test]
fn a_run_without_a_verdict_is_reported() {
    let Some(text) = summary(Path::new("missing/verdict.json")) else {
        return;
    };
    assert!(
        text.contains("could not run") && text.contains("missing/verdict.json"),
        "{text}"
    );
}
