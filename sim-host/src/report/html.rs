//! The report as one HTML page that needs no other file.

use super::figure::Figure;
use super::input::ReportInput;
use super::question::{self, QUESTIONS, Question};
use maud::{Markup, html};
use plot::matrix::{Cell, Column, Mark, Matrix, Row};
use plot::page;
use plot::text::{by_run, counts, limit, measured, run_of};
use plot::verdict::{Check, Status};

/// The page: verdict, matrix, first figure, checks by run, other figures, notes, recorded texts.
pub fn report(input: &ReportInput, figures: &[Figure]) -> Markup {
    let (first, others) = figures.split_at(figures.len().min(1));
    let body = html! {
        h1 { (input.title) }
        (banner(input))
        (not_passed(input))
        (matrix(input))
        @for figure in first { (drawn(figure)) }
        nav {
            a href="#checks" { "Checks" }
            a href="#figures" { "Figures" }
            @if !input.notes.is_empty() { a href="#notes" { "Notes" } }
            @if !input.proofs.is_empty() { a href="#proofs" { "Firmware proofs" } }
        }
        h2 #checks { "Checks by run" }
        @for (run, checks) in by_run(input.verdict) { (run_section(input, run, &checks)) }
        h2 #figures { "Figures" }
        @for figure in others { (drawn(figure)) }
        @if !input.notes.is_empty() {
            h2 #notes { "Notes" }
            (notes(input.notes))
        }
        @if !input.proofs.is_empty() {
            h2 #proofs { "Firmware proofs" }
            (proofs(input.proofs))
        }
    };
    page::document(input.title, &body)
}

fn banner(input: &ReportInput) -> Markup {
    let (class, word) = if input.verdict.passed() {
        ("banner passed", "\u{2713} PASS")
    } else {
        ("banner failed", "\u{2717} FAIL")
    };
    html! {
        p class=(class) {
            strong { (word) }
            " "
            span { (counts(input.verdict)) }
        }
    }
}

/// Links to the checks that did not pass.
fn not_passed(input: &ReportInput) -> Markup {
    let checks = || input.verdict.checks.iter();
    let rest = || checks().filter(|check| check.status != Status::Passed);
    html! {
        @if rest().next().is_some() {
            ul {
                @for check in rest() {
                    li {
                        (Mark::of(check.status).badge()) " "
                        a href={ "#" (check.id) } {
                            (run_title(input, run_of(check))) ": " (check.title)
                        }
                    }
                }
            }
        }
    }
}

/// Runs by questions. A question that no check belongs to has no column.
fn matrix(input: &ReportInput) -> Markup {
    let checks = &input.verdict.checks;
    let asked = |question: &&Question| checks.iter().any(|check| question::of(check) == *question);
    let questions: Vec<&Question> = QUESTIONS.iter().filter(asked).collect();
    let row = |(run, checks): (&str, Vec<&Check>)| Row {
        title: run_title(input, run).into(),
        target: Some(run_anchor(run)),
        cells: questions
            .iter()
            .map(|question| cell(question, run, &answers(question, &checks)))
            .collect(),
    };
    let column = |question: &&Question| Column {
        title: question.title.into(),
        explanation: question.text.into(),
    };
    let matrix = Matrix {
        corner: "Run".into(),
        columns: questions.iter().map(column).collect(),
        rows: by_run(input.verdict).into_iter().map(row).collect(),
    };
    html! {
        (matrix.markup())
        details {
            summary { "The questions" }
            p { "A cell has the figure of its check, or the number of passed checks among several. It links to their rows." }
            dl {
                @for question in &questions {
                    dt { (question.title) }
                    dd { (question.text) }
                }
            }
        }
    }
}

fn answers<'a>(question: &Question, checks: &[&'a Check]) -> Vec<&'a Check> {
    let checks = checks.iter().copied();
    checks
        .filter(|check| question::of(check) == question)
        .collect()
}

/// The worst status of the checks, and the figure of a single check or the number of passed ones.
fn cell(question: &Question, run: &str, checks: &[&Check]) -> Option<Cell> {
    let worst = worst(checks)?;
    let passed = checks
        .iter()
        .filter(|check| check.status == Status::Passed)
        .count();
    let (text, title) = match checks {
        [check] => (
            measured(check),
            format!("{}; limit: {}", check.title, limit_shown(check)),
        ),
        _ => (
            format!("{passed} of {}", checks.len()),
            question.text.into(),
        ),
    };
    Some(Cell {
        mark: Mark::of(worst),
        text,
        title,
        target: rows_anchor(question, run),
    })
}

/// The worst status; none without checks.
fn worst(checks: &[&Check]) -> Option<Status> {
    let worse = |status: &Status| match status {
        Status::Passed => 0,
        Status::Untested => 1,
        Status::Failed => 2,
    };
    checks.iter().map(|check| check.status).max_by_key(worse)
}

fn run_anchor(run: &str) -> String {
    format!("run/{run}")
}

fn rows_anchor(question: &Question, run: &str) -> String {
    format!("rows/{}/{run}", question.id)
}

