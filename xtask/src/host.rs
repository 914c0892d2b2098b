//! The machine's package managers: the command to run, or the line to type.

use std::io::{self, IsTerminal};
use std::process::Command;

use anyhow::{Result, bail};

use crate::process;

/// The supported package managers, in the order of the search.
const MANAGERS: [Manager; 3] = [Manager::Apt, Manager::Dnf, Manager::Pacman];

/// A package manager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manager {
    /// Debian, Ubuntu; the only one that set-up runs itself.
    Apt,
    /// Fedora.
    Dnf,
    /// Arch.
    Pacman,
}

impl Manager {
    /// The first one on PATH.
    pub fn of_this_machine() -> Option<Self> {
        MANAGERS
            .into_iter()
            .find(|manager| process::find(manager.program()).is_some())
    }

    fn program(self) -> &'static str {
        match self {
            Self::Apt => "apt-get",
            Self::Dnf => "dnf",
            Self::Pacman => "pacman",
        }
    }

    /// The one line to type for Python 3 with its module venv.
    pub fn python_line(self) -> &'static str {
        match self {
            Self::Apt => "sudo apt-get update && sudo apt-get install python3-venv",
            Self::Dnf => "sudo dnf install python3",
            Self::Pacman => "sudo pacman -S python",
        }
    }

    /// The one line to type for the C compiler of Cortex-M.
    pub fn arm_gcc_line(self) -> &'static str {
        match self {
            Self::Apt => {
                "sudo apt-get update && sudo apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi"
            }
            Self::Dnf => "sudo dnf install arm-none-eabi-gcc-cs arm-none-eabi-newlib",
            Self::Pacman => "sudo pacman -S arm-none-eabi-gcc arm-none-eabi-newlib",
        }
    }

    /// The one line to type for the browser of the page's test.
    pub fn browser_line(self) -> &'static str {
        match self {
            Self::Apt => {
                "sudo apt-get update && sudo apt-get install --no-install-recommends chromium nodejs npm"
            }
            Self::Dnf => "sudo dnf install chromium nodejs npm",
            Self::Pacman => "sudo pacman -S chromium nodejs npm",
        }
    }

    /// The one line to type for QEMU.
    pub fn qemu_line(self) -> &'static str {
        match self {
            Self::Apt => {
                "sudo apt-get update && sudo apt-get install --no-install-recommends qemu-system-arm"
            }
            Self::Dnf => "sudo dnf install qemu-system-arm",
            Self::Pacman => "sudo pacman -S qemu-system-arm",
        }
    }
}

/// How xtask can install packages.
#[derive(Clone, Copy)]
pub enum Apt {
    /// As root.
    Root,
    /// With sudo, which prompts for a password on the terminal.
    Sudo,
}

impl Apt {
    /// `None` where there is no apt-get, or no terminal for a password.
    pub fn here() -> Option<Self> {
        process::find("apt-get")?;
        if process::capture(Command::new("id").arg("-u")).as_deref() == Some("0") {
            return Some(Self::Root);
        }
        (io::stdin().is_terminal() && process::find("sudo").is_some()).then_some(Self::Sudo)
    }

    /// Fetches the lists of packages. A source that fails is no reason to stop: another may have
    /// the package.
    pub fn update(self) -> Result<()> {
        if !process::status(self.apt_get().args(["-q", "update"]))?.success() {
            println!("   apt-get update did not fetch everything; continuing with the known lists");
        }
        Ok(())
    }

    /// Installs a package; before that fetches the lists of packages where they lack it, or name
    /// files that are gone.
    pub fn bring(self, package: &str) -> Result<()> {
        if candidate(package).is_some() && self.install(&[package]).is_ok() {
            return Ok(());
        }
        self.update()?;
        self.install(&[package])
    }

    /// Installs packages without the recommended ones.
    pub fn install(self, packages: &[&str]) -> Result<()> {
        let mut command = self.apt_get();
        command
            .args(["-q", "-y", "install", "--no-install-recommends"])
            .args(packages);
        process::run(&mut command)
    }

    fn apt_get(self) -> Command {
        // Through `env`, as sudo passes no environment on; and another apt-get may hold the lock
        // for a while.
        let words = [
            "env",
            "DEBIAN_FRONTEND=noninteractive",
            "apt-get",
            "-o",
            "DPkg::Lock::Timeout=120",
        ];
        let mut command = match self {
            Self::Root => Command::new(words[0]),
            Self::Sudo => Command::new("sudo"),
        };
        match self {
            Self::Root => command.args(&words[1..]),
            Self::Sudo => command.args(words),
        };
        command
    }
}

/// The version that apt would install; `None` if there is no such package.
pub fn candidate(package: &str) -> Option<String> {
    let policy = process::capture(
        Command::new("apt-cache")
            .env("LC_ALL", "C")
            .args(["policy", package]),
    )?;
    candidate_in(&policy).map(str::to_owned)
}

/// The version of a package that is installed.
pub fn installed(package: &str) -> Option<String> {
    let query = ["-W", "-f=${db:Status-Status} ${Version}", package];
    let answer = process::capture(Command::new("dpkg-query").args(query))?;
    answer.strip_prefix("installed ").map(str::to_owned)
}

/// Major and minor version at the start of a version string.
pub fn major_minor(version: &str) -> Option<(u32, u32)> {
    let mut numbers = version.split(|c: char| !c.is_ascii_digit());
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

/// An error unless a version is at least as new as another, by major and minor version.
pub fn require_at_least(what: &str, version: Option<&str>, needed: &str) -> Result<()> {
    match version {
        Some(version) if major_minor(version) >= major_minor(needed) => Ok(()),
        Some(version) => bail!("{what} is at {version}, and {needed} is needed"),
        None => bail!("{what} is not available"),
    }
}

fn candidate_in(policy: &str) -> Option<&str> {
    let version = policy
        .lines()
        .find_map(|line| line.trim_start().strip_prefix("Candidate:"))?
        .trim();
    (version != "(none)").then_some(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidate_is_found() {
        let policy = "rustc-web:\n  Installed: (none)\n  Candidate: 1.96.0+dfsg1-1~deb12u2\n  Version table:\n";
        assert_eq!(candidate_in(policy), Some("1.96.0+dfsg1-1~deb12u2"));
        assert_eq!(
            candidate_in("x:\n  Installed: (none)\n  Candidate: (none)\n"),
            None
        );
        assert_eq!(candidate_in(""), None);
    }

    #[test]
    fn versions_compare_as_numbers() {
        assert_eq!(major_minor("1.96.0+dfsg1-1~deb12u2"), Some((1, 96)));
        assert_eq!(major_minor("1.100"), Some((1, 100)));
        assert_eq!(major_minor("stable"), None);
        assert!(require_at_least("rustc", Some("1.100.0"), "1.95.0").is_ok());
        assert!(require_at_least("rustc", Some("1.95.2"), "1.95.9").is_ok());
        assert!(require_at_least("rustc", Some("1.85.0+dfsg3"), "1.95.0").is_err());
        assert!(require_at_least("rustc", None, "1.95.0").is_err());
    }

    #[test]
    fn every_manager_names_itself_in_its_line() {
        for manager in MANAGERS {
            for line in [
                manager.qemu_line(),
                manager.python_line(),
                manager.arm_gcc_line(),
                manager.browser_line(),
            ] {
                assert!(line.contains(manager.program()), "{manager:?}");
            }
        }
    }
}
