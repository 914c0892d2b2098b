//! A recorded motion as CSV.

use measures::trace::Trace;
use std::io::Write;

/// Writes the motion as CSV, one row per model step; the duty code is that of the step's last
/// PWM period.
///
/// # Errors
/// If the writer fails.
pub fn write_csv(trace: &Trace, to: &mut dyn Write) -> csv::Result<()> {
    let mut csv = csv::Writer::from_writer(to);
    csv.write_record([
        "time_s",
        "sideslip_rad",
        "yaw_rate_rad_per_s",
        "steering_angle_rad",
        "steering_rate_rad_per_s",
        "friction_mode",
        "duty_code",
    ])?;
    let duties = trace.duties.chunks(trace.samples_per_step);
    for (k, (state, duties)) in trace.states.iter().zip(duties).enumerate() {
        let mut row = vec![trace.time_s(k).to_string()];
        row.extend(state.x.iter().map(f64::to_string));
        row.push(format!("{:?}", state.friction).to_lowercase());
        row.push(duties.last().map_or(String::new(), u16::to_string));
        csv.write_record(row)?;
    }
    Ok(csv.flush()?)
}
