//! The report as one HTML page that needs nothing beside it.

use super::ReportInput;
use super::figure::Figure;
use super::text::{by_run, counts, limit, measured, run_of, status_word};
use crate::verdict::{Check, Status};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page with the common style.
pub fn document(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    }
}

/// The page: verdict, checks, notes, figures.
pub fn page(input: &ReportInput, figures: &[Figure]) -> Markup {
    let body = html! {
        h1 { (input.title) }
        (banner(input))
        (not_passed(input))
        nav {
            a href="#checks" { "Checks" }
            @if !input.notes.is_empty() { a href="#notes" { "Notes" } }
            @if !input.proofs.is_empty() { a href="#proofs" { "Firmware proofs" } }
            a href="#figures" { "Figures" }
        }
        h2 #checks { "Checks" }
        (checks(input))
        @if !input.notes.is_empty() {
            h2 #notes { "Notes" }
            (notes(input.notes))
        }
        @if !input.proofs.is_empty() {
            h2 #proofs { "Firmware proofs" }
            (proofs(input.proofs))
        }
        h2 #figures { "Figures" }
        @for figure in figures {
            figure id=(figure.name) {
                div.drawing { (PreEscaped(&figure.svg)) }
                figcaption { (figure.caption) }
            }
        }
    };
    document(input.title, &body)
}

fn banner(input: &ReportInput) -> Markup {
    let (class, word) = if input.verdict.passed() {
        ("banner passed", "PASS")
    } else {
        ("banner failed", "FAIL")
    };
    html! {
        p class=(class) {
            strong { (word) }
            " "
            span { (counts(input.verdict)) }
        }
    }
}

/// The checks that did not pass, so that they need not be looked for.
fn not_passed(input: &ReportInput) -> Markup {
    let checks = || input.verdict.checks.iter();
    let rest = || checks().filter(|check| check.status != Status::Passed);
    html! {
        @if rest().next().is_some() {
            ul {
                @for check in rest() {
                    li {
                        (status(check)) " "
                        a href={ "#" (check.id) } {
                            (run_title(input, run_of(check))) ": " (check.title)
                        }
                    }
                }
            }
        }
    }
}

fn checks(input: &ReportInput) -> Markup {
    html! {
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
            @for (run, checks) in by_run(input.verdict) {
                tbody {
                    tr { th.group scope="rowgroup" colspan="5" { (run_title(input, run)) } }
                    @for check in checks { (row(check)) }
                }
            }
        }
    }
}

/// The title of the run with the given id; the id itself if it is none of the report's.
fn run_title<'a>(input: &ReportInput<'a>, id: &'a str) -> &'a str {
    let run = input.runs.iter().find(|run| run.id == id);
    run.map_or(id, |run| &run.title)
}

fn row(check: &Check) -> Markup {
    html! {
        tr id=(check.id) {
            th scope="row" { (check.title) }
            td.figure data-name="Measured" { (measured(check)) }
            td.figure data-name="Limit" { (limit(check)) }
            td data-name="Status" { (status(check)) }
            td.detail { (check.detail) }
        }
    }
}

fn status(check: &Check) -> Markup {
    let word = status_word(check.status);
    let symbol = match check.status {
        Status::Passed => "\u{2713}",
        Status::Failed => "\u{2717}",
        Status::Untested => "?",
    };
    html! { span class={ "status " (word) } { (symbol) " " (word) } }
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
            "As recorded in the repository, where the tests compare them with the present firmware. What this run itself \
             measured of stack, memory, instructions and interrupts is among the checks, under \u{201c}ecu\u{201d} and under each \
             run."
        }
        @for (name, text) in proofs {
            details {
                summary { (name) }
                pre { (text) }
            }
        }
    }
}

/// Dark on white; the status colours have a contrast of at least 7 to 1 with their text.
const STYLE: &str = "
:root { color-scheme: only light; }
body { font: 16px/1.45 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 64rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0.5rem 0 1rem; }
h2 { font-size: 1.25rem; margin: 2rem 0 0.6rem; }
.banner { display: flex; flex-wrap: wrap; align-items: baseline; gap: 0.2rem 1.2rem; margin: 0;
  padding: 0.8rem 1.2rem; border: 2px solid; border-radius: 0.4rem; font-size: 1.15rem; }
.banner strong { font-size: 2.6rem; line-height: 1.1; }
.passed { color: #0f4a1c; background: #e4f4e7; border-color: #2c7a3c; }
.failed { color: #7d0c0c; background: #fde6e6; border-color: #b31b1b; }
.untested { color: #5a3c00; background: #fff2cc; border-color: #b58900; }
ul { list-style: none; margin: 1rem 0 0; padding: 0; }
li { margin: 0.3rem 0; }
nav { display: flex; gap: 1.2rem; margin-top: 1rem; }
a { color: #123f8c; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 0.35rem 0.6rem;
  border-bottom: 1px solid #d5d5d5; }
thead th { border-bottom: 2px solid #1a1a1a; }
tbody th { font-weight: normal; }
tbody th.group { font-weight: bold; padding-top: 1rem; }
td.figure, .status { white-space: nowrap; font-variant-numeric: tabular-nums; }
.status { display: inline-block; padding: 0 0.5rem; border: 1px solid; border-radius: 0.3rem; }
td.detail { font-size: 0.9rem; color: #404040; overflow-wrap: anywhere; }
pre { overflow-x: auto; font-size: 0.85rem; line-height: 1.3; }
.notes { width: auto; }
.notes td { overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
figure { margin: 0 0 2rem; break-inside: avoid; }
.drawing { overflow-x: auto; }
.drawing svg { display: block; width: 100%; min-width: 40rem; height: auto; }
figcaption { font-size: 0.95rem; color: #404040; margin-top: 0.3rem; }
@media (max-width: 44rem) {
  .checks thead { position: absolute; clip-path: inset(50%); height: 1px; overflow: hidden; }
  .checks, .checks tbody, .checks tr, .checks th, .checks td { display: block; }
  .checks tr { border-bottom: 1px solid #d5d5d5; padding: 0.4rem 0; }
  .checks th, .checks td { border: 0; padding: 0.1rem 0; }
  td.figure { white-space: normal; }
  td[data-name]::before { content: attr(data-name) \": \"; color: #404040; }
}
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  .drawing svg { min-width: 0; max-height: 24cm; }
  nav { display: none; }
  thead { display: table-header-group; }
  tr { break-inside: avoid; }
  .banner, .status { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn sample_page(figures: &[Figure]) -> String {
        let (verdict, runs, pairs) = (sample::verdict(), sample::runs(), sample::pairs());
        page(&sample::input(&verdict, &runs, &pairs), figures).into_string()
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
    fn runs_give_the_groups_their_titles() {
        let page = sample_page(&[]);
        assert!(page.contains(">1750 rpm, square dither 0.1 V</th>"));
    }

    #[test]
    fn the_page_needs_nothing_beside_it() {
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
