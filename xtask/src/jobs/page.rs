//! `cargo xtask page`: the model for the browser, in one HTML file.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::compress_to_vec;

use super::stage;
use crate::outcome::Exit;
use crate::setup::probe::BROWSER;
use crate::{process, rustup, setup, workspace};

/// Greatest size of the file, bytes.
const MOST_BYTES: usize = 300_000;
/// Deflate's best but slowest.
const COMPRESSION: u8 = 10;
/// The page's scripts beside `model.js`, each using those before it.
const SCRIPTS: [&str; 6] = [
    "presets.js",
    "controls.js",
    "axes.js",
    "plots.js",
    "playback.js",
    "page.js",
];

/// Sets up the target, and builds the page.
pub fn run() -> Result<()> {
    let toolchain = stage("set-up", || setup::target::ensure(&BROWSER))?;
    build(&toolchain)
}

/// Builds the page with a toolchain that has the target.
pub fn build(toolchain: &str) -> Result<()> {
    let module = stage("model for the browser", || compile(toolchain))?;
    let page = assemble(&module)?;
    ensure!(
        page.len() <= MOST_BYTES,
        Exit::failed(format!(
            "the page has {} bytes: at most {MOST_BYTES} are allowed",
            page.len()
        ))
    );
    let file = workspace::target_dir()?.join("page").join("index.html");
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(&file, &page).with_context(|| format!("cannot write {}", file.display()))?;
    println!("{} bytes: {}", page.len(), file.display());
    Ok(())
}

fn compile(toolchain: &str) -> Result<PathBuf> {
    let target_dir = workspace::target_dir()?;
    let mut cargo = rustup::cargo(toolchain)?;
    cargo
        .args(["build", "--profile", "page", "--package", "page"])
        .args(["--target", BROWSER.name])
        .args(workspace::locked())
        .arg("--target-dir")
        .arg(&target_dir);
    process::run(&mut cargo)?;
    Ok(target_dir.join(BROWSER.name).join("page").join("page.wasm"))
}

/// The page with its style, scripts and model in their places.
fn assemble(module: &Path) -> Result<String> {
    let folder = workspace::root().join("page").join("web");
    let read = |name: &str| {
        let file = folder.join(name);
        fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))
    };
    let module = fs::read(module).with_context(|| format!("cannot read {}", module.display()))?;
    let scripts = SCRIPTS.map(read).into_iter().collect::<Result<String>>()?;
    let mut page = read("index.html")?;
    for (place, content) in [
        ("/*style*/", read("style.css")?),
        ("/*model*/", read("model.js")?),
        ("/*measuring*/", read("measuring.js")?),
        (
            "/*module*/",
            STANDARD.encode(compress_to_vec(&module, COMPRESSION)),
        ),
        ("/*scripts*/", scripts),
    ] {
        ensure!(
            page.matches(place).count() == 1,
            "page/web/index.html has not one place {place}"
        );
        page = page.replace(place, &content);
    }
    Ok(page)
}
