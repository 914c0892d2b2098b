//! Where a friction mode ends, and what follows.

use nalgebra::Vector4;
use shared_model::dither::Injection;
use shared_model::friction::{FrictionMode, Sign};
use shared_model::vehicle::Model;

/// The quantity that must stay within bounds for a friction mode to last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guard {
    /// The mode.
    pub mode: FrictionMode,
    /// The lower bound; minus infinity where there is none. Of the driving torque (N m) while sticking, else of the friction
    /// law's argument (rad or rad/s).
    pub lower: f64,
    /// The upper bound; infinity where there is none.
    pub upper: f64,
}

impl Guard {
    /// The bounds of a mode.
    pub fn of(model: &Model<f64>, injection: Injection<f64>, mode: FrictionMode) -> Self {
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let (lower, upper) = match (mode, model.friction_sign(injection)) {
            (FrictionMode::Sticking, _) => {
                let limit_nm = model.friction_limit_nm();
                (-limit_nm, limit_nm)
            }
            (FrictionMode::Positive, Sign::Stepped { upper, .. }) => (upper, free.1),
            (FrictionMode::Negative, Sign::Stepped { lower, .. }) => (free.0, lower),
            (FrictionMode::Neutral, Sign::Stepped { lower, upper }) if lower < upper => {
                (lower, upper)
            }
            _ => free,
        };
        Self { mode, lower, upper }
    }
}

/// The mode that follows `from`, which ends at `x`; puts the friction law's argument exactly on the step that it passes.
pub fn next_mode(
    model: &Model<f64>,
    injection: Injection<f64>,
    from: FrictionMode,
    x: &mut Vector4<f64>,
) -> FrictionMode {
    if from == FrictionMode::Sticking {
        return if model.driving_torque_nm(x, injection) > 0.0 {
            FrictionMode::Positive
        } else {
            FrictionMode::Negative
        };
    }
    let argument = model.friction_argument();
    match model.friction_sign(injection).crossing(from, x[argument]) {
        Some((threshold, behind)) => {
            x[argument] = threshold;
            if model.can_stick(injection) {
                model.mode_at_rest(x, injection)
            } else {
                behind
            }
        }
        None => from,
    }
}
