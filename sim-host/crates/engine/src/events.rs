//! Where a friction mode ends, and what follows.

use nalgebra::Vector4;
use shared_model::dither::Injection;
use shared_model::friction::{FrictionMode, Sign};
use shared_model::tire::Tire;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, YAW_RATE};

/// Share of the friction limit by which the torque must exceed it before the steering is released.
/// At rest right at the limit rounding would otherwise release it and stop it without end.
const RELEASE_MARGIN: f64 = 1e-10;
/// Rounding of the driving torque, in units of the last place of its greatest term.
const ROUNDING_ULPS: f64 = 16.0;

/// The quantity that must stay within bounds for a friction mode to last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guard {
    /// The lower bound; minus infinity where there is none. Of the driving torque (N m) while
    /// sticking, else of the friction law's argument (rad or rad/s).
    pub lower: f64,
    /// The upper bound; infinity where there is none.
    pub upper: f64,
}

impl Guard {
    /// No bounds.
    pub const NONE: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
    };

    /// The bounds of a mode that begins at `x`.
    pub fn of(
        model: &Model<f64>,
        injection: Injection<f64>,
        mode: FrictionMode,
        x: &Vector4<f64>,
    ) -> Self {
        let free = (Self::NONE.lower, Self::NONE.upper);
        let (lower, upper) = match (mode, model.friction_sign(injection)) {
            (FrictionMode::Sticking, _) => {
                let held_nm = held_torque_nm(model, injection, x);
                (-held_nm, held_nm)
            }
            (FrictionMode::Positive, Sign::Stepped { upper, .. }) => (upper, free.1),
            (FrictionMode::Negative, Sign::Stepped { lower, .. }) => (free.0, lower),
            (FrictionMode::Neutral, Sign::Stepped { lower, upper }) if lower < upper => {
                (lower, upper)
            }
            _ => free,
        };
        Self { lower, upper }
    }

    /// The mode lasts for ever.
    pub(crate) fn never_ends(&self) -> bool {
        *self == Self::NONE
    }
}

/// The driving torque up to which a steering at rest sticks, N m: the friction limit, and a margin
/// that rounding cannot pass. Without it a friction weaker than the rounding of the torque would
/// change its mode for ever as the steering comes to rest.
fn held_torque_nm(model: &Model<f64>, injection: Injection<f64>, x: &Vector4<f64>) -> f64 {
    let limit_nm = model.friction_limit_nm();
    let constants = model.constants();
    let slip_angle_size = x[SIDESLIP].abs()
        + constants.front_lever_s.abs() * x[YAW_RATE].abs()
        + x[STEERING_ANGLE].abs();
    let force_size = match model.tires().0 {
        Tire::Cubic(tire) => {
            let tire = tire.averaged(injection);
            let square = slip_angle_size * slip_angle_size;
            slip_angle_size * (tire.linear_n_per_rad.abs() + tire.cubic_n_per_rad3.abs() * square)
        }
        Tire::MagicFormula(tire, _) => {
            let slope = tire.stiffness_per_rad * tire.shape * (1.0 + tire.curvature.abs());
            tire.peak_n.abs() * (slope * slip_angle_size).abs()
        }
    };
    let torque_size_nm = constants.motor_torque_nm.abs() + constants.trail_m * force_size;
    let rounding_nm = ROUNDING_ULPS * f64::EPSILON * torque_size_nm;
    (limit_nm * (1.0 + RELEASE_MARGIN)).max(limit_nm + rounding_nm)
}

/// The mode that follows `from`, which ends at `x`; puts the friction law's argument exactly on the
/// step that it passes.
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
            let torque_nm = model.driving_torque_nm(x, injection);
            match model.can_stick(injection) {
                true if torque_nm.abs() <= held_torque_nm(model, injection, x) => {
                    FrictionMode::Sticking
                }
                true => model.mode_at_rest(x, injection),
                false => behind,
            }
        }
        None => from,
    }
}
