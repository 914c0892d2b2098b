//! Recorded figures in `tests/golden`: read, compared, and made anew.

use crate::root;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// Set by `cargo xtask proofs --overwrite-expected`: then the files are written, not compared.
const OVERWRITE: &str = "DITHERSTEER_OVERWRITE_EXPECTED";
/// How far a figure may be from the recorded one with the same compiler, of the recorded one.
const TOLERANCE: f64 = 0.05;
const COMPILER: &str = "compiler: ";

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name without blanks.
    pub name: String,
    /// The figure.
    pub value: f64,
    /// Greatest value, whatever the compiler.
    pub limit: Option<f64>,
    /// Unit.
    pub unit: &'static str,
}

impl Figure {
    /// A figure without a limit.
    pub fn new(name: impl Into<String>, value: impl Into<f64>, unit: &'static str) -> Self {
        Self {
            name: name.into(),
            value: value.into(),
            limit: None,
            unit,
        }
    }

    /// The same with a limit.
    #[must_use]
    pub fn at_most(mut self, limit: impl Into<f64>) -> Self {
        self.limit = Some(limit.into());
        self
    }

    fn line(&self) -> String {
        let limit = self
            .limit
            .map_or(String::new(), |limit| format!("<= {limit}"));
        let line = format!(
            "{:44} {:>10} {:8} {limit}",
            self.name, self.value, self.unit
        );
        line.trim_end().to_owned()
    }
}

/// Compares figures with the file `name`, and every figure with its limit. With another compiler
/// than the file's, which makes other code, names and limits alone are compared, and a message
/// reports that the figures were not.
///
/// # Panics
/// If a figure is above its limit, is missing, or differs.
pub fn check_figures(name: &str, about: &str, compiler: &str, figures: &[Figure]) {
    for Figure {
        name, value, limit, ..
    } in figures
    {
        assert!(
            limit.is_none_or(|limit| *value <= limit),
            "{name} is {value}, above {limit:?}"
        );
    }
    if overwrites() {
        return write(name, &text(about, compiler, figures));
    }
    let file = read(name);
    let recorded = parse(&file);
    let names = |figures: &[(String, f64, String)]| -> Vec<String> {
        figures
            .iter()
            .map(|(name, _, rest)| format!("{name} {rest}"))
            .collect()
    };
    let present = parse(&text(about, compiler, figures));
    assert_eq!(
        names(&recorded),
        names(&present),
        "{name}: names, units or limits; {}",
        hint()
    );
    let recorded_compiler = file.lines().find_map(|line| line.strip_prefix(COMPILER));
    if recorded_compiler != Some(compiler) {
        println!(
            "{name}: limits hold; figures untested: they are of another compiler, {recorded_compiler:?}"
        );
        return;
    }
    for ((figure, expected, _), (_, value, _)) in recorded.iter().zip(&present) {
        let allowed = TOLERANCE * expected.abs();
        assert!(
            (value - expected).abs() <= allowed,
            "{name}: {figure} is {value}, recorded {expected}; {}",
            hint()
        );
    }
}

/// Compares a text with the file `name`.
///
/// # Panics
/// If they differ.
pub fn check_text(name: &str, text: &str) {
    if overwrites() {
        return write(name, text);
    }
    assert_eq!(read(name), text, "{name}; {}", hint());
}

fn hint() -> &'static str {
    "if that is meant, run `cargo xtask proofs --overwrite-expected` and review the difference"
}

fn overwrites() -> bool {
    std::env::var_os(OVERWRITE).is_some()
}

fn text(about: &str, compiler: &str, figures: &[Figure]) -> String {
    let mut text = String::new();
    for line in about.lines() {
        let _ = writeln!(text, "# {line}");
    }
    let percent = 100.0 * TOLERANCE;
    let _ = writeln!(
        text,
        "# Each: name, figure, unit, limit. A figure may differ by {percent} % with the same compiler; limits always hold."
    );
    let _ = writeln!(text, "{COMPILER}{compiler}\n");
    for figure in figures {
        let _ = writeln!(text, "{}", figure.line());
    }
    text
}

/// Name, figure, and what else a line has.
fn parse(text: &str) -> Vec<(String, f64, String)> {
    let lines = text.lines();
    let lines = lines.filter(|line| !line.starts_with('#') && !line.starts_with(COMPILER));
    lines
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let name = words.next()?.to_owned();
            let value = words.next()?.parse().expect("the second word is a number");
            Some((name, value, words.collect::<Vec<_>>().join(" ")))
        })
        .collect()
}

fn path(name: &str) -> PathBuf {
    root().join("tests").join("golden").join(name)
}

fn read(name: &str) -> String {
    fs::read_to_string(path(name)).unwrap_or_else(|error| panic!("{name}: {error}; {}", hint()))
}

fn write(name: &str, text: &str) {
    fs::write(path(name), text).unwrap_or_else(|error| panic!("{name}: {error}"));
}
