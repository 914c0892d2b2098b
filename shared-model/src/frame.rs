//! Sensor and actuator frames: CAN FD payloads of 24 bytes, little-endian, protected end to end.
//! `docs/dithersteer.dbc` describes them to other tools.
//!
//! | bytes | sensor frame | actuator frame |
//! |---|---|---|
//! | 0..3 | checksum and counter, see [`e2e`](crate::e2e) | the same |
//! | 3 | challenge echo, see [`freshness`](crate::freshness) | mode (bits 0 to 6), bridge on (bit 7) |
//! | 4..8 | wheel speed | faults |
//! | 8..12 | yaw rate | motor voltage |
//! | 12..16 | steering angle | dither amplitude |
//! | 16..20 | steering rate | wheel speed limit |
//! | 20..24 | current request | warnings (2 bytes), counter of the last valid sensor frame, challenge |
//!
//! Numbers pass as their bits: to judge a NaN or an impossible value is the gate's task, not the
//! link's.

use crate::e2e::Sender;
use crate::e2e_state_machine::Config;
use crate::exchange::FrameBytes;
use crate::signal::{Actuation, Measurement, Mode};
use core::fmt;

/// Data ID of sensor frames.
pub const SENSOR_DATA_ID: u16 = 0x5A01;
/// Data ID of actuator frames.
pub const ACTUATOR_DATA_ID: u16 = 0x5A02;
/// Greatest tolerated step of the counter, for both frames.
///
/// Two lost frames in a row are bridged: in the 3 ms to the next one, at 1 kHz, even the chaotic
/// motion at 1750 rpm moves no signal by more than 2 % of its range. A whole frame out of place,
/// its counter being arbitrary, passes with a chance of 3 in 256, so this is not larger than
/// needed.
pub const MAX_DELTA_COUNTER: u8 = 3;

/// Window and thresholds of the ECU's state machine for sensor frames.
///
/// * *Loss*: more than 13 of the last 24 frames missing is invalid. Two of three lost for good reach
///   that in 20 ticks. Two lost in a row, or every second one, do not. A random loss of 10 % does in
///   one window of 1.5e8. Ten in a row are the age of the last frame, and found by it.
/// * *Errors* (damaged or stale frames): more than 7 of 24. A damaged frame passes the checksum with a
///   probability of 2^-16, so a link that damages more is not to be relied upon. Of replayed frames one
///   in 16 has a fresh echo by chance, so that 8 errors come within 8 to 10 ticks.
/// * *Start*: 11 good frames, so that the threshold of the valid state holds from its first tick on.
/// * *Back from invalid*, before the ECU is active: almost a whole window of good frames. An active
///   ECU does not come back: its safe state is latched.
pub const SENSOR_STATE_MACHINE: Config = Config {
    window_size: 24,
    min_ok_init: 11,
    max_error_init: 7,
    min_ok_valid: 11,
    max_error_valid: 7,
    min_ok_invalid: 20,
    max_error_invalid: 2,
};

/// Bit of the actuator frame's mode byte that is set while the bridge is on.
const BRIDGE_ON: u8 = 0x80;

/// A frame as words of four bytes, on whose borders its numbers lie.
type Words = [[u8; 4]; 6];

/// A mode code that no [`Mode`] has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownMode(pub u8);

impl fmt::Display for UnknownMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unknown mode {}", self.0)
    }
}

impl core::error::Error for UnknownMode {}

/// The sensor frame of a measurement, with the challenge of the last valid actuator frame (0 before
/// the first).
///
/// ```
/// use shared_model::e2e::{Receiver, Sender, Status};
/// use shared_model::frame::{
///     MAX_DELTA_COUNTER, SENSOR_DATA_ID, challenge_echo, decode_measurement, encode_measurement,
/// };
/// use shared_model::signal::Measurement;
/// let measurement = Measurement {
///     wheel_speed_rpm: 1750.0,
///     yaw_rate_rad_per_s: 0.3,
///     steering_angle_rad: -0.02,
///     steering_rate_rad_per_s: 1.5,
///     current_request_a: 0.0,
/// };
/// let frame = encode_measurement(&measurement, 0x35, &mut Sender::new(SENSOR_DATA_ID));
/// let mut receiver = Receiver::new(SENSOR_DATA_ID, MAX_DELTA_COUNTER);
/// assert_eq!(receiver.check(Some(&frame)), Status::Ok);
/// assert_eq!(decode_measurement(&frame), measurement);
/// assert_eq!(challenge_echo(&frame), 0x35);
/// ```
pub fn encode_measurement(
    measurement: &Measurement<f32>,
    challenge_echo: u8,
    sender: &mut Sender,
) -> FrameBytes {
    let words = [
        [0, 0, 0, challenge_echo],
        measurement.wheel_speed_rpm.to_le_bytes(),
        measurement.yaw_rate_rad_per_s.to_le_bytes(),
        measurement.steering_angle_rad.to_le_bytes(),
        measurement.steering_rate_rad_per_s.to_le_bytes(),
        measurement.current_request_a.to_le_bytes(),
    ];
    protected(words, sender)
}

