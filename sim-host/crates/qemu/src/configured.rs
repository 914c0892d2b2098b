//! The product's image with a configuration in its flash.

use image::Image;
use shared_model::Scenario;
use shared_model::configuration::{BLOCK_LEN, CONFIGURATION_LEN, Part, block};
use std::ops::Range;

/// The linker's section of the configuration.
const SECTION: &str = ".configuration";

/// Place of the configuration in an image's bytes; `None` if it is not the product's image.
pub fn place(image: &Image) -> Option<Range<usize>> {
    let place = image.place_of(SECTION)?;
    let end = place.start + CONFIGURATION_LEN;
    (end <= place.end).then_some(place.start..end)
}

/// The image with the scenario in its flash, for the board of that name; `None` if it is not the
/// product's image.
pub fn configured(image: &Image, scenario: &Scenario<f32>, board: &str) -> Option<Image> {
    let place = place(image)?;
    let mut configured = image.clone();
    let (application, gate) = configured.bytes[place].split_at_mut(BLOCK_LEN);
    application.copy_from_slice(&block(Part::Application, scenario, board));
    gate.copy_from_slice(&block(Part::Gate, scenario, board));
    Some(configured)
}
