//! Delayed feedback of a sensor's signal through the motor: which unstable orbits it holds, with which gains and
//! delays, and with how much torque.
//!
//! On the orbit the feedback vanishes, so the torque that remains is that of noise and of an error of the delay.
//! Its stability is that of a discrete system: the vehicle at the ECU's control rate, and the delay line as part
//! of the state. An odd number of real multipliers greater than 1 cannot be held by this law for most systems (H.
//! Nakajima, Physics Letters A 232 (1997) 207; for autonomous ones see E. W. Hooton, A. Amann, Physical Review
//! Letters 109 (2012) 154101); those of the vehicle's orbits are less than -1.

mod feedback;
mod figure;
mod impulse;
mod linearised;
mod orbit;
mod over_speed;
mod region;
mod rows;
mod schedule;
mod simulation;
mod to_rest;
mod vehicle;

pub use feedback::{Conditions, Feedback, LONGEST_TICKS, Mixed, Plan};
pub use figure::{chart, region_chart};
pub use linearised::{Best, Linearised};
pub use over_speed::{Point, over_speed};
pub use region::{Cell, region};
pub use rows::{CellRow, PointRow};
pub use schedule::{Entry, ScheduleError, entries, source};
pub use simulation::{Held, simulate};
