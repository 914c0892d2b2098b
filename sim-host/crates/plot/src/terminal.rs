//! The verdict table for a terminal.

use crate::text::{by_run, counts, limit, measured, status_word, wrap};
use crate::verdict::{Check, Status, Verdict};
use std::fmt::Write;

/// Widths of the columns; with gaps and indent the table is 108 characters wide.
const STATUS: usize = 8;
const TITLE: usize = 50;
const MEASURED: usize = 18;
const LIMIT: usize = 24;
const GAP: &str = "  ";
const TOTAL: usize = STATUS + TITLE + MEASURED + LIMIT + 4 * GAP.len();

/// The verdict table in aligned columns, its last line the verdict with the counts. With `colour`,
/// the status words carry ANSI colours.
pub fn table(verdict: &Verdict, colour: bool) -> String {
    let mut out = String::new();
    row(
        &mut out,
        ["status", "check", "measured", "limit"],
        |padded| paint(padded, BOLD, colour),
    );
    for (run, checks) in by_run(verdict) {
        let _ = writeln!(out, "{}", paint(run, BOLD, colour));
        for check in checks {
            check_rows(&mut out, check, colour);
        }
    }
    let (word, code) = if verdict.passed() {
        ("PASS", GREEN)
    } else {
        ("FAIL", RED)
    };
    let _ = writeln!(out, "{}: {}", paint(word, code, colour), counts(verdict));
    out
}

/// The check in as many lines as its longest cell needs, and below it why it did not pass.
fn check_rows(out: &mut String, check: &Check, colour: bool) {
    let code = match check.status {
        Status::Passed => GREEN,
        Status::Failed => RED,
        Status::Untested => YELLOW,
    };
    row(
        out,
        [
            status_word(check.status),
            &check.title,
            &measured(check),
            &limit(check),
        ],
        |padded| paint(padded, code, colour),
    );
    if check.status != Status::Passed && !check.detail.is_empty() {
        let indent = " ".repeat(STATUS + 2 * GAP.len());
        for line in wrap(&check.detail, TOTAL - indent.len()) {
            let _ = writeln!(out, "{indent}{line}");
        }
    }
}

fn row(out: &mut String, cells: [&str; 4], paint_status: impl Fn(&str) -> String) {
    let [status, title, measured, limit] = cells;
    let title = wrap(title, TITLE);
    let measured = wrap(measured, MEASURED);
    let limit = wrap(limit, LIMIT);
    let lines = title.len().max(measured.len()).max(limit.len());
    let cell = |lines: &[String], n: usize| lines.get(n).cloned().unwrap_or_default();
    for n in 0..lines {
        let status = if n == 0 { status } else { "" };
        let line = format!(
            "{GAP}{}{GAP}{:TITLE$}{GAP}{:>MEASURED$}{GAP}{}",
            paint_status(&format!("{status:STATUS$}")),
            cell(&title, n),
            cell(&measured, n),
            cell(&limit, n)
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
}

const BOLD: &str = "1";
const RED: &str = "1;31";
const GREEN: &str = "32";
const YELLOW: &str = "1;33";

fn paint(text: &str, code: &str, colour: bool) -> String {
    if colour && !text.trim().is_empty() {
        format!("\u{1b}[{code}m{text}\u{1b}[0m")
    } else {
        text.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::sample;

    #[test]
    fn every_check_is_there_and_no_line_is_too_wide() {
        let verdict = sample();
        let text = table(&verdict, false);
        assert!(!text.contains('\u{1b}'));
        for line in text.lines() {
            assert!(line.chars().count() <= 110, "{line}");
        }
        for check in &verdict.checks {
            let start = wrap(&check.title, TITLE)[0].clone();
            assert!(text.contains(&start), "{start}");
        }
        assert!(
            text.trim_end()
                .ends_with("FAIL: 1 passed, 1 failed, 1 untested")
        );
    }

    #[test]
    fn colour_changes_nothing_but_colour() {
        let verdict = sample();
        let mut plain = table(&verdict, true);
        for code in [BOLD, RED, GREEN, YELLOW, "0"] {
            plain = plain.replace(&format!("\u{1b}[{code}m"), "");
        }
        assert_eq!(plain, table(&verdict, false));
    }
}
