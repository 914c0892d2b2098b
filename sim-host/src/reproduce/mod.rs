//! Reproduction of the paper: its figures, its claims, its errata and further measurements.
//! Complete pieces are kept and not computed again.

mod beyond;
mod characteristics;
mod claims;
mod errata;
mod figures;
mod job;
mod material;
mod measures;
mod page;
mod pieces;
mod product;
mod sensitivity;
mod sweeps;

pub use job::{Options, Progress, Quality, Summary};
pub use material::Judgement;
pub use page::CLAIMS;
#[doc(hidden)]
pub use product::Product;

use anyhow::Context;
use dynamics::sweep::RunControl;
use pieces::Piece;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Computes the pieces that are not yet in `folder`, and writes the page over all pieces.
///
/// # Errors
/// If a file cannot be written or a scenario is not valid.
pub fn reproduce(
    folder: &Path,
    options: &Options,
    stop: &AtomicBool,
    on_progress: &(dyn Fn(Progress) + Sync),
) -> anyhow::Result<Summary> {
    page::begin(folder)?;
    let pieces = pieces::all(options);
    let of = pieces.len();
    let mut products = Vec::with_capacity(of);
    let kept: Vec<Option<Product>> = pieces
        .iter()
        .map(|piece| piece.kept(folder, options))
        .collect();
    let to_make = pieces.iter().zip(&kept).filter(|(_, kept)| kept.is_none());
    let all: f64 = to_make.map(|(piece, _)| piece.weight).sum();
    let mut made = 0.0;
    for (k, (piece, kept)) in pieces.iter().zip(kept).enumerate() {
        on_progress(Progress::Begins {
            number: k + 1,
            of,
            title: piece.title.clone(),
            kept: kept.is_some(),
            done: if all > 0.0 { made / all } else { 1.0 },
        });
        let product = match kept {
            Some(product) => product,
            None => match make(piece, folder, options, stop, on_progress)? {
                Some(product) => {
                    made += piece.weight;
                    product
                }
                None => break,
            },
        };
        products.push(product);
    }
    let mut judgements: Vec<Judgement> = products
        .iter()
        .flat_map(|product: &Product| product.judgements.clone())
        .collect();
    judgements.sort_by(|a, b| a.claim.cmp(&b.claim));
    page::write(folder, options, &pieces, &products, &judgements)?;
    Ok(Summary {
        judgements,
        complete: products.len() == of,
    })
}

/// The piece's product, written to the folder; none if it was stopped before it was complete.
fn make(
    piece: &Piece,
    folder: &Path,
    options: &Options,
    stop: &AtomicBool,
    on_progress: &(dyn Fn(Progress) + Sync),
) -> anyhow::Result<Option<Product>> {
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let done = || on_progress(Progress::Point);
    let watch = RunControl { stop, done: &done };
    let made = (piece.make)(&piece.scenario, options.quality, watch);
    let made = made.with_context(|| format!("{} cannot be computed", piece.title))?;
    // An incomplete sweep is discarded: the next run computes it again.
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    Ok(Some(piece.write(folder, options, made)?))
}
