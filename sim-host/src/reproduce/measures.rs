//! Measures that the paper only mentions: all Lyapunov exponents, the Poincaré section and the
//! frequency spectrum; and its own method for the largest exponent beside two others.

use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, Table, csv_of};
use dynamics::attractor::{Attractor, attractors};
use dynamics::component::Component;
use dynamics::component::panel_of_states;
use dynamics::method::{Estimate, Method, estimates};
use dynamics::poincare::{SectionError, crossings};
use dynamics::power_spectrum::welch;
use dynamics::section::{Direction, Section};
use dynamics::simulate::{settle, simulate, started_at};
use dynamics::sweep::{RunControl, SweepError, Timing};
use dynamics::synchronisation::Search;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use shared_model::vehicle::YAW_RATE;

/// Two speeds in each of the paper's regions I and III, and four in chaos.
const SPEEDS_RPM: [f64; 8] = [
    1500.0, 1600.0, 1650.0, 1700.0, 1750.0, 1800.0, 1845.0, 1880.0,
];
const TRANSIENT_S: f64 = 200.0;

fn at_speed(scenario: &Scenario<f64>, wheel_speed_rpm: f64) -> Scenario<f64> {
    let mut scenario = *scenario;
    scenario.run.wheel_speed_rpm = wheel_speed_rpm;
    scenario
}

/// The largest exponent by three methods and to the letter of (20), and all four exponents.
pub fn exponents(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let timing = match quality {
        Quality::Quick => Timing::new(60.0, 200.0)?,
        Quality::Full => Timing::new(TRANSIENT_S, 1200.0)?,
    };
    let methods = [
        Method::Tangent,
        Method::Twin,
        Method::Synchronisation,
        Method::PrintedResponse,
        Method::Spectrum,
    ];
    let scenarios = SPEEDS_RPM.map(|rpm| at_speed(&named.scenario, rpm));
    let mut all: Vec<Estimate> = Vec::new();
    for method in methods {
        let made = estimates(&scenarios, method, timing, Search::default(), watch)?;
        all.extend(made.into_iter().flatten().flatten());
    }
    all.sort_by(|a, b| a.wheel_speed_rpm.total_cmp(&b.wheel_speed_rpm));
    let estimates = all;
    let findings = SPEEDS_RPM.map(|rpm| {
        (
            format!("Exponents at {rpm} rpm, 1/s"),
            words(&estimates, rpm),
        )
    });
    let name = &named.name;
    Ok(Material {
        drawings: vec![Drawing {
            name: format!("exponents-{name}"),
            caption: format!(
                "Lyapunov exponents ({name}): the largest by three independent methods and by equation (20) to the letter, which \
                 gives a conditional exponent; below, all four exponents (where stick makes one minus infinity it is not drawn)."
            ),
            chart: exponent_chart(&estimates),
            csv: csv_of(&estimates),
        }],
        findings: findings.into(),
        ..Material::default()
    })
}

fn words(estimates: &[Estimate], rpm: f64) -> String {
    let here = estimates
        .iter()
        .filter(|estimate| estimate.wheel_speed_rpm == rpm);
    let word = |estimate: &Estimate| {
        let name = match estimate.method {
            Method::Spectrum => format!("number {}", estimate.index),
            method => method.name().into(),
        };
        match (estimate.exponent_per_s, estimate.error_per_s()) {
            (Some(exponent), Some(error)) => format!("{name} {exponent:.3} \u{b1} {error:.3}"),
            _ => format!("{name} {}", estimate.finding.words()),
        }
    };
    here.map(word).collect::<Vec<_>>().join(", ")
}

fn exponent_chart(estimates: &[Estimate]) -> Chart {
    let series = |label: &str, line, method, index| {
        let of_method = estimates
            .iter()
            .filter(move |estimate| estimate.method == method && estimate.index == index);
        Series {
            label: label.into(),
            points: of_method
                .filter_map(|estimate| Some((estimate.wheel_speed_rpm, estimate.exponent_per_s?)))
                .collect(),
            look: Look::Line(line),
        }
    };
    let speed = || AxisSpec::linear("wheel speed (rpm)");
    Chart {
        heading: "Lyapunov exponents by three methods".into(),
        panels: vec![
            Panel {
                caption: "the largest".into(),
                x: speed(),
                y: AxisSpec::linear("exponent (1/s)"),
                series: vec![
                    series("tangent", 0, Method::Tangent, 1),
                    series("twin", 1, Method::Twin, 1),
                    series("synchronisation", 2, Method::Synchronisation, 1),
                    series("(20) to the letter", 3, Method::PrintedResponse, 1),
                ],
                levels: vec![0.0],
                ..Panel::default()
            },
            Panel {
                caption: "all four, by tangent dynamics".into(),
                x: speed(),
                y: AxisSpec::linear("exponent (1/s)"),
                series: (1..=4)
                    .map(|n| series(&format!("number {n}"), n - 1, Method::Spectrum, n))
                    .collect(),
                levels: vec![0.0],
                ..Panel::default()
            },
        ],
    }
}

/// Poincaré section and frequency spectrum at 1750 rpm.
pub fn motion(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let mut scenario = at_speed(&named.scenario, 1750.0);
    scenario.run.duration_s = match quality {
        Quality::Quick => 200.0,
        Quality::Full => 3000.0,
    };
    let mut material = Material::default();
    match section(named, &scenario) {
        Ok(drawing) => material.drawings.push(drawing),
        Err(SectionError::Invalid(error)) => return Err(error.into()),
        Err(error) => material
            .findings
            .push(("Poincar\u{e9} section".into(), error.to_string())),
    }
    (watch.done)();
    material.drawings.push(spectrum(named, &scenario)?);
    (watch.done)();
    Ok(material)
}

