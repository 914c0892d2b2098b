//! The command gate around a controller of one's own: a sound command passes, one beyond the slew
//! limit latches the safe state.
//!
//! `cargo run --release -p shared-model --example own_controller`

use shared_model::Scenario;
use shared_model::gate::{Fault, Faults, Observation, Supervisor};
use shared_model::signal::{Measurement, Mode};

const CLOCK_HZ: u32 = 25_000_000;

/// A yaw-rate damper: the motor's voltage against the yaw rate.
fn controller(measurement: &Measurement<f32>) -> f32 {
    -0.2 * measurement.yaw_rate_rad_per_s
}

fn main() {
    let scenario = Scenario::<f32>::reconstruction();
    let mut gate = Supervisor::new(&scenario, CLOCK_HZ);
    let tick_counts = CLOCK_HZ / scenario.run.control_rate_hz as u32;
    let mut measurement = Measurement {
        wheel_speed_rpm: 1200.0,
        yaw_rate_rad_per_s: 0.0,
        steering_angle_rad: 0.0,
        steering_rate_rad_per_s: 0.0,
        current_request_a: 0.0,
    };
    let mut tick = |measurement: Measurement<f32>, motor_v| {
        let setpoint = gate.run(&Observation {
            elapsed_counts: tick_counts,
            measurement: Some(measurement),
            measurement_age_ticks: 1,
            motor_v,
            feedback_v: 0.0,
            dither_amplitude_v: 0.0,
            found_outside: Faults::NONE,
        });
        (setpoint.motor_v, gate.mode(), gate.faults())
    };

    for k in 0..100_u8 {
        measurement.yaw_rate_rad_per_s = 1e-4 * f32::from(k);
        let command_v = controller(&measurement);
        let (motor_v, mode, _) = tick(measurement, command_v);
        assert_eq!((motor_v, mode), (command_v, Mode::Active));
    }
    let (motor_v, mode, faults) = tick(measurement, 20.0);
    println!("20 V after 0 V: {mode:?}, motor at {motor_v} V, faults {faults:?}");
    assert_eq!(mode, Mode::Safe);
    assert!(faults.contains(Fault::MotorSlew) && motor_v.abs() < 0.1);
}
