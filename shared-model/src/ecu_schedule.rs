//! The schedules that the ECU carries, one for each waveform.

use crate::Real;
use crate::dither::Waveform;
use crate::schedule::Schedule;
use crate::schedule_table::{POINTS, SINE, SQUARE};

/// A schedule of the size that the ECU carries.
pub type Table<T> = Schedule<T, POINTS>;

impl<T: Real> Table<T> {
    /// The ECU's schedule for a waveform; without one all amplitudes are 0.
    pub fn of(waveform: Waveform) -> Self {
        let table = match waveform {
            Waveform::None => Schedule {
                amplitudes_v: [0.0; POINTS],
                ..SQUARE
            },
            Waveform::Square => SQUARE,
            Waveform::Sine => SINE,
        };
        table.map(&|value| T::from_f64(value.into()))
    }
}
