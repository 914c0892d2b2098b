//! The ECU's program fed with the sensor frames of a log, in open loop: what it would have done in
//! that drive.

use super::{Frame, LogError, Reader};
use crate::ecu::{Ecu, Software};
use dynamics::words::Short;
use serde::Serialize;
use shared_model::bus::Message;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::frame::{
    MAX_DELTA_COUNTER, SENSOR_DATA_ID, decode_actuation, decode_measurement, encode_measurement,
};
use shared_model::signal::{Actuation, Mode};
use shared_model::{InvalidScenario, Scenario};
use std::io::BufRead;

/// Longest time without a frame, s. The ECU's safe state follows after a hundredth of a second; a
/// log with a longer gap is of two drives.
const LONGEST_GAP_S: f64 = 60.0;

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A frame is earlier than the one before.
    #[error("line {line}: the time goes back from {} to {} s", Short(*.before_s), Short(*.time_s))]
    Backwards {
        /// Its number, from 1 on.
        line: u64,
        /// Time of the frame before, s.
        before_s: f64,
        /// Time of the frame, s.
        time_s: f64,
    },
    /// A gap, as between two drives.
    #[error(
        "line {line}: {} s without a frame: must be at most {LONGEST_GAP_S} s; split the log",
        Short(*.gap_s)
    )]
    Gap {
        /// Its number, from 1 on.
        line: u64,
        /// Time since the frame before, s.
        gap_s: f64,
    },
    /// No sensor frame.
    #[error(
        "there is no sensor frame: it has the identifier 0x100 and 24 bytes, on CAN FD, as docs/dithersteer.dbc says"
    )]
    NoSensorFrame,
    /// The configuration is not valid.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
}

/// The ECU in a control tick. Signals are named as in the DBC file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Row {
    /// Time since the first sensor frame, s.
    pub time_s: f64,
    /// Whether a sensor frame came in this tick.
    pub frame: bool,
    /// Its wheel speed, rpm; empty without a frame, as are the next four.
    pub wheel_speed_rpm: Option<f32>,
    /// Its yaw rate, rad/s.
    pub yaw_rate_rad_per_s: Option<f32>,
    /// Its front steering angle, rad.
    pub steering_angle_rad: Option<f32>,
    /// Its steering rate, rad/s.
    pub steering_rate_rad_per_s: Option<f32>,
    /// Its current request, A.
    pub current_request_a: Option<f32>,
    /// The ECU's mode.
    pub mode: &'static str,
    /// Its faults, one bit each.
    pub faults: u32,
    /// Its warnings, one bit each.
    pub warnings: u16,
    /// Motor's share of the servo voltage, V.
    pub motor_voltage_v: f32,
    /// Amplitude of the dither on the servo voltage, V.
    pub dither_amplitude_v: f32,
    /// Duty code of the servo's PWM.
    pub duty_code: u16,
}

/// What a replay came to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Summary {
    /// Control ticks.
    pub ticks: u64,
    /// Sensor frames.
    pub sensor_frames: u64,
    /// Those whose E2E check fails; the ECU gets them as they are.
    pub damaged: u64,
    /// Sensor frames that another one in the same tick replaced.
    pub replaced: u64,
    /// Frames of others, and frames of another length.
    pub foreign: u64,
    /// Actuator frames of the log in a tick of the replay.
    pub recorded: u64,
    /// Those of them that the replay sent too, bit for bit.
    pub equal: u64,
}

/// Runs the ECU's program of a scenario with the sensor frames of a log, up to its end or until
/// `on_tick`, which is called with each control tick, returns false. A sensor frame comes in the
/// tick to which its time is nearest, counted from the first.
///
/// A vehicle answers the challenges of the ECU in it. In each whole sensor frame the echo is therefore
/// replaced by this ECU's challenge, and the checksum with it.
///
/// # Errors
/// If the log cannot be read, has no sensor frame, a gap of over 60 s or a time that goes back.
pub fn replay(
    scenario: &Scenario<f32>,
    log: &mut Reader<impl BufRead>,
    on_tick: &mut dyn FnMut(&Row) -> bool,
) -> Result<Summary, ReplayError> {
    let tick_s = 1.0 / f64::from(scenario.run.control_rate_hz);
    let mut ecu = Replayed::new(scenario)?;
    let mut first_and_last_s = None;
    let mut now = Received::default();
    while let Some(frame) = log.next_frame()? {
        let Some((message, bytes)) = known(&frame) else {
            ecu.summary.foreign += 1;
            continue;
        };
        let (first_s, last_s) = match (first_and_last_s, message) {
            (Some(times_s), _) => times_s,
            (None, Message::Sensor) => (frame.time_s, frame.time_s),
            // Of no tick of the replay.
            (None, _) => continue,
        };
        check_time(log.line(), last_s, frame.time_s)?;
        first_and_last_s = Some((first_s, frame.time_s));
        let tick = ((frame.time_s - first_s) / tick_s).round() as u64;
        while ecu.summary.ticks < tick {
            if !ecu.tick(std::mem::take(&mut now), tick_s, on_tick) {
                return Ok(ecu.summary);
            }
        }
        if message == Message::Sensor {
            ecu.summary.sensor_frames += 1;
            let earlier = now.sensor.replace(bytes);
            ecu.summary.replaced += u64::from(earlier.is_some());
        } else {
            now.actuator = Some(bytes);
        }
    }
    if first_and_last_s.is_none() {
        return Err(ReplayError::NoSensorFrame);
    }
    ecu.tick(now, tick_s, on_tick);
    Ok(ecu.summary)
}

