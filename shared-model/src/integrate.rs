//! Fixed-step fourth-order Runge-Kutta for the model with dry friction: what the ECU runs.
//!
//! The friction mode is held over a step, so that each step integrates a smooth right-hand side. A step in which the
//! friction law's argument passes one of its steps is split once, at the crossing, and finished in the new mode. A mode
//! held across the crossing would err by (change of acceleration) times the step: first order, and a map with jumps,
//! whose Lyapunov exponent is not that of the flow. The split costs at most three Runge-Kutta steps instead of one, so the
//! worst case stays bounded.

use crate::Real;
use crate::dither::Injection;
use crate::friction::FrictionMode;
use crate::vehicle::{Model, STEERING_RATE, State};
use nalgebra::Vector4;

/// Advances `state` by one step of `step_s` seconds, the dither's `injection` being held.
///
/// Fourth order where the motion is smooth. At a friction event the crossing is found by linear interpolation, which
/// leaves a second-order error; the release from stick is seen at the start of the next step, where the acceleration is
/// still zero to first order.
///
/// ```
/// use shared_model::{Scenario, dither::Injection, integrate, vehicle::Model};
/// let scenario = Scenario::reconstruction();
/// let model = Model::new(&scenario);
/// let mut state = model.initial_state(&scenario);
/// for _ in 0..1000 {
///     integrate::step(&model, &mut state, 1e-3, Injection::Off);
/// }
/// // Started at rest at delta_f = 0.46 rad, the steering still sticks there.
/// assert!(state.x[2] != 0.0);
/// ```
pub fn step<T: Real>(model: &Model<T>, state: &mut State<T>, step_s: T, injection: Injection<T>) {
    let mode = model.mode_at(&state.x, injection);
    let argument = model.friction_argument();
    let trial = runge_kutta_4(model, &state.x, step_s, injection, mode);
    let crossing = model
        .friction_sign(injection)
        .crossing(mode, trial[argument]);
    let Some((threshold, behind)) = crossing else {
        *state = State {
            x: trial,
            friction: mode,
        };
        return;
    };

    let before = state.x[argument];
    let fraction = (threshold - before) / (trial[argument] - before);
    let mut at = runge_kutta_4(model, &state.x, step_s * fraction, injection, mode);
    at[argument] = threshold;
    let mode = if model.can_stick(injection) {
        model.mode_at_rest(&at, injection)
    } else {
        behind
    };
    let rest = step_s * (T::one() - fraction);
    *state = State {
        x: runge_kutta_4(model, &at, rest, injection, mode),
        friction: mode,
    };
}

fn runge_kutta_4<T: Real>(
    model: &Model<T>,
    x: &Vector4<T>,
    step_s: T,
    injection: Injection<T>,
    mode: FrictionMode,
) -> Vector4<T> {
    let half = T::from_f64(0.5) * step_s;
    let sixth = T::from_f64(1.0 / 6.0) * step_s;
    let two = T::from_f64(2.0);
    let k1 = model.derivative(x, injection, mode);
    let k2 = model.derivative(&(x + k1 * half), injection, mode);
    let k3 = model.derivative(&(x + k2 * half), injection, mode);
    let k4 = model.derivative(&(x + k3 * step_s), injection, mode);
    let mut next = x + (k1 + k2 * two + k3 * two + k4) * sixth;
    if mode == FrictionMode::Sticking {
        // Exactly, so that nothing an arithmetic carries beside the value outlives the stick.
        next[STEERING_RATE] = T::zero();
    }
    next
}
