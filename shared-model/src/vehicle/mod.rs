//! The vehicle: lateral, yaw and steering motion at constant speed, equation (14).

mod chassis;
mod model;

pub use chassis::{SlipForm, Vehicle};
pub use model::{Constants, Model, SIDESLIP, STEERING_ANGLE, STEERING_RATE, State, YAW_RATE};
