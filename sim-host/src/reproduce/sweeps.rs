//! Sweeps over the speed and over the dither's amplitude: the diagrams of Figures 6, 7, 8 and 13,
//! and the claims on them.

use super::claims;
use super::figures::name_of;
use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, Table};
use crate::paper::REGION_EDGES_RPM;
use dynamics::regions::{Regions, regions};
use dynamics::sweep::{Parameter, RunControl, SweepError, Timing, Values};
use plot::chart::{AxisSpec, Chart, Look, Panel, Region, Series};
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// Speed at which the paper dithers, rpm.
const DITHERED_RPM: f64 = 1750.0;

/// Transient from the paper's initial state, and time observed.
fn timing(quality: Quality) -> Result<Timing, SweepError> {
    match quality {
        Quality::Quick => Timing::new(60.0, 160.0),
        Quality::Full => Timing::new(200.0, 500.0),
    }
}

/// Figures 6 and 7.
pub fn speed(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let (step, width) = match quality {
        Quality::Quick => (10.0, 4.0),
        Quality::Full => (2.0, 0.5),
    };
    let values = Values::new("wheel speed", 1500.0, 2000.0, step)?;
    let sweep = sweep(
        &named.scenario,
        Parameter::Speed,
        &values,
        width,
        quality,
        watch,
    )?;
    let (from, to) = (1500.0, 2000.0);
    let [a, b, c] = REGION_EDGES_RPM;
    let edges = [("I", from, a), ("II", a, b), ("III", b, c), ("IV", c, to)];
    let shaded: Vec<Region> = edges
        .iter()
        .map(|&(label, from, to)| Region {
            from,
            to,
            label: label.into(),
        })
        .collect();
    let name = &named.name;
    let exponent = Drawing {
        name: format!("figure-06-{name}"),
        caption: format!(
            "Figure 6 ({name}): largest Lyapunov exponent over the wheel speed, with three standard errors or the resolution of \
             the run; the paper's regions I to IV shaded."
        ),
        chart: exponent_chart(&sweep, &shaded),
        csv: exponent_table(&sweep).csv(),
    };
    let orbit = Drawing {
        name: format!("figure-07-{name}"),
        caption: format!(
            "Figure 7 ({name}): local maxima of the yaw rate over the wheel speed; the paper's regions I to IV shaded."
        ),
        chart: orbit_chart(
            "Figure 7: orbit diagram over the wheel speed",
            &sweep,
            Parameter::Speed,
            Panel {
                regions: shaded,
                ..Panel::default()
            },
        ),
        csv: orbit_table(&sweep, "wheel_speed_rpm").csv(),
    };
    Ok(Material {
        drawings: vec![exponent, orbit],
        judgements: claims::of_speeds(name, &sweep),
        findings: vec![("Regions found".into(), stretches(&sweep, "rpm", 1))],
    })
}

/// Figure 8.
pub fn square(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let (sweep, drawing) = amplitude(named, quality, watch, Waveform::Square, 0.14, "08")?;
    Ok(Material {
        drawings: vec![drawing],
        judgements: claims::of_square_amplitudes(&named.name, &sweep),
        findings: vec![("Regimes found".into(), stretches(&sweep, "V", 4))],
    })
}

/// Figure 13.
pub fn sine(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let (sweep, drawing) = amplitude(named, quality, watch, Waveform::Sine, 1.4, "13")?;
    Ok(Material {
        drawings: vec![drawing],
        judgements: claims::of_sine_amplitudes(&named.name, &sweep),
        findings: vec![("Regimes found".into(), stretches(&sweep, "V", 4))],
    })
}

fn amplitude(
    named: &Named,
    quality: Quality,
    watch: RunControl,
    waveform: Waveform,
    greatest_v: f64,
    number: &str,
) -> Result<(Regions, Drawing), SweepError> {
    let mut scenario = named.scenario;
    scenario.run.wheel_speed_rpm = DITHERED_RPM;
    scenario.dither.waveform = waveform;
    let (points, width) = match quality {
        Quality::Quick => (29, greatest_v / 100.0),
        Quality::Full => (141, 0.5e-3),
    };
    let values = Values::between("dither amplitude", 0.0, greatest_v, points)?;
    let sweep = sweep(
        &scenario,
        Parameter::Amplitude,
        &values,
        width,
        quality,
        watch,
    )?;
    let word = name_of(waveform);
    let name = &named.name;
    let drawing = Drawing {
        name: format!("figure-{number}-{name}"),
        caption: format!(
            "Figure {} ({name}): local maxima of the yaw rate at {DITHERED_RPM} rpm over the {word} dither's amplitude.",
            number.trim_start_matches('0')
        ),
        chart: orbit_chart(
            &format!(
                "Figure {}: orbit diagram over the {word} dither's amplitude",
                number.trim_start_matches('0')
            ),
            &sweep,
            Parameter::Amplitude,
            claimed(waveform),
        ),
        csv: orbit_table(&sweep, "dither_amplitude_v").csv(),
    };
    Ok((sweep, drawing))
}