/// The measurement in a sensor frame whose check was [ok](crate::e2e::Status::is_ok).
pub fn decode_measurement(frame: &FrameBytes) -> Measurement<f32> {
    let [_, wheel_speed, yaw_rate, angle, rate, current] = words(frame);
    Measurement {
        wheel_speed_rpm: f32::from_le_bytes(wheel_speed),
        yaw_rate_rad_per_s: f32::from_le_bytes(yaw_rate),
        steering_angle_rad: f32::from_le_bytes(angle),
        steering_rate_rad_per_s: f32::from_le_bytes(rate),
        current_request_a: f32::from_le_bytes(current),
    }
}

/// The challenge that a sensor frame returns, from a frame whose check was
/// [ok](crate::e2e::Status::is_ok).
pub fn challenge_echo(frame: &FrameBytes) -> u8 {
    let [_, _, _, echo, ..] = *frame;
    echo
}

/// The actuator frame of an actuation.
pub fn encode_actuation(actuation: &Actuation<f32>, sender: &mut Sender) -> FrameBytes {
    let [warnings_low, warnings_high] = actuation.warnings.to_le_bytes();
    let bridge = if actuation.bridge_on { BRIDGE_ON } else { 0 };
    let words = [
        [0, 0, 0, actuation.mode as u8 | bridge],
        actuation.faults.to_le_bytes(),
        actuation.motor_voltage_v.to_le_bytes(),
        actuation.dither_amplitude_v.to_le_bytes(),
        actuation.wheel_speed_limit_rpm.to_le_bytes(),
        [
            warnings_low,
            warnings_high,
            actuation.sensor_counter,
            actuation.challenge,
        ],
    ];
    protected(words, sender)
}

/// The actuation in an actuator frame whose check was [ok](crate::e2e::Status::is_ok).
///
/// # Errors
/// If the mode is unknown: a sender of another version.
pub fn decode_actuation(frame: &FrameBytes) -> Result<Actuation<f32>, UnknownMode> {
    let [head, faults, voltage, amplitude, speed_limit, tail] = words(frame);
    let [_, _, _, mode_and_bridge] = head;
    let mode = mode_and_bridge & !BRIDGE_ON;
    let [warnings_low, warnings_high, sensor_counter, challenge] = tail;
    Ok(Actuation {
        mode: Mode::from_code(mode).ok_or(UnknownMode(mode))?,
        faults: u32::from_le_bytes(faults),
        motor_voltage_v: f32::from_le_bytes(voltage),
        dither_amplitude_v: f32::from_le_bytes(amplitude),
        wheel_speed_limit_rpm: f32::from_le_bytes(speed_limit),
        warnings: u16::from_le_bytes([warnings_low, warnings_high]),
        sensor_counter,
        bridge_on: mode_and_bridge & BRIDGE_ON != 0,
        challenge,
    })
}

// Both directions are patterns, not indices: what cannot miss needs no proof that it does not
// panic.

#[rustfmt::skip]
fn protected(words: Words, sender: &mut Sender) -> FrameBytes {
    let [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3],
         [d0, d1, d2, d3], [e0, e1, e2, e3], [f0, f1, f2, f3]] = words;
    let mut frame = [a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3,
                     d0, d1, d2, d3, e0, e1, e2, e3, f0, f1, f2, f3];
    sender.protect(&mut frame);
    frame
}

#[rustfmt::skip]
fn words(frame: &FrameBytes) -> Words {
    let [a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3,
         d0, d1, d2, d3, e0, e1, e2, e3, f0, f1, f2, f3] = *frame;
    [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3],
     [d0, d1, d2, d3], [e0, e1, e2, e3], [f0, f1, f2, f3]]
}