/// The checks of a run, folded if all passed.
fn run_section(input: &ReportInput, run: &str, checks: &[&Check]) -> Markup {
    let status = worst(checks).unwrap_or(Status::Untested);
    let groups = QUESTIONS
        .iter()
        .map(|question| (question, answers(question, checks)));
    html! {
        details.printed id=(run_anchor(run)) open[status != Status::Passed] {
            summary {
                (Mark::of(status).badge()) " "
                (run_title(input, run)) ": " (checks.len()) " "
                @if checks.len() == 1 { "check" } @else { "checks" }
            }
            table.checks {
                thead {
                    tr {
                        th scope="col" { "Check" }
                        th scope="col" { "Measured" }
                        th scope="col" { "Limit" }
                        th scope="col" { "Status" }
                        th scope="col" { "Detail" }
                    }
                }
                @for (question, checks) in groups.filter(|(_, checks)| !checks.is_empty()) {
                    tbody id=(rows_anchor(question, run)) {
                        @for check in checks { (row(check)) }
                    }
                }
            }
        }
    }
}

/// The title of the run or manoeuvre with the given id; the id itself without one.
fn run_title<'a>(input: &ReportInput<'a>, id: &'a str) -> &'a str {
    let runs = input.runs.iter().map(|run| (&run.id, &run.title));
    let drives = input.drives.iter().map(|drive| (&drive.id, &drive.title));
    match runs.chain(drives).find(|(known, _)| *known == id) {
        Some((_, title)) => title,
        None if id == ECU => "Firmware image, all runs",
        None => id,
    }
}

/// Run that the checks of the image and of all runs name.
const ECU: &str = "ecu";

fn row(check: &Check) -> Markup {
    html! {
        tr id=(check.id) {
            th scope="row" { (check.title) }
            td.figure data-name="Measured" { (measured(check)) }
            td.figure data-name="Limit" { (limit_shown(check)) }
            td data-name="Status" { (Mark::of(check.status).badge()) }
            td.detail { (check.detail) }
        }
    }
}

fn limit_shown(check: &Check) -> String {
    limit(check)
        .replace("<=", "\u{2264}")
        .replace(">=", "\u{2265}")
}

fn drawn(figure: &Figure) -> Markup {
    let caption = html! { (figure.caption) };
    page::figure(&figure.name, &figure.svg, &caption)
}

fn notes(notes: &[(String, String)]) -> Markup {
    html! {
        table.notes {
            @for (name, value) in notes {
                tr { th scope="row" { (name) } td { (value) } }
            }
        }
    }
}

fn proofs(proofs: &[(String, String)]) -> Markup {
    html! {
        p {
            "Recorded in the repository; the tests compare them with the present firmware. Stack, memory, instructions and \
             interrupts measured in these runs are among the checks. The texts are not printed unless they are unfolded."
        }
        @for (name, text) in proofs {
            details {
                summary { (name) }
                pre { (text) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn sample_page(figures: &[Figure]) -> String {
        let (verdict, runs, pairs) = (sample::verdict(), sample::runs(), sample::pairs());
        report(&sample::input(&verdict, &runs, &pairs), figures).into_string()
    }

    #[test]
    fn every_check_and_note_is_there_and_escaped() {
        let page = sample_page(&[]);
        let escaped = |text: &str| html!((text)).into_string();
        for check in sample::verdict().checks {
            for text in [&check.id, &check.title, &check.detail] {
                assert!(page.contains(&escaped(text)), "{text}");
            }
        }
        assert!(page.contains("drift &lt; bound"));
        assert!(!page.contains("drift < bound"));
        assert!(page.contains("5 passed, 1 failed, 1 untested"));
        assert!(page.contains("FAIL"));
        assert!(page.contains("Revision"));
    }

    #[test]
    fn every_cell_of_the_matrix_leads_to_its_rows() {
        let page = sample_page(&[]);
        assert!(page.contains(">1750 rpm, square dither 0.1 V</a></th>"));
        let links: Vec<&str> = page.split("href=\"#").skip(1).collect();
        assert!(links.len() > 10);
        for link in links {
            let target = link.split('"').next().unwrap();
            assert!(page.contains(&format!("id=\"{target}\"")), "{target}");
        }
    }

    #[test]
    fn a_cell_has_the_worst_status_of_its_checks() {
        let untested = Check::untested("bits/a", "title", "reason");
        let passed = Check::equals("bits/a", "title", 0.0, 0.0);
        let failed = Check::equals("bits/a", "title", 1.0, 0.0);
        let of = |checks: &[&Check]| cell(&QUESTIONS[0], "a", checks);
        assert!(of(&[]).is_none());
        assert_eq!(of(&[&passed]).unwrap().text, "0");
        let mixed = of(&[&passed, &untested]).unwrap();
        assert_eq!((mixed.mark, &*mixed.text), (Mark::UNTESTED, "1 of 2"));
        let mark = of(&[&failed, &untested, &passed]).unwrap().mark;
        assert_eq!(mark, Mark::FAILED);
    }

    #[test]
    fn only_runs_that_passed_are_folded() {
        let page = sample_page(&[]);
        assert!(page.contains("id=\"run/1750-none\">"));
        assert!(page.contains("id=\"run/1750-square\" open>"));
    }

    #[test]
    fn the_page_needs_no_other_file() {
        let figure = Figure {
            name: "name".into(),
            caption: "caption".into(),
            svg: "<svg></svg>".into(),
        };
        let page = sample_page(&[figure]);
        assert!(page.contains("<svg></svg>"));
        for outside in ["src=", "href=\"h", "url(", "@import", "<script"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
