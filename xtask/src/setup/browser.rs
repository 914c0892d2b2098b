//! A browser for the test of the page: Chromium, Node.js, and the npm package that drives the one
//! from the other, which is installed below target/.

use std::fmt;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::host::{Apt, Manager};
use crate::{process, workspace};

/// Names of Chromium and of Chrome, the package's first.
const BROWSERS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];
const NODE: &str = "node";
const NPM: &str = "npm";
/// The driver and its exact version, and their checksums.
const MANIFESTS: [&str; 2] = ["package.json", "package-lock.json"];

/// What the test of the page runs on.
pub struct Found {
    browser: PathBuf,
    node: PathBuf,
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.browser.display(), self.node.display())
    }
}

/// Browser and Node.js; `None` unless the driver is installed as pinned.
pub fn found() -> Result<Option<Found>> {
    let folder = folder()?;
    let read = |folder: &Path| MANIFESTS.map(|name| fs::read(folder.join(name)).ok());
    if read(&folder) != read(&sources()) || !folder.join("complete").is_file() {
        return Ok(None);
    }
    Ok(programs())
}

/// Installs what is missing; the driver again if its version changed.
pub fn ensure() -> Result<()> {
    if found()?.is_none() {
        install().context("the page would be untested")?;
    }
    // The test starts the programs by these names.
    let Found { browser, node } = found()?.context("the browser's set-up is incomplete")?;
    for (name, program) in [("chromium", browser), (NODE, node)] {
        let link = folder()?.join(name);
        let _ = fs::remove_file(&link);
        symlink(&program, &link).with_context(|| format!("cannot create {}", link.display()))?;
    }
    Ok(())
}

/// The steps of set-up.
pub fn plan() -> String {
    match (packages().as_slice(), Apt::here()) {
        ([], _) => "set-up would: `npm ci` of tests/browser into target/browser".to_owned(),
        (packages, Some(_)) => format!(
            "set-up would: `apt-get install {}`, then `npm ci` of tests/browser into target/browser",
            packages.join(" ")
        ),
        (_, None) => format!("not by set-up: {}", by_hand()),
    }
}

fn install() -> Result<()> {
    let packages = packages();
    if !packages.is_empty() {
        let Some(apt) = Apt::here() else {
            bail!("{} missing: {}", packages.join(", "), by_hand());
        };
        println!(
            "setup: installing the system's packages {}",
            packages.join(" ")
        );
        for package in packages {
            apt.bring(package).with_context(by_hand)?;
        }
    }
    let folder = folder()?;
    println!(
        "setup: installing the npm packages of {} into {}",
        sources().display(),
        folder.display()
    );
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for name in MANIFESTS {
        let from = sources().join(name);
        fs::copy(&from, folder.join(name))
            .with_context(|| format!("cannot copy {}", from.display()))?;
    }
    let npm = process::find(NPM).context("npm is not on PATH")?;
    let mut npm = Command::new(npm);
    // Its scripts would download browsers.
    npm.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"])
        .current_dir(&folder);
    process::run(&mut npm).context(
        "npm could not install them: a registry that npm reaches is needed (npm_config_registry names another one), \
         then run this again",
    )?;
    // Last, so that an interrupted installation is repeated.
    fs::write(folder.join("complete"), "")?;
    Ok(())
}

fn programs() -> Option<Found> {
    Some(Found {
        browser: BROWSERS.into_iter().find_map(process::find)?,
        node: process::find(NODE)?,
    })
}

/// The Debian packages that are missing.
fn packages() -> Vec<&'static str> {
    let is_missing = |programs: &[&str]| programs.iter().all(|name| process::find(name).is_none());
    let needed: [(&'static str, &[&str]); 3] = [
        ("chromium", &BROWSERS),
        ("nodejs", &[NODE]),
        ("npm", &[NPM]),
    ];
    let missing = needed.into_iter().filter(|(_, names)| is_missing(names));
    missing.map(|(package, _)| package).collect()
}

/// The package's manifests.
fn sources() -> PathBuf {
    workspace::root().join("tests/browser")
}

/// The folder that `tests/page.rs` uses.
fn folder() -> Result<PathBuf> {
    Ok(workspace::target_dir()?.join("browser"))
}

/// The line to type.
fn by_hand() -> String {
    match Manager::of_this_machine() {
        Some(manager) => format!("type `{}`", manager.browser_line()),
        None => "install Chromium, and Node.js (https://nodejs.org)".to_owned(),
    }
}
