//! What the subcommands share that look at the plane of wheel speed and dither amplitude: its ends, and the times of each run.

use clap::Args;
use shared_model::dither::Waveform;
use sim_host::chaos::sweep::{SweepError, Timing};

/// Ends of the plane's axes; amplitudes begin at 0.
#[derive(Args)]
pub struct GridOptions {
    /// Least wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    pub from: f64,
    /// Greatest wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 2000.0,
        allow_negative_numbers = true
    )]
    pub to: f64,
    /// Greatest amplitude of the square wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 0.2,
        allow_negative_numbers = true
    )]
    pub square_to: f64,
    /// Greatest amplitude of the sine, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 2.0,
        allow_negative_numbers = true
    )]
    pub sine_to: f64,
}

impl GridOptions {
    /// The waveform's greatest amplitude, V.
    pub fn amplitude_to_v(&self, waveform: Waveform) -> f64 {
        match waveform {
            Waveform::Sine => self.sine_to,
            Waveform::Square | Waveform::None => self.square_to,
        }
    }
}

/// The times of each run.
#[derive(Args)]
pub struct TimeOptions {
    /// What of each run is not looked at, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 100.0,
        allow_negative_numbers = true
    )]
    pub transient: f64,
    /// Length of each run, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    pub time: f64,
}

impl TimeOptions {
    /// The times, checked.
    pub fn timing(&self) -> Result<Timing, SweepError> {
        Timing::new(self.transient, self.time)
    }
}
