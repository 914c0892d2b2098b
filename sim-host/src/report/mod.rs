//! The report: figures, one HTML page, and the verdict for programs.

mod figure;
mod html;
mod input;
mod question;
#[cfg(test)]
mod sample;

pub use input::{DriveReport, Pair, ReportInput, RunReport};

use anyhow::ensure;
use files::output::{make_folder, write_text};
use plot::junit;
use std::path::Path;

/// The files of a report but for its figures.
pub const FILES: [&str; 3] = ["verdict.json", "junit.xml", "index.html"];

/// The folder of its figures.
pub const FIGURES: &str = "figures";

/// Writes `index.html`, `verdict.json`, `junit.xml` and `figures/*.svg` into the directory, which
/// is made if it is missing. Files of these names are replaced, each at once; `index.html` comes
/// last.
pub fn write(directory: &Path, input: &ReportInput) -> anyhow::Result<()> {
    for pair in input.pairs {
        ensure!(
            pair.before.max(pair.after) < input.runs.len(),
            "the pair {:?} names run {} of {}",
            pair.title,
            pair.before.max(pair.after),
            input.runs.len()
        );
    }
    let figures = figure::all(input);
    let figure_directory = directory.join(FIGURES);
    make_folder(&figure_directory)?;
    let replace = |path: &Path, text: &str| write_text(path, text, true);
    for figure in &figures {
        let name = format!("{}.svg", figure.name);
        replace(&figure_directory.join(name), &figure.svg)?;
    }
    let verdict = serde_json::to_string_pretty(input.verdict)? + "\n";
    let junit = junit::document(input.title, input.verdict);
    let page = html::report(input, &figures).into_string();
    for (name, text) in FILES.iter().zip([verdict, junit, page]) {
        replace(&directory.join(name), &text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn writes_every_file_and_the_verdict_with_the_agreed_keys() {
        let directory = tempfile::tempdir().unwrap();
        let target = directory.path().join("report");
        let (verdict, runs, pairs) = (sample::verdict(), sample::runs(), sample::pairs());
        let input = sample::input(&verdict, &runs, &pairs);
        write(&target, &input).unwrap();
        write(&target, &input).unwrap();

        let mut names: Vec<_> = fs::read_dir(&target)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(
            names,
            ["figures", "index.html", "junit.xml", "verdict.json"]
        );
        for entry in fs::read_dir(target.join("figures")).unwrap() {
            let path = entry.unwrap().path();
            assert_eq!(path.extension().unwrap(), "svg");
            let size = path.metadata().unwrap().len();
            assert!(size < 400_000, "{} has {size} bytes", path.display());
        }

        let text = fs::read_to_string(target.join("verdict.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let keys = |value: &serde_json::Value| -> Vec<String> {
            value.as_object().unwrap().keys().cloned().collect()
        };
        let sorted = |mut keys: Vec<String>| {
            keys.sort();
            keys
        };
        assert_eq!(sorted(keys(&json)), ["checks", "verdict"]);
        assert_eq!(json["verdict"], "fail");
        let checks = json["checks"].as_array().unwrap();
        assert_eq!(checks.len(), verdict.checks.len());
        for check in checks {
            assert_eq!(
                sorted(keys(check)),
                [
                    "detail", "id", "limit", "measured", "status", "title", "unit"
                ]
            );
        }
        assert_eq!(checks[0]["status"], "passed");
        assert!(checks[6]["measured"].is_null());
    }

    #[test]
    fn a_pair_of_a_run_that_is_not_there_is_an_error() {
        let (verdict, runs) = (sample::verdict(), sample::runs());
        let pairs = [Pair {
            title: "none".into(),
            before: 0,
            after: 99,
        }];
        let error = write(Path::new("unused"), &sample::input(&verdict, &runs, &pairs));
        assert!(error.unwrap_err().to_string().contains("99"));
    }
}