/// A panel with the amplitudes for which the paper claims period-one motion.
fn claimed(waveform: Waveform) -> Panel {
    let mut panel = Panel::default();
    match waveform {
        Waveform::Square => panel
            .instants
            .push((0.1, "paper: period 1 at 0.1 V".into())),
        Waveform::Sine => {
            // Every second region is shaded.
            let unclaimed = Region {
                to: 0.8,
                ..Region::default()
            };
            let period_one = Region {
                from: 0.8,
                to: 1.2,
                label: "paper: period 1 from 0.8 to 1.2 V".into(),
            };
            panel.regions = vec![unclaimed, period_one];
        }
        Waveform::None => {}
    }
    panel
}

fn sweep(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
    width: f64,
    quality: Quality,
    watch: RunControl,
) -> Result<Regions, SweepError> {
    regions(scenario, parameter, values, width, timing(quality)?, watch)
}

fn exponent_chart(sweep: &Regions, shaded: &[Region]) -> Chart {
    let with = |value: fn(f64, f64) -> f64| {
        let point = |sample: &dynamics::regions::Sample| {
            let attractor = &sample.attractor;
            let exponent = attractor.exponent_per_s?;
            Some((
                sample.value,
                value(exponent, attractor.exponent_threshold_per_s?),
            ))
        };
        sweep.samples.iter().filter_map(point).collect::<Vec<_>>()
    };
    let series = |label: &str, line, points| Series {
        label: label.into(),
        points,
        look: Look::Line(line),
    };
    Chart {
        heading: "Figure 6: largest Lyapunov exponent over the wheel speed".into(),
        panels: vec![Panel {
            x: AxisSpec::linear("wheel speed (rpm)"),
            y: AxisSpec::linear("exponent (1/s)"),
            series: vec![
                series("exponent", 0, with(|exponent, _| exponent)),
                series("threshold of chaos", 1, with(|_, threshold| threshold)),
            ],
            regions: shaded.to_vec(),
            levels: vec![0.0],
            ..Panel::default()
        }],
    }
}

fn exponent_table(sweep: &Regions) -> Table {
    let mut table = Table::new(&["wheel_speed_rpm", "exponent_per_s", "threshold_per_s"]);
    for sample in &sweep.samples {
        let attractor = &sample.attractor;
        if let (Some(exponent), Some(threshold)) =
            (attractor.exponent_per_s, attractor.exponent_threshold_per_s)
        {
            table.push(&[sample.value, exponent, threshold]);
        }
    }
    table
}

fn orbit_chart(heading: &str, sweep: &Regions, parameter: Parameter, claimed: Panel) -> Chart {
    let maxima = |sample: &dynamics::regions::Sample| {
        let value = sample.value;
        let heights = sample.attractor.maxima_rad_per_s.clone();
        heights.into_iter().map(move |height| (value, height))
    };
    Chart {
        heading: heading.into(),
        panels: vec![Panel {
            x: AxisSpec::linear(parameter.name()),
            y: AxisSpec::linear("yaw rate's maxima (rad/s)"),
            series: vec![Series {
                label: String::new(),
                points: sweep.samples.iter().flat_map(maxima).collect(),
                look: Look::Dots,
            }],
            ..claimed
        }],
    }
}

fn orbit_table(sweep: &Regions, parameter: &str) -> Table {
    let mut table = Table::new(&[parameter, "yaw_rate_maximum_rad_per_s"]);
    for sample in &sweep.samples {
        for &height in &sample.attractor.maxima_rad_per_s {
            table.push(&[sample.value, height]);
        }
    }
    table
}

/// The regions in words.
fn stretches(sweep: &Regions, unit: &str, decimals: usize) -> String {
    let words = sweep.regions.iter().map(|region| {
        format!(
            "{} from {:.decimals$} to {:.decimals$} {unit}",
            region.kind, region.from, region.to
        )
    });
    words.collect::<Vec<_>>().join(", ")
}
