//! Delayed feedback: holds an unstable periodic orbit by the difference of a signal to its own value a period
//! ago, which vanishes on the orbit.
//!
//! K. Pyragas, Physics Letters A 170 (1992) 421. With memory, past periods count with weights that fall by a
//! factor each: J. E. S. Socolar, D. W. Sukow, D. J. Gauthier, Physical Review E 50 (1994) 3245.
//!
//! The ECU's periods and gains by wheel speed are in [`table`], made by `sim-host feedback`.

mod law;
mod line;
mod schedule;
pub mod table;

pub use law::{DelayedFeedback, Law};
pub use schedule::{InvalidOrbits, OrbitSchedule, Tuning};

/// Values of the ECU's delay line, half a kilobyte of f32.
pub const LINE_LEN: usize = 114;
/// How far the line reaches back at the least, s. The cubic takes two values beyond.
pub const SHORTEST_LINE_S: f64 = (LINE_LEN - 3) as f64 / LINE_RATE_HZ as f64;
/// Rate of the line's values, per s, where the control rate is a multiple of it. What the interpolation between them
/// loses of the orbits' yaw rate is a torque far below that of a PWM count, 0.05 N m.
const LINE_RATE_HZ: u32 = 50;

/// Control ticks from one value of the delay line to the next.
///
/// ```
/// use shared_model::delayed_feedback::spacing_ticks;
/// assert_eq!([10, 50, 51, 1000].map(spacing_ticks), [1, 1, 2, 20]);
/// ```
pub fn spacing_ticks(control_rate_hz: u32) -> u32 {
    control_rate_hz.div_ceil(LINE_RATE_HZ).max(1)
}
