//! `sim-host spectrum`: power spectrum after the transient.

use super::outcome::Outcome;
use super::output::Destinations;
use super::settled::{SettledRun, title};
use anyhow::{Context, ensure};
use dynamics::component::Component;
use dynamics::power_spectrum::{MIN_SEGMENT, PowerSpectrum, chart, welch};
use dynamics::words::{Short, counted};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use std::f64::consts::TAU;

/// Default number of segments, with half overlap.
const SEGMENTS: f64 = 8.0;

/// Estimate a power spectrum after the transient by Welch's method (Hann window, half overlap,
/// one-sided density).
///
/// The dither, if any, is applied as the true signal, so that the spectrum has its line.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host spectrum --rpm 1750 --time 200 --figure spectrum.svg
  sim-host spectrum --rpm 1750 --dither square --amplitude-v 0.1 --time 60 \\
      --figure spectrum-dither.svg
  sim-host spectrum --component steering_angle --segment 20 --time 400 \\
      --out spectrum.csv

Components: sideslip (beta), yaw_rate (gamma), steering_angle (delta_f), steering_rate (delta_f_dot).")]
pub struct Arguments {
    #[command(flatten)]
    run: SettledRun,
    /// Component of the state
    #[arg(long, value_name = "COMPONENT", default_value = "yaw_rate")]
    component: Component,
    /// Length of a segment, s; lines closer than 2/SECONDS Hz merge [default: two ninths of the
    /// run, which gives eight segments]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    segment: Option<f64>,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Row {
    frequency_hz: f64,
    density_per_hz: f64,
}

#[derive(Serialize)]
struct DitherLine {
    frequency_rad_per_s: f64,
    frequency_hz: f64,
    amplitude: f64,
    over_surroundings: f64,
}

#[derive(Serialize)]
struct Results {
    wheel_speed_rpm: f64,
    transient_s: f64,
    component: Component,
    density_unit: String,
    bin_hz: f64,
    segments: usize,
    power: f64,
    peak_hz: f64,
    dither: Option<DitherLine>,
    bins: Vec<Row>,
}

impl Arguments {
    /// Samples in a segment.
    fn segment(&self, scenario: &Scenario<f64>) -> anyhow::Result<usize> {
        let (rate_hz, duration_s) = (scenario.model_rate_hz(), scenario.run.duration_s);
        let default = 2.0 * duration_s / (SEGMENTS + 1.0);
        let length_s = self.segment.unwrap_or(default);
        let least_s = MIN_SEGMENT as f64 / rate_hz;
        ensure!(
            length_s >= least_s && length_s <= duration_s,
            "--segment {}: must be from {least_s} s ({MIN_SEGMENT} samples) to the run's length, --time {duration_s} s",
            Short(length_s)
        );
        Ok(((length_s * rate_hz).round() as usize).min(scenario.steps() as usize))
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut scenario = arguments.run.scenario()?;
    let dithered = scenario.dither.waveform != Waveform::None;
    if dithered {
        scenario.dither.application = Application::Signal;
        scenario.validate()?;
    }
    let segment = arguments.segment(&scenario)?;
    arguments.destinations.check(arguments.run.input())?;
    let trace = arguments.run.trace(&scenario)?;
    let component = arguments.component;
    let (low, high) = trace.range(component.index, 0);
    ensure!(
        high - low > 1e-9,
        "the trajectory is at rest: {component} ranges from {low} to {high} {}, so it has no spectrum; no file was written",
        component.unit
    );
    let signal: Vec<f64> = trace.component(component.index).collect();
    let spectrum = welch(&signal, scenario.model_rate_hz(), segment)?;
    let results = results(arguments, &scenario, &spectrum).context("no file was written")?;
    arguments.destinations.write(&results.bins, &results, || {
        let component = results.component;
        let dither = results.dither.as_ref();
        let dither = dither.map(|line| (line.frequency_hz, dither_label(line)));
        let heading = format!(
            "Power spectrum of {} \u{2013} {}",
            component.title,
            title(&scenario)
        );
        chart(&spectrum, heading, component.unit, dither).svg()
    })?;
    say!(
        "{}, bins of {:.4} Hz; power {:.6e} ({})\u{b2}, greatest at {:.4} Hz",
        counted(results.segments, "segment"),
        results.bin_hz,
        results.power,
        component.unit,
        results.peak_hz
    );
    if let Some(line) = &results.dither {
        say!(
            "dither line at {:.3} Hz ({} rad/s): amplitude {:.4e} {}, {:.1} times the density around it",
            line.frequency_hz,
            line.frequency_rad_per_s,
            line.amplitude,
            component.unit,
            line.over_surroundings
        );
    }
    Ok(Outcome::Success)
}

fn results(
    arguments: &Arguments,
    scenario: &Scenario<f64>,
    spectrum: &PowerSpectrum,
) -> anyhow::Result<Results> {
    let frequency_rad_per_s = scenario.dither.frequency_rad_per_s();
    let frequency_hz = frequency_rad_per_s / TAU;
    let dither = match scenario.dither.waveform {
        Waveform::None => None,
        Waveform::Square | Waveform::Sine => {
            let line = spectrum.line(frequency_hz).with_context(|| {
                let least = TAU * spectrum.frequency_hz(4);
                let most = TAU * spectrum.frequency_hz(spectrum.density.len().saturating_sub(5));
                format!(
                    "the dither's {frequency_rad_per_s} rad/s are not within the spectrum, {least} to {most} rad/s"
                )
            })?;
            Some(DitherLine {
                frequency_rad_per_s,
                frequency_hz,
                amplitude: line.amplitude,
                over_surroundings: line.prominence,
            })
        }
    };
    let bins = spectrum.density.iter().enumerate();
    Ok(Results {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        transient_s: arguments.run.transient,
        component: arguments.component,
        density_unit: format!("({})^2/Hz", arguments.component.unit),
        bin_hz: spectrum.bin_hz,
        segments: spectrum.segments,
        power: spectrum.power(),
        peak_hz: spectrum.peak_hz(),
        dither,
        bins: bins
            .map(|(k, density)| Row {
                frequency_hz: spectrum.frequency_hz(k),
                density_per_hz: *density,
            })
            .collect(),
    })
}

fn dither_label(line: &DitherLine) -> String {
    format!(
        "dither, {} rad/s = {:.1} Hz",
        line.frequency_rad_per_s, line.frequency_hz
    )
}
