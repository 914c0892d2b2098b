//! The page over all pieces.

use super::claims::says;
use super::job::{Options, Quality};
use super::material::Judgement;
use super::pieces::Piece;
use super::product::Product;
use crate::paper::{CLAIMS as ALL_CLAIMS, Claim, Reproduced};
use anyhow::Context;
use files::output::{make_folder, write_json, write_text};
use maud::{Markup, html};
use plot::matrix::{Cell, Column, Mark, Matrix, Row};
use plot::page;
use std::fs;
use std::path::Path;

const TITLE: &str = "Chang's chaotic vehicle and its dither, reproduced";

/// File with all judgements, which every reproduction has.
pub const CLAIMS: &str = "claims.json";

/// Makes the folder, and marks it as that of a reproduction before there are claims.
pub fn begin(folder: &Path) -> anyhow::Result<()> {
    make_folder(folder)?;
    let claims = folder.join(CLAIMS);
    if !claims.exists() {
        write_json(&claims, &Vec::<Judgement>::new(), true)?;
    }
    Ok(())
}

/// Writes `index.html` and the claims. The products are those of the first pieces.
pub fn write(
    folder: &Path,
    options: &Options,
    pieces: &[Piece],
    products: &[Product],
    judgements: &[Judgement],
) -> anyhow::Result<()> {
    write_json(&folder.join(CLAIMS), &judgements, true)?;
    let made: Vec<(&Piece, &Product)> = pieces.iter().zip(products).collect();
    let mut presets = Vec::new();
    for (name, _) in &options.scenarios {
        presets.push((name, preset(folder, name, &made, judgements)?));
    }
    let body = html! {
        h1 { (TITLE) }
        @if options.quality == Quality::Quick {
            p { "Quick: coarse sweeps and short runs. The verdicts may differ at full quality." }
        }
        (matrix(options, judgements))
        nav {
            @for (name, _) in &presets { a href={ "#preset/" (name) } { (name) } }
        }
        @for (name, sections) in &presets {
            h2 id={ "preset/" (name) } { "Figures and measurements: " (name) }
            (sections)
        }
    };
    let page = page::document(TITLE, &body).into_string();
    Ok(write_text(&folder.join("index.html"), &page, true)?)
}

/// Claims by presets. A cell is empty where the claim is not judged yet.
fn matrix(options: &Options, judgements: &[Judgement]) -> Markup {
    let names = || options.scenarios.iter().map(|(name, _)| name);
    let row = |claim: &Claim| Row {
        title: format!("{}: {} ({})", claim.id, claim.says, claim.place),
        target: None,
        cells: names()
            .map(|name| Some(cell(find(judgements, claim.id, name)?)))
            .collect(),
    };
    let column = |name: &String| Column {
        title: name.clone(),
        explanation: String::new(),
    };
    let matrix = Matrix {
        corner: "Claim of the paper: reproduced?".into(),
        columns: names().map(column).collect(),
        rows: ALL_CLAIMS.iter().map(row).collect(),
    };
    matrix.markup()
}

fn find<'a>(judgements: &'a [Judgement], claim: &str, preset: &str) -> Option<&'a Judgement> {
    judgements
        .iter()
        .find(|judgement| judgement.claim == claim && judgement.preset == preset)
}

fn cell(judgement: &Judgement) -> Cell {
    Cell {
        mark: mark(judgement.verdict),
        text: String::new(),
        title: judgement.measured.clone(),
        target: anchor(judgement),
    }
}

fn anchor(judgement: &Judgement) -> String {
    format!("{}/{}", judgement.claim, judgement.preset)
}

fn mark(verdict: Reproduced) -> Mark {
    match verdict {
        Reproduced::Yes => Mark::PASSED.worded("yes"),
        Reproduced::InPart => Mark::IN_PART,
        Reproduced::No => Mark::FAILED.worded("no"),
        Reproduced::Untested => Mark::UNTESTED,
    }
}

/// The pieces of a preset, those that judge or show claims first.
fn preset(
    folder: &Path,
    name: &str,
    made: &[(&Piece, &Product)],
    judgements: &[Judgement],
) -> anyhow::Result<Markup> {
    let own = made.iter().filter(|(piece, _)| piece.scenario.name == name);
    let mut own: Vec<_> = own.collect();
    own.sort_by_key(|(piece, _)| piece.claims.is_empty());
    let sections = own.into_iter().map(|(piece, product)| {
        let shown = piece.claims.iter();
        let shown = shown.filter_map(|claim| find(judgements, claim, name));
        section(folder, product, &shown.collect::<Vec<_>>())
    });
    let sections = sections.collect::<anyhow::Result<Vec<_>>>()?;
    Ok(html! { @for section in &sections { (section) } })
}

/// A piece: the paper's numbers beside the measured ones, the figures, and the findings.
fn section(folder: &Path, product: &Product, judgements: &[&Judgement]) -> anyhow::Result<Markup> {
    let mut drawings = Vec::new();
    for (name, caption) in &product.figures {
        let path = folder.join(format!("figures/{name}.svg"));
        let svg =
            fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let caption = html! { (caption) " Data: figures/" (name) ".csv" };
        drawings.push(page::figure(name, &svg, &caption));
    }
    let judged_here = |judgement: &Judgement| {
        let mut own = product.judgements.iter();
        own.any(|own| own.claim == judgement.claim)
    };
    Ok(html! {
        h3 { (product.title) }
        @if !judgements.is_empty() {
            table.checks {
                thead {
                    tr {
                        th scope="col" { "Paper" }
                        th scope="col" { "Measured" }
                        th scope="col" { "Distance" }
                        th scope="col" { "Verdict" }
                    }
                }
                tbody {
                    @for judgement in judgements {
                        tr id=[judged_here(judgement).then(|| anchor(judgement))] {
                            th scope="row" { (judgement.claim) ": " (says(&judgement.claim)) }
                            td data-name="Measured" { (judgement.measured) }
                            td data-name="Distance" { (judgement.distance) }
                            td data-name="Verdict" { (mark(judgement.verdict).worded(judgement.verdict.words()).badge()) }
                        }
                    }
                }
            }
        }
        @for drawing in &drawings { (drawing) }
        @if !product.findings.is_empty() {
            details.printed open[drawings.is_empty()] {
                summary { "Findings: " (product.findings.len()) }
                table.notes {
                    tbody {
                        @for (what, found) in &product.findings {
                            tr { th scope="row" { (what) } td { (found) } }
                        }
                    }
                }
            }
        }
    })
}