/// Frames of the log in one control tick.
#[derive(Default)]
struct Received {
    sensor: Option<FrameBytes>,
    actuator: Option<FrameBytes>,
}

fn known(frame: &Frame) -> Option<(Message, FrameBytes)> {
    let bytes = frame.data.as_slice().try_into().ok()?;
    let messages = [Message::Sensor, Message::Actuator];
    let is_its = |message: &Message| u32::from(message.can_identifier()) == frame.identifier;
    Some((messages.into_iter().find(is_its)?, bytes))
}

fn check_time(line: u64, before_s: f64, time_s: f64) -> Result<(), ReplayError> {
    let gap_s = time_s - before_s;
    if gap_s < 0.0 {
        return Err(ReplayError::Backwards {
            line,
            before_s,
            time_s,
        });
    }
    if gap_s > LONGEST_GAP_S {
        return Err(ReplayError::Gap { line, gap_s });
    }
    Ok(())
}

struct Replayed {
    ecu: Software,
    periods_per_tick: u32,
    actuation: Option<Actuation<f32>>,
    summary: Summary,
}

impl Replayed {
    fn new(scenario: &Scenario<f32>) -> Result<Self, InvalidScenario> {
        Ok(Self {
            ecu: Software::new(scenario)?,
            periods_per_tick: scenario.periods_per_tick(),
            actuation: None,
            summary: Summary::default(),
        })
    }

    /// The PWM periods up to and with that of a control tick, at whose end the sensor frame is
    /// there.
    fn tick(
        &mut self,
        received: Received,
        tick_s: f64,
        on_tick: &mut dyn FnMut(&Row) -> bool,
    ) -> bool {
        interrupt::check();
        let (mut sent, mut duty_code) = (None, 0);
        for period in 1..=self.periods_per_tick {
            let (actuation, summary) = (&mut self.actuation, &mut self.summary);
            let answer = &mut |from_ecu: &Packet| {
                sent = from_ecu.frame;
                duty_code = from_ecu.duty_code;
                let decoded = from_ecu
                    .frame
                    .and_then(|frame| decode_actuation(&frame).ok());
                *actuation = decoded.or(*actuation);
                let challenge = actuation.map_or(0, |actuation| actuation.challenge);
                let is_tick = period == self.periods_per_tick;
                let frame = received.sensor.filter(|_| is_tick);
                Packet {
                    frame: frame.map(|frame| answered(frame, challenge, summary)),
                    ..*from_ecu
                }
            };
            self.ecu
                .period(answer)
                .expect("a program on the host is always reached");
        }
        if let Some(recorded) = received.actuator {
            self.summary.recorded += 1;
            self.summary.equal += u64::from(sent == Some(recorded));
        }
        let time_s = self.summary.ticks as f64 * tick_s;
        self.summary.ticks += 1;
        let Some(actuation) = self.actuation else {
            return true;
        };
        let measured = received.sensor.map(|frame| decode_measurement(&frame));
        on_tick(&Row {
            time_s,
            frame: measured.is_some(),
            wheel_speed_rpm: measured.map(|measured| measured.wheel_speed_rpm),
            yaw_rate_rad_per_s: measured.map(|measured| measured.yaw_rate_rad_per_s),
            steering_angle_rad: measured.map(|measured| measured.steering_angle_rad),
            steering_rate_rad_per_s: measured.map(|measured| measured.steering_rate_rad_per_s),
            current_request_a: measured.map(|measured| measured.current_request_a),
            mode: mode_name(actuation.mode),
            faults: actuation.faults,
            warnings: actuation.warnings,
            motor_voltage_v: actuation.motor_voltage_v,
            dither_amplitude_v: actuation.dither_amplitude_v,
            duty_code,
        })
    }
}

fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Starting => "starting",
        Mode::Active => "active",
        Mode::Safe => "safe",
    }
}

/// A sensor frame with the answer to this ECU's challenge; one that is damaged stays so.
fn answered(frame: FrameBytes, challenge: u8, summary: &mut Summary) -> FrameBytes {
    let status = Receiver::new(SENSOR_DATA_ID, MAX_DELTA_COUNTER).check(Some(&frame));
    if status == Status::Error {
        summary.damaged += 1;
        return frame;
    }
    let [_, _, counter, ..] = frame;
    let sender = &mut Sender::starting_at(SENSOR_DATA_ID, counter);
    encode_measurement(&decode_measurement(&frame), challenge, sender)
}
