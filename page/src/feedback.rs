//! The ECU's controller with its delayed feedback, in closed loop with the vehicle: sensors without
//! errors, no frames and no gate.

use measures::trace::Trace;
use shared_model::controller::Controller;
use shared_model::dither::Injection;
use shared_model::policy::Suppression;
use shared_model::servo::Pwm;
use shared_model::signal::Measurement;
use shared_model::vehicle::{Model, STEERING_ANGLE, STEERING_RATE, YAW_RATE};
use shared_model::{Scenario, integrate};

/// Whether the scenario's chaos is suppressed by delayed feedback.
pub fn is_chosen(scenario: &Scenario<f32>) -> bool {
    scenario.controller.suppression == Suppression::DelayedFeedback
}

/// Records a run of a scenario, which must be valid: a state per control tick. The vehicle is
/// stepped at the PWM rate, and the duty is held over a tick.
pub fn record(scenario: &Scenario<f32>) -> Trace {
    let run = &scenario.run;
    let periods = scenario.periods_per_tick();
    let ticks = (f64::from(run.duration_s) * f64::from(run.control_rate_hz)).round() as u32;
    let mut controller = Controller::new(scenario);
    let pwm = Pwm::new(&scenario.servo, run.pwm_rate_hz);
    let mut model = Model::new(scenario);
    let mut state = model.initial_state(scenario);
    let mut trace = Trace {
        step_s: 1.0 / f64::from(run.control_rate_hz),
        initial: state.map(f64::from),
        states: Vec::new(),
        duties: Vec::new(),
        samples_per_step: periods as usize,
        pwm_period: pwm.neutral().period(),
    };
    for _ in 0..ticks {
        let measurement = Measurement {
            wheel_speed_rpm: run.wheel_speed_rpm,
            yaw_rate_rad_per_s: state.x[YAW_RATE],
            steering_angle_rad: state.x[STEERING_ANGLE],
            steering_rate_rad_per_s: state.x[STEERING_RATE],
            current_request_a: scenario.steering.motor_current_a,
        };
        let command = controller.run(&measurement, true);
        let duty = pwm.duty(command.motor_v + command.feedback_v);
        model.set_motor_torque_nm(pwm.volts(duty) / scenario.motor_v_per_nm());
        for _ in 0..periods {
            integrate::step(&model, &mut state, 1.0 / run.pwm_rate_hz, Injection::Off);
            trace.duties.push(duty.code());
        }
        trace.states.push(state.map(f64::from));
    }
    trace
}

#[cfg(test)]
mod tests {
    use super::*;
    use measures::period::{Period, RIPPLE_TOLERANCE, period};

    /// The orbits' periods are those of `sim-host feedback`, by shooting (docs/feedback.md).
    #[test]
    fn it_holds_the_unstable_orbits() {
        let mut scenario = Scenario::reconstruction();
        scenario.controller.suppression = Suppression::DelayedFeedback;
        scenario.run.duration_s = 200.0;
        for (wheel_speed_rpm, period_s) in [
            (1700.0, 1.652_323),
            (1760.0, 1.694_219),
            (1820.0, 1.744_979),
        ] {
            scenario.run.wheel_speed_rpm = wheel_speed_rpm;
            let trace = record(&scenario);
            let found = period(&trace, trace.index_after(150.0), RIPPLE_TOLERANCE);
            let Period::Periodic { time_s, .. } = found else {
                panic!("{found:?} at {wheel_speed_rpm} rpm");
            };
            assert!((time_s - period_s).abs() < 1e-3, "{found:?}");
        }
    }
}
