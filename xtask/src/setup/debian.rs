//! A target built from Debian's Rust packages, for machines where rustup cannot download.
//!
//! Debian's compiler comes with the source of its libraries. Their part that the target's programs
//! need is built once, into a folder that rustup links as one more toolchain. rustup's own
//! toolchains do not change.

use std::env;
use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::probe::{Target, builds};
use crate::host::{self, Apt};
use crate::{process, rustup, workspace};

const PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];
const RUSTC: &str = "/usr/bin/rustc";
const CARGO: &str = "/usr/bin/cargo";

/// The steps of set-up.
pub fn plan(target: &Target) -> String {
    format!(
        "Debian's {} and a toolchain {} made of them",
        PACKAGES.join(" "),
        target.debian_toolchain
    )
}

/// Installs the packages, builds the libraries and links the toolchain, each unless it is done
/// already.
pub fn install(target: &Target, pinned: &str) -> Result<()> {
    install_packages(pinned)?;
    let folder = folder(target)?;
    // The libraries may exist without being linked, or may belong to an older compiler.
    if !builds(target, Command::new(folder.join("bin/rustc")))? {
        build(target, pinned, &folder)?;
    }
    println!(
        "setup: linking {} into rustup as {}",
        folder.display(),
        target.debian_toolchain
    );
    process::run(
        rustup::rustup()?
            .args(["toolchain", "link", target.debian_toolchain])
            .arg(&folder),
    )
}

/// Lets plain `cargo` in firmware/ use a toolchain, unless it does already.
pub fn use_in_firmware_folder(toolchain: &str) -> Result<()> {
    let firmware = workspace::firmware();
    let active = process::capture(
        rustup::rustup()?
            .args(["show", "active-toolchain"])
            .current_dir(&firmware),
    );
    if active.is_some_and(|line| line.split_whitespace().next() == Some(toolchain)) {
        return Ok(());
    }
    println!(
        "setup: a rustup override lets cargo in {} use {toolchain}",
        firmware.display()
    );
    process::run(
        rustup::rustup()?
            .args(["override", "set", toolchain, "--path"])
            .arg(&firmware),
    )
}

fn install_packages(pinned: &str) -> Result<()> {
    let ready = |package: &&str| {
        let version = host::installed(package);
        host::require_at_least(package, version.as_deref(), pinned).is_ok()
    };
    if PACKAGES.iter().all(ready) {
        return Ok(());
    }
    if process::find("apt-get").is_none() {
        bail!("rustup could not download it, and there is no apt-get to fall back on");
    }
    let line = PACKAGES.join(" ");
    let Some(apt) = Apt::here() else {
        bail!(
            "Debian's packages are an alternative: `sudo apt-get update && sudo apt-get install --no-install-recommends {line}`"
        );
    };
    println!(
        "setup: installing the system's packages {line} (compiler in /usr/bin; rustup's stays first on PATH)"
    );
    // A list of packages from before a security update names a compiler that is too old.
    apt.update()?;
    for package in PACKAGES {
        host::require_at_least(
            &format!("Debian's {package}"),
            host::candidate(package).as_deref(),
            pinned,
        )?;
    }
    apt.install(&PACKAGES)
}

/// Where the toolchain lies.
fn folder(target: &Target) -> Result<PathBuf> {
    let data = env::var_os("XDG_DATA_HOME")
        .map(PathBuf::from)
        .filter(|folder| folder.is_absolute());
    let data = data.or_else(|| Some(env::home_dir()?.join(".local").join("share")));
    Ok(data
        .context("neither XDG_DATA_HOME nor HOME is set")?
        .join("dithersteer")
        .join(target.debian_folder))
}

fn compiler_version() -> Result<String> {
    process::capture(Command::new(RUSTC).arg("-vV"))
        .with_context(|| format!("{RUSTC} does not run"))
}

/// Builds the toolchain's folder beside its place, and moves it there when it is complete.
fn build(target: &Target, pinned: &str, folder: &Path) -> Result<()> {
    println!(
        "setup: building the libraries for {} into {} (about a minute)",
        target.name,
        folder.display()
    );
    let work = folder.with_extension("new");
    if work.exists() {
        // From an interrupted set-up.
        fs::remove_dir_all(&work).with_context(|| format!("cannot remove {}", work.display()))?;
    }
    let libraries = build_libraries(target, &work)?;
    let new = work.join("toolchain");
    assemble(target, pinned, &libraries, &new, folder)?;
    replace(&new, folder)?;
    fs::remove_dir_all(&work).with_context(|| format!("cannot remove {}", work.display()))
}

