//! `sim-host realisability`: limits of a steering actuator for the dither.

use super::options::ConfigOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use anyhow::ensure;
use dynamics::config::validate;
use dynamics::realisability::{Amplitudes, Demand, Response, bode_chart, demands, responses};
use dynamics::words::Short;
use serde::Serialize;
use shared_model::dither::Waveform;

/// Compute the frequency response of the steering actuator (Bode diagram), the torque for the
/// dither's amplitude, and the amplitude at the motor's greatest torque, from 1 to 20,000 rad/s.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host realisability --figure bode.svg
  sim-host realisability --square-v 0.05 --sine-v 0.8 \\
      --out actuator.csv --json actuator.json
  sim-host config > vehicle.toml
  sim-host realisability --config vehicle.toml")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    /// Amplitude of the square wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    square_v: f64,
    /// Amplitude of the sine wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    sine_v: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Results<'a> {
    demands: [Demand; 2],
    responses: &'a [Response],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    for (option, volts) in [
        ("--square-v", arguments.square_v),
        ("--sine-v", arguments.sine_v),
    ] {
        ensure!(
            volts > 0.0 && volts <= 1000.0,
            "{option} {}: must be greater than 0 and at most 1000 V",
            Short(volts)
        );
    }
    let amplitudes = Amplitudes::from_volts(&scenario, arguments.square_v, arguments.sine_v);
    ensure!(
        amplitudes.square_rad > 0.0 && amplitudes.sine_rad > 0.0,
        "dither.square_rad_per_volt = {} and dither.sine_rad_per_volt = {}: both must be greater than 0",
        scenario.dither.square_rad_per_volt,
        scenario.dither.sine_rad_per_volt
    );
    arguments.destinations.check(arguments.config.input())?;
    let rows = responses(&scenario, &amplitudes);
    let results = Results {
        demands: demands(&scenario, &amplitudes),
        responses: &rows,
    };
    arguments
        .destinations
        .write(&rows, &results, || bode_chart(&scenario, &rows).svg())?;
    for demand in &results.demands {
        say!("{}", sentence(demand));
    }
    Ok(Outcome::Success)
}

fn sentence(demand: &Demand) -> String {
    let response = &demand.response;
    let (name, square) = match demand.waveform {
        Waveform::None => ("no dither", ""),
        Waveform::Sine => ("sine", ""),
        Waveform::Square => (
            "square",
            " (as a sine; the square wave's fundamental alone needs 4/pi times as much)",
        ),
    };
    let torque_nm = match demand.waveform {
        Waveform::Sine => response.sine_torque_nm,
        Waveform::None | Waveform::Square => response.square_torque_nm,
    };
    format!(
        "{name}, {:.4} rad at {} rad/s: needs {torque_nm:.4e} N m about the steering axis{square}, of which the inertia \
         J_w w^2 W is {:.4e} N m; the motor's {:.2} N m reach {:.3e} rad, {:.2e} of it; the steering passes {:.4e} rad/(N m) \
         ({:.1} dB) at {:.2} degrees",
        demand.amplitude_rad,
        response.frequency_rad_per_s,
        demand.inertia_torque_nm,
        demand.motor_torque_nm,
        response.reached_rad,
        demand.reached_share(),
        response.magnitude_rad_per_nm,
        response.magnitude_db,
        response.phase_deg
    )
}