fn section(named: &Named, scenario: &Scenario<f64>) -> Result<Drawing, SectionError> {
    let section = Section {
        component: Component::YAW_RATE,
        value: 0.0,
        direction: Direction::Rising,
    };
    let found = crossings(scenario, TRANSIENT_S, &section)?;
    let mut table = Table::new(&[
        "time_s",
        "sideslip_rad",
        "steering_angle_rad",
        "steering_rate_rad_per_s",
    ]);
    for crossing in &found {
        let x = crossing.x;
        table.push(&[crossing.time_s, x[0], x[2], x[3]]);
    }
    Ok(Drawing {
        name: format!("poincare-{}", named.name),
        caption: format!(
            "Poincar\u{e9} section ({}) at 1750 rpm without dither: sideslip and steering angle where the yaw rate rises through \
             zero, {} crossings.",
            named.name,
            found.len()
        ),
        chart: Chart {
            heading: "Poincar\u{e9} section of the chaotic motion".into(),
            panels: vec![Panel {
                caption: section.to_string(),
                ..panel_of_states(
                    (Component::SIDESLIP, Component::STEERING_ANGLE),
                    found.iter().map(|crossing| crossing.x),
                    Look::Dots,
                )
            }],
        },
        csv: table.csv(),
    })
}

/// Samples in a segment: bins of 0.3 Hz at 10 kHz.
const SEGMENT: usize = 1 << 15;
/// Length of the motion whose spectrum is taken, s.
const SPECTRUM_RUN_S: f64 = 60.0;

fn spectrum(named: &Named, scenario: &Scenario<f64>) -> Result<Drawing, SweepError> {
    let start = settle(scenario, TRANSIENT_S)?;
    let mut scenario = started_at(scenario, &start);
    scenario.run.duration_s = SPECTRUM_RUN_S;
    scenario.dither.start_time_s = 0.0;
    scenario.dither.application = Application::Signal;
    let mut table = Table::new(&["frequency_hz", "density_without", "density_with_square"]);
    let mut densities = Vec::new();
    let mut bin_hz = 0.0;
    for (waveform, amplitude_v) in [(Waveform::None, 0.0), (Waveform::Square, 0.1)] {
        scenario.dither.waveform = waveform;
        scenario.dither.amplitude_v = amplitude_v;
        let trace = simulate(&scenario)?;
        let signal: Vec<f64> = trace.component(YAW_RATE).collect();
        let found = welch(&signal, 1.0 / trace.step_s, SEGMENT);
        let found = found.expect("the run is longer than a segment");
        bin_hz = found.bin_hz;
        densities.push(found.density);
    }
    let curve = |density: &[f64]| {
        let bins = density.iter().enumerate().skip(1);
        bins.map(|(k, &density)| (k as f64 * bin_hz, density))
            .collect()
    };
    let series = |label: &str, line, density: &[f64]| Series {
        label: label.into(),
        points: curve(density),
        look: Look::Line(line),
    };
    for (k, (without, with)) in densities[0].iter().zip(&densities[1]).enumerate() {
        table.push(&[k as f64 * bin_hz, *without, *with]);
    }
    let dither_hz = scenario.dither.square_frequency_rad_per_s / std::f64::consts::TAU;
    Ok(Drawing {
        name: format!("spectrum-{}", named.name),
        caption: format!(
            "Frequency spectrum of the yaw rate ({}) at 1750 rpm by Welch's method, without dither and with the true square \
             signal of 0.1 V.",
            named.name
        ),
        chart: Chart {
            heading: "Power spectrum of the yaw rate".into(),
            panels: vec![Panel {
                x: AxisSpec::logarithmic("frequency (Hz)"),
                y: AxisSpec::logarithmic("density ((rad/s)\u{b2}/Hz)"),
                series: vec![
                    series("without dither", 5, &densities[0]),
                    series("square dither", 0, &densities[1]),
                ],
                instants: vec![(dither_hz, "dither".into())],
                ..Panel::default()
            }],
        },
        csv: table.csv(),
    })
}

/// How the findings depend on the lengths of transient and run.
pub fn lengths(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let (transients_s, runs_s): (&[f64], &[f64]) = match quality {
        Quality::Quick => (&[0.0, 60.0], &[60.0, 150.0]),
        Quality::Full => (&[0.0, 50.0, 200.0, 1000.0], &[100.0, 300.0, 1000.0, 3000.0]),
    };
    let longest_s = runs_s[runs_s.len() - 1];
    let by_transient = transients_s
        .iter()
        .map(|&transient_s| (transient_s, longest_s));
    let by_run = runs_s
        .iter()
        .map(|&run_s| (transients_s[transients_s.len() - 1], run_s));
    let speeds_rpm = [1600.0, 1750.0, 1845.0];
    let scenarios = speeds_rpm.map(|rpm| at_speed(&named.scenario, rpm));
    let finding = |(transient_s, run_s): (f64, f64)| {
        let timing = Timing::new(transient_s, transient_s + run_s)?;
        let made = attractors(&scenarios, timing, true, watch)?;
        let word = |(rpm, found): (f64, Option<Attractor>)| {
            let found = found?;
            let exponent = found
                .exponent_per_s
                .map_or_else(String::new, |exponent| format!(" ({exponent:.3} 1/s)"));
            Some(format!("{rpm} rpm {}{exponent}", found.kind))
        };
        let words: Vec<String> = speeds_rpm.into_iter().zip(made).filter_map(word).collect();
        Ok((
            format!("{run_s} s after a transient of {transient_s} s"),
            words.join(", "),
        ))
    };
    let findings = by_transient.chain(by_run).map(finding);
    Ok(Material {
        findings: findings.collect::<Result<_, SweepError>>()?,
        ..Material::default()
    })
}