/// Compiles the target's libraries from Debian's source, and returns the folder they end up in.
fn build_libraries(target: &Target, work: &Path) -> Result<PathBuf> {
    let sysroot = process::capture(Command::new(RUSTC).args(["--print", "sysroot"]));
    let sysroot = PathBuf::from(sysroot.with_context(|| format!("{RUSTC} does not run"))?);
    let vendored = sysroot.join("lib/rustlib/src/rust/library/vendor");
    let krate = work.join("empty");
    let folder = krate.join("src");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    fs::write(folder.join("lib.rs"), "#![no_std]\n")?;
    fs::write(
        krate.join("Cargo.toml"),
        "[package]\nname = \"empty\"\nedition = \"2024\"\n[workspace]\n[profile.release]\ncodegen-units = 1\n",
    )?;
    let mut cargo = Command::new(CARGO);
    cargo.current_dir(&krate).args([
        "--offline",
        "--config",
        "source.crates-io.replace-with='vendored'",
        "--config",
    ]);
    cargo.arg(format!(
        "source.vendored.directory='{}'",
        vendored.display()
    ));
    cargo.args(["build", "--release", "--target", target.name]);
    cargo.arg(format!("-Zbuild-std={}", target.libraries));
    cargo.arg("-Zbuild-std-features=compiler-builtins-mem");
    // An own cargo home, so that the user's configuration does not apply; bitcode, so that the
    // programs can use LTO.
    cargo
        .env("CARGO_HOME", work.join("cargo-home"))
        .env("CARGO_TARGET_DIR", work.join("target"));
    cargo
        .env("RUSTC", RUSTC)
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", "-Cembed-bitcode=yes");
    for variable in [
        "CARGO_ENCODED_RUSTFLAGS",
        "RUSTC_WRAPPER",
        "RUSTUP_TOOLCHAIN",
        "CARGO",
    ] {
        cargo.env_remove(variable);
    }
    process::run(&mut cargo)?;
    Ok(work.join("target").join(target.name).join("release/deps"))
}

/// Puts a toolchain together: the new libraries, Debian's own for build scripts and macros,
/// rustup's linker.
fn assemble(
    target: &Target,
    pinned: &str,
    libraries: &Path,
    new: &Path,
    place: &Path,
) -> Result<()> {
    let version = compiler_version()?;
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .context("rustc names no host")?;
    let rustlib = new.join("lib/rustlib");
    let for_target = rustlib.join(target.name).join("lib");
    fs::create_dir_all(&for_target)?;
    for entry in fs::read_dir(libraries)? {
        let entry = entry?;
        let name = entry.file_name();
        if name.to_string_lossy().ends_with(".rlib")
            && !name.to_string_lossy().starts_with("libempty-")
        {
            fs::copy(entry.path(), for_target.join(name))?;
        }
    }
    let for_host = rustlib.join(host);
    fs::create_dir_all(for_host.join("bin"))?;
    link(
        &Path::new("/usr/lib/rustlib").join(host).join("lib"),
        &for_host.join("lib"),
    )?;
    // Debian's compiler has no rust-lld, which is the target's linker.
    let linker = Path::new("lib/rustlib").join(host).join("bin/rust-lld");
    link(&rustup::folder(pinned)?.join(&linker), &new.join(&linker))?;
    fs::create_dir_all(new.join("bin"))?;
    script(
        &new.join("bin/rustc"),
        &format!("exec {RUSTC} --sysroot {} \"$@\"", quoted(place)),
    )?;
    script(&new.join("bin/cargo"), &format!("exec {CARGO} \"$@\""))?;
    Ok(())
}

/// Moves a complete toolchain to its place; an older one is removed.
fn replace(new: &Path, place: &Path) -> Result<()> {
    if place.exists() {
        fs::remove_dir_all(place).with_context(|| format!("cannot remove {}", place.display()))?;
    }
    fs::rename(new, place).with_context(|| format!("cannot create {}", place.display()))
}

fn link(to: &Path, at: &Path) -> Result<()> {
    symlink(to, at).with_context(|| format!("cannot create {}", at.display()))
}

fn script(path: &Path, line: &str) -> Result<()> {
    fs::write(path, format!("#!/bin/sh\n{line}\n"))?;
    fs::set_permissions(path, Permissions::from_mode(0o755))
        .with_context(|| format!("cannot make {} executable", path.display()))
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_one_word_for_the_shell() {
        assert_eq!(quoted(Path::new("/home/a b/$c")), "'/home/a b/$c'");
        assert_eq!(quoted(Path::new("/it's")), r"'/it'\''s'");
    }
}
