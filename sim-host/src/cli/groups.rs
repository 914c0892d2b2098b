//! Groups of the subcommands in the help.

use clap::Command;
use std::fmt::Write;

/// A heading, and the subcommands below it with a summary of at most 60 characters.
type Group = (&'static str, &'static [(&'static str, &'static str)]);

const GROUPS: [Group; 4] = [
    (
        "Verification and firmware",
        &[
            (
                "verify",
                "firmware in QEMU compared with the host: report and verdict",
            ),
            (
                "pil",
                "manoeuvres with the ECU in the loop: MIL, SIL and PIL",
            ),
            (
                "faults",
                "fault injection into the loop, with detection and latency",
            ),
            (
                "firmware",
                "an image: configure, size and stack, run, telemetry",
            ),
        ],
    ),
    (
        "Analyses",
        &[
            ("simulate", "one trajectory as CSV"),
            (
                "lyapunov",
                "Lyapunov exponents by three independent methods",
            ),
            (
                "orbit",
                "orbit diagram over wheel speed or dither amplitude",
            ),
            (
                "continue",
                "branches of periodic orbits, with their bifurcations",
            ),
            (
                "regions",
                "regimes along a parameter, with their edges bisected",
            ),
            ("equilibria", "equilibria, eigenvalues, Hopf bifurcations"),
            (
                "basin",
                "basins of attraction over a grid of initial states",
            ),
            (
                "feedback",
                "unstable orbits held by delayed feedback of a sensor",
            ),
            ("phase", "phase portrait after the transient"),
            ("poincare", "Poincar\u{e9} section"),
            ("spectrum", "power spectrum by Welch's method"),
            (
                "map",
                "exponent, period and extent over speed and amplitude",
            ),
            (
                "schedule",
                "dither amplitude for each wheel speed: the ECU's table",
            ),
        ],
    ),
    (
        "The paper",
        &[
            ("reproduce", "all figures and claims, as one page"),
            (
                "averaging",
                "lowest frequency at which the dither may be averaged",
            ),
            ("tires", "cornering force against slip angle (Figure 2)"),
            (
                "nonlinearity",
                "effective nonlinearities (Figures 9 to 11, 14 to 16)",
            ),
            (
                "realisability",
                "torque and amplitude limits of a steering actuator",
            ),
        ],
    ),
    (
        "Tools",
        &[
            (
                "config",
                "complete configuration as TOML, with units and ranges",
            ),
            (
                "fmu",
                "ECU or vehicle as a unit for co-simulation by FMI 2.0",
            ),
            (
                "convergence",
                "error of the fixed step relative to the reference",
            ),
        ],
    ),
];

const TEMPLATE: &str =
    "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}Options:\n{options}{after-help}";

/// The command with its subcommands listed in groups.
pub fn show_in_groups(command: Command) -> Command {
    let mut list = String::new();
    for (heading, subcommands) in GROUPS {
        // Writing to a string cannot fail.
        let _ = writeln!(list, "{heading}:");
        for (name, summary) in subcommands {
            let _ = writeln!(list, "  {name:14} {summary}");
        }
        list.push('\n');
    }
    command
        .help_template(TEMPLATE)
        .before_help(format!("{}\n\n", list.trim_end()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn every_subcommand_is_in_one_group() {
        let command = crate::cli::Cli::command();
        let visible = command.get_subcommands().filter(|c| !c.is_hide_set());
        let mut visible: Vec<&str> = visible.map(Command::get_name).collect();
        let grouped = || GROUPS.iter().flat_map(|(_, subcommands)| *subcommands);
        assert!(grouped().all(|(_, summary)| summary.len() <= 60));
        let mut names: Vec<&str> = grouped().map(|(name, _)| *name).collect();
        visible.sort_unstable();
        names.sort_unstable();
        assert_eq!(visible, names);
    }
}
