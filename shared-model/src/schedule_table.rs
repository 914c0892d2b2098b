//! x
use crate::schedule::Schedule;
/// x
pub const SQUARE: Schedule<f32, 1> = Schedule {
    first_rpm: 0.0,
    step_rpm: 1.0,
    amplitudes_v: [0.0],
};
/// x
pub const SINE: Schedule<f32, 1> = SQUARE;
