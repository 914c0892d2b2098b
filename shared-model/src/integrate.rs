//! Fixed-step fourth-order Runge-Kutta method for the model with dry friction, as the ECU uses it.
//!
//! The friction mode is held over a step, so that each step integrates a smooth right-hand side. A
//! step in which the mode has to change is split once, where it does: where the friction law's
//! argument passes one of its steps, or where the torque on a sticking steering reaches its limit.
//! A mode held over the rest of such a step would make the map jump, err in first order, and have
//! another Lyapunov exponent than the flow. The split costs at most three Runge-Kutta steps instead
//! of one, so the worst case stays bounded.

use crate::Real;
use crate::dither::Injection;
use crate::friction::FrictionMode;
use crate::vehicle::{Model, STEERING_RATE, State};
use nalgebra::Vector4;

/// Advances `state` by one step of `step_s` seconds, the dither's `injection` being held.
///
/// Fourth order where the motion is smooth. The instant of a change of mode is found by linear
/// interpolation over the step, which leaves a second-order error. Only the first change of mode in
/// a step is detected; a second one takes effect in the next step.
///
/// Coulomb friction under the mean of a square wave so weak that the steering rate reaches W times
/// the dither's frequency (below 2e-4 rad for the paper's) would slide along the two steps of its
/// sign function; here it chatters between modes, in first order.
///
/// ```
/// use shared_model::{Scenario, dither::Injection, integrate, vehicle::Model};
/// let scenario = Scenario::<f64>::reconstruction();
/// let model = Model::new(&scenario);
/// let mut state = model.initial_state(&scenario);
/// for _ in 0..1000 {
///     integrate::step(&model, &mut state, 1e-3, Injection::Off);
/// }
/// // The yaw rate after one second; a hundredth of the step gives -0.127_526_793_270.
/// assert!((state.x[1] + 0.127_526_793).abs() < 1e-9);
/// ```
pub fn step<T: Real>(model: &Model<T>, state: &mut State<T>, step_s: T, injection: Injection<T>) {
    let mode = model.mode_at(&state.x, injection);
    let trial = runge_kutta_4(model, &state.x, step_s, injection, mode);
    let change = match mode {
        FrictionMode::Sticking => release(model, &state.x, &trial, injection),
        _ => crossing(model, &state.x, &trial, injection, mode),
    };
    *state = match change {
        None => State {
            x: trial,
            friction: mode,
        },
        Some(change) => change_mode(model, &state.x, step_s, injection, mode, &change),
    };
}

/// A change of mode within a step.
struct Change<T> {
    /// Share of the step before it.
    fraction: T,
    /// Value of the friction law's argument there, where it is a step of that law.
    threshold: Option<T>,
    /// The mode after it, unless the steering comes to rest and the torques decide.
    mode_after: FrictionMode,
}

/// The torque on a sticking steering reaches its limit between `start` and `end`.
fn release<T: Real>(
    model: &Model<T>,
    start: &Vector4<T>,
    end: &Vector4<T>,
    injection: Injection<T>,
) -> Option<Change<T>> {
    let mode_after = model.mode_at_rest(end, injection);
    let limit = match mode_after {
        FrictionMode::Positive => model.friction_limit_nm(),
        FrictionMode::Negative => -model.friction_limit_nm(),
        FrictionMode::Sticking | FrictionMode::Neutral => return None,
    };
    let before = model.driving_torque_nm(start, injection);
    let after = model.driving_torque_nm(end, injection);
    Some(Change {
        fraction: (limit - before) / (after - before),
        threshold: None,
        mode_after,
    })
}

/// The friction law's argument passes one of the law's steps between `start` and `end`.
fn crossing<T: Real>(
    model: &Model<T>,
    start: &Vector4<T>,
    end: &Vector4<T>,
    injection: Injection<T>,
    mode: FrictionMode,
) -> Option<Change<T>> {
    let argument = model.friction_argument();
    let (before, after) = (start[argument], end[argument]);
    let (threshold, mode_after) = model.friction_sign(injection).crossing(mode, after)?;
    Some(Change {
        fraction: (threshold - before) / (after - before),
        threshold: Some(threshold),
        mode_after,
    })
}

fn change_mode<T: Real>(
    model: &Model<T>,
    start: &Vector4<T>,
    step_s: T,
    injection: Injection<T>,
    mode: FrictionMode,
    change: &Change<T>,
) -> State<T> {
    let mut at = runge_kutta_4(model, start, step_s * change.fraction, injection, mode);
    let mut mode_after = change.mode_after;
    if let Some(threshold) = change.threshold {
        at[model.friction_argument()] = threshold;
        if model.can_stick(injection) {
            mode_after = model.mode_at_rest(&at, injection);
        }
    }
    let rest = step_s * (T::one() - change.fraction);
    State {
        x: runge_kutta_4(model, &at, rest, injection, mode_after),
        friction: mode_after,
    }
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
        // Exactly zero, so that what an arithmetic carries beside the value (tangents) vanishes in
        // the stick.
        next[STEERING_RATE] = T::zero();
    }
    next
}
