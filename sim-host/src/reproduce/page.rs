//! The page over all pieces.

use super::claims::says;
use super::job::{Options, Quality};
use super::material::Judgement;
use super::product::Product;
use crate::paper::Reproduced;
use anyhow::Context;
use files::output::{make_folder, write_json, write_text};
use maud::{Markup, PreEscaped, html};
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

/// Writes `index.html` and the claims.
pub fn write(
    folder: &Path,
    options: &Options,
    products: &[Product],
    judgements: &[Judgement],
) -> anyhow::Result<()> {
    write_json(&folder.join(CLAIMS), &judgements, true)?;
    let mut pieces = Vec::new();
    for product in products {
        pieces.push(piece(folder, product)?);
    }
    let body = html! {
        h1 { (TITLE) }
        @if options.quality == Quality::Quick {
            p { "A quick look: coarse sweeps and short runs. The verdicts may differ at full quality." }
        }
        h2 #claims { "Claims" }
        (table(judgements))
        @for piece in &pieces { (piece) }
    };
    let page = page::document(TITLE, &body).into_string();
    Ok(write_text(&folder.join("index.html"), &page, true)?)
}

fn table(judgements: &[Judgement]) -> Markup {
    html! {
        table.checks {
            thead {
                tr {
                    th scope="col" { "Claim" }
                    th scope="col" { "Preset" }
                    th scope="col" { "Measured" }
                    th scope="col" { "Distance" }
                    th scope="col" { "Verdict" }
                }
            }
            tbody {
                @for judgement in judgements {
                    @let (claim, place) = says(&judgement.claim);
                    tr {
                        td { (judgement.claim) ": " (claim) " (" (place) ")" }
                        td { (judgement.preset) }
                        td { (judgement.measured) }
                        td { (judgement.distance) }
                        td { span class={ "status " (class(judgement.verdict)) } { (judgement.verdict.words()) } }
                    }
                }
            }
        }
    }
}

fn class(verdict: Reproduced) -> &'static str {
    match verdict {
        Reproduced::Yes => "passed",
        Reproduced::No => "failed",
        Reproduced::InPart | Reproduced::Untested => "untested",
    }
}

fn piece(folder: &Path, product: &Product) -> anyhow::Result<Markup> {
    let mut drawings = Vec::new();
    for (name, caption) in &product.figures {
        let path = folder.join(format!("figures/{name}.svg"));
        let svg =
            fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        drawings.push((name, caption, svg));
    }
    Ok(html! {
        h2 { (product.title) }
        @if !product.findings.is_empty() {
            table.notes {
                tbody {
                    @for (what, found) in &product.findings {
                        tr { th scope="row" { (what) } td { (found) } }
                    }
                }
            }
        }
        @for (name, caption, svg) in &drawings {
            figure id=(name) {
                div.drawing { (PreEscaped(svg)) }
                figcaption { (caption) " Data: figures/" (name) ".csv" }
            }
        }
    })
}
