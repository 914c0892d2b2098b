//! Options of the plane of wheel speed and dither amplitude: its axes, and the times of each run.

use clap::Args;
use dynamics::sweep::{SweepError, Timing};
use shared_model::dither::Waveform;

/// The plane's axes; amplitudes begin at 0 by default.
#[derive(Args)]
pub struct GridOptions {
    /// First wheel speed, at which the steps begin, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    pub from: f64,
    /// Last wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 2000.0,
        allow_negative_numbers = true
    )]
    pub to: f64,
    /// Step of the wheel speed, rpm
    #[arg(long, value_name = "RPM", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Greatest amplitude of the square wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 0.2,
        allow_negative_numbers = true
    )]
    pub square_to: f64,
    /// Step of the square wave's amplitude, V
    #[arg(long, value_name = "VOLTS", allow_negative_numbers = true)]
    pub square_step: Option<f64>,
    /// Greatest amplitude of the sine wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 2.0,
        allow_negative_numbers = true
    )]
    pub sine_to: f64,
    /// Step of the sine wave's amplitude, V
    #[arg(long, value_name = "VOLTS", allow_negative_numbers = true)]
    pub sine_step: Option<f64>,
}

impl GridOptions {
    /// Name, greatest value (V) and step (V) of the waveform's amplitudes.
    pub fn amplitudes_v(&self, waveform: Waveform) -> (&'static str, f64, Option<f64>) {
        match waveform {
            Waveform::Sine => ("amplitude of the sine (V)", self.sine_to, self.sine_step),
            Waveform::Square | Waveform::None => (
                "amplitude of the square wave (V)",
                self.square_to,
                self.square_step,
            ),
        }
    }
}

/// The times of each run.
#[derive(Args)]
pub struct TimeOptions {
    /// Initial transient of each run to discard, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 100.0,
        allow_negative_numbers = true
    )]
    pub transient: f64,
    /// Length of each run, including the transient, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    pub time: f64,
}

impl TimeOptions {
    /// The validated times.
    pub fn timing(&self) -> Result<Timing, SweepError> {
        Timing::new(self.transient, self.time)
    }
}
