//! The report as one HTML page that needs nothing beside it.

use super::figure::Figure;
use super::input::ReportInput;
use maud::{Markup, PreEscaped, html};
use plot::page;
use plot::text::{by_run, counts, limit, measured, run_of, status_word};
use plot::verdict::{Check, Status};

/// The page: verdict, checks, notes, figures.
pub fn report(input: &ReportInput, figures: &[Figure]) -> Markup {
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
    page::document(input.title, &body)
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
