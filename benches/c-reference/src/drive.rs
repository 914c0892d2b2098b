//! Input of the ECU: a drive through the speed at which the dither starts, with frames that are
//! lost, damaged and repeated, and a broken sensor towards its end.

use shared_model::dither::Injection;
use shared_model::e2e::Sender;
use shared_model::exchange::FrameBytes;
use shared_model::frame::{SENSOR_DATA_ID, encode_measurement};
use shared_model::signal::Measurement;
use shared_model::vehicle::{Model, STEERING_ANGLE, STEERING_RATE, State, YAW_RATE};
use shared_model::{Scenario, integrate};

/// Control ticks of a drive.
pub const TICKS: u32 = 3000;
/// The tick from which on the yaw rate is no number.
const BREAKS_AT: u32 = 2700;

/// The sensors of a vehicle.
pub struct Drive {
    model: Model<f32>,
    state: State<f32>,
    step_s: f32,
    sender: Sender,
    last: Option<FrameBytes>,
}

impl Drive {
    pub fn new(scenario: &Scenario<f32>) -> Self {
        let model = Model::new(scenario);
        Self {
            model,
            state: model.initial_state(scenario),
            step_s: 1.0 / scenario.run.control_rate_hz,
            sender: Sender::new(SENSOR_DATA_ID),
            last: None,
        }
    }

    /// The sensor frame of a tick, if one comes; it returns the ECU's last challenge.
    pub fn frame(&mut self, tick: u32, challenge: u8) -> Option<FrameBytes> {
        integrate::step(&self.model, &mut self.state, self.step_s, Injection::Off);
        let mut frame = encode_measurement(&self.measurement(tick), challenge, &mut self.sender);
        let last = self.last.replace(frame);
        if tick < 5 || tick % 97 == 13 {
            return None;
        }
        if tick % 101 == 50 {
            let [.., byte] = &mut frame;
            *byte ^= 0x10;
        }
        if tick % 103 == 20 { last } else { Some(frame) }
    }

    fn measurement(&self, tick: u32) -> Measurement<f32> {
        let x = &self.state.x;
        Measurement {
            // From 1500 to 1900 rpm.
            wheel_speed_rpm: 1500.0 + 0.2 * tick.min(2000) as f32,
            yaw_rate_rad_per_s: if tick < BREAKS_AT {
                x[YAW_RATE]
            } else {
                f32::NAN
            },
            steering_angle_rad: x[STEERING_ANGLE],
            steering_rate_rad_per_s: x[STEERING_RATE],
            // Beyond the limit, and away from the feedback's table and back.
            current_request_a: match tick / 350 {
                1 => 18.0,
                2 => -5.0,
                4 => 10.2,
                5 => 10.4,
                _ => 10.0,
            },
        }
    }

    /// Bits in which the servo's pin shows another duty than was put out, in a PWM period: once in
    /// a while for one period.
    pub fn pin_error(period: u32) -> u16 {
        u16::from(period % 211 == 7)
    }
}
