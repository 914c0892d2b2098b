//! The vehicle between the control ticks.

use shared_model::Scenario;
use shared_model::dither::{Application, Injection};
use shared_model::vehicle::Model;

/// Steps of the vehicle in a control tick: at the PWM's rate, as in the loop. At the control rate itself the instants
/// of stick and slip would err so much that a multiplier errs by 2 %.
pub(super) fn steps_per_tick(scenario: &Scenario<f64>) -> u32 {
    let run = &scenario.run;
    (run.pwm_rate_hz / run.control_rate_hz).round().max(1.0) as u32
}

/// The vehicle of a scenario under its averaged dither: model, the motor's constant torque (N m), and the dither.
pub(super) fn vehicle(scenario: &Scenario<f64>) -> (Model<f64>, f64, Injection<f64>) {
    let mut scenario = *scenario;
    scenario.dither.application = Application::Averaged;
    let injection = scenario.dither.injection(0.0);
    let model = Model::new(&scenario);
    (model, scenario.steering.motor_torque_nm(), injection)
}
