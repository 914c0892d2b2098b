//! Where an image of the firmware is, unless an option says so.

use anyhow::bail;
use std::env;
use std::path::{Path, PathBuf};

/// Variable with the folder of the images.
const VARIABLE: &str = "DITHERSTEER_FIRMWARE";
/// Folder of the images beside an installed program.
const INSTALLED: &str = "firmware";
/// Folder of the images that a build makes, within its target folder.
const BUILT: &str = "thumbv7em-none-eabihf/firmware";

/// The image `name`: in the folder that the variable DITHERSTEER_FIRMWARE names; without it, in
/// `firmware/` beside this program, among the builds of this program's checkout, or among those of
/// the working directory.
///
/// # Errors
/// If it is in none of these folders.
pub fn image(name: &str) -> anyhow::Result<PathBuf> {
    let places: Vec<PathBuf> = folders().iter().map(|folder| folder.join(name)).collect();
    if let Some(found) = places.iter().find(|place| place.is_file()) {
        return Ok(found.clone());
    }
    let places: Vec<String> = places
        .iter()
        .map(|place| place.display().to_string())
        .collect();
    bail!(
        "no firmware image: there is no {}; build it with `cargo xtask firmware`, or give its path by \
         --firmware or its folder by the variable {VARIABLE}",
        places.join(", no ")
    )
}

fn folders() -> Vec<PathBuf> {
    if let Some(folder) = env::var_os(VARIABLE).filter(|folder| !folder.is_empty()) {
        return vec![folder.into()];
    }
    let program = env::current_exe().unwrap_or_default();
    let beside = program.parent();
    let target = beside.and_then(Path::parent);
    let mut folders: Vec<PathBuf> = beside
        .map(|folder| folder.join(INSTALLED))
        .into_iter()
        .collect();
    folders.extend(target.map(|folder| folder.join(BUILT)));
    folders.push(Path::new("target").join(BUILT));
    folders
}
