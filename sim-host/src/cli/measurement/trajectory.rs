//! A trajectory of the model: the states at each model step, the duty in each PWM period.

use super::channels::{channel, friction_mode};
use dynamics::trace::Trace;
use mdf4::{Group, Samples};
use std::path::Path;

/// Arithmetic in which the states were computed, and are stored.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// f32, as on the ECU.
    Single,
    /// f64.
    Double,
}

/// The components of a state: names and descriptions.
const COMPONENTS: [(&str, &str); 4] = [
    ("sideslip_rad", "Sideslip angle beta."),
    ("yaw_rate_rad_per_s", "Yaw rate gamma."),
    ("steering_angle_rad", "Front steering angle delta_f."),
    ("steering_rate_rad_per_s", "Steering rate."),
];

/// Writes a trajectory.
pub fn write(
    trace: &Trace,
    precision: Precision,
    comment: String,
    path: &Path,
    force: bool,
) -> anyhow::Result<()> {
    let components = COMPONENTS.iter().enumerate().map(|(index, (name, text))| {
        let component = move |k: usize| trace.states[k].x[index];
        let samples = match precision {
            Precision::Single => Samples::F32(Box::new(move |k| component(k) as f32)),
            Precision::Double => Samples::F64(Box::new(component)),
        };
        channel(name, text, samples)
    });
    let mut channels: Vec<_> = components.collect();
    channels.push(friction_mode(|k| trace.states[k].friction));
    let steps = Group {
        name: "model step".into(),
        records: trace.states.len(),
        time_s: Box::new(|k| trace.time_s(k)),
        channels,
    };
    let periods = Group {
        name: "PWM period".into(),
        records: trace.duties.len(),
        time_s: Box::new(|n| trace.pwm_time_s(n)),
        channels: vec![channel(
            "duty_code",
            &format!(
                "Duty of the period that begins, counts of the PWM timer; {} are full duty.",
                trace.pwm_period
            ),
            Samples::U16(Box::new(|n| trace.duties[n])),
        )],
    };
    super::write(path, force, comment, vec![steps, periods])
}
