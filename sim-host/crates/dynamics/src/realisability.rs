//! What a steering actuator can produce of the dither.
//!
//! The paper adds the dither to the angle ahead of each nonlinearity as if that cost nothing. A
//! motor would have to move the steering by that angle: at a steering without friction and tyres,
//! (10) becomes J_w delta'' + b_w delta' = r_s tau_M, whose frequency response is delta/(r_s tau_M)
//! = 1/((i w)^2 J_w + i w b_w). Friction and tyres only take from what is left.

use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use plot::number::four_digits;
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::steering::Steering;

/// Least and greatest angular frequency of the table, rad/s.
pub const FREQUENCIES_RAD_PER_S: (f64, f64) = (1.0, 20_000.0);
/// Points of the table in a decade.
const POINTS_PER_DECADE: f64 = 50.0;

/// The steering's response to the torque r_s tau_M at one angular frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Response {
    /// Angular frequency w, rad/s.
    pub frequency_rad_per_s: f64,
    /// Amplitude of the steering angle over that of the torque, 1/(w sqrt((J_w w)^2 + b_w^2)),
    /// rad/(N m).
    pub magnitude_rad_per_nm: f64,
    /// The same in decibels over 1 rad/(N m).
    pub magnitude_db: f64,
    /// Phase of the angle over the torque, -180 degrees + atan(b_w/(J_w w)), degrees.
    pub phase_deg: f64,
    /// Torque about the steering axis that the square wave's amplitude would need, taken as a
    /// sine, N m.
    pub square_torque_nm: f64,
    /// Torque about the steering axis that the sine's amplitude would need, N m.
    pub sine_torque_nm: f64,
    /// Amplitude that the motor's torque r_s tau_M reaches if all of it swings, rad.
    pub reached_rad: f64,
}

/// Amplitudes of the two dithers, rad.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Amplitudes {
    /// Square wave.
    pub square_rad: f64,
    /// Sine.
    pub sine_rad: f64,
}

impl Amplitudes {
    /// The amplitudes ahead of the nonlinearities that voltages stand for in a scenario.
    pub fn from_volts(scenario: &Scenario<f64>, square_v: f64, sine_v: f64) -> Self {
        Self {
            square_rad: square_v * scenario.dither.square_rad_per_volt,
            sine_rad: sine_v * scenario.dither.sine_rad_per_volt,
        }
    }
}

/// The response of a steering at an angular frequency greater than 0.
///
/// ```
/// use dynamics::realisability::{Amplitudes, response};
/// let steering = shared_model::Scenario::reconstruction().steering;
/// let amplitudes = Amplitudes { square_rad: 0.1, sine_rad: 0.159 };
/// let response = response(&steering, 2000.0, &amplitudes);
/// // J_w w^2 W, to which the damping adds a twenty-thousandth.
/// assert!((response.square_torque_nm / 4.0e6 - 1.0).abs() < 1e-4);
/// ```
pub fn response(
    steering: &Steering<f64>,
    frequency_rad_per_s: f64,
    amplitudes: &Amplitudes,
) -> Response {
    let w = frequency_rad_per_s;
    let (inertia, damping) = (steering.inertia_kg_m2, steering.damping_nm_s_per_rad);
    let stiffness_nm_per_rad = w * (inertia * w).hypot(damping);
    let magnitude = 1.0 / stiffness_nm_per_rad;
    Response {
        frequency_rad_per_s: w,
        magnitude_rad_per_nm: magnitude,
        magnitude_db: 20.0 * magnitude.log10(),
        phase_deg: -180.0 + damping.atan2(inertia * w).to_degrees(),
        square_torque_nm: stiffness_nm_per_rad * amplitudes.square_rad,
        sine_torque_nm: stiffness_nm_per_rad * amplitudes.sine_rad,
        reached_rad: steering.motor_torque_nm().abs() * magnitude,
    }
}

/// The dither of one waveform against what the actuator can do at its frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Demand {
    /// Shape of the dither.
    pub waveform: Waveform,
    /// Its amplitude W, rad.
    pub amplitude_rad: f64,
    /// Torque J_w w^2 W that the inertia alone asks for, N m. For the square wave this is that of
    /// a sine of the same amplitude; its fundamental alone needs 4/pi times as much, its edges
    /// any torque there is.
    pub inertia_torque_nm: f64,
    /// The motor's torque about the steering axis, r_s tau_M, N m.
    pub motor_torque_nm: f64,
    /// The response at its frequency.
    pub response: Response,
}

impl Demand {
    /// Share of the amplitude that the motor's torque reaches.
    pub fn reached_share(&self) -> f64 {
        self.response.reached_rad / self.amplitude_rad
    }
}

/// The square wave and the sine of a scenario, each at its frequency.
pub fn demands(scenario: &Scenario<f64>, amplitudes: &Amplitudes) -> [Demand; 2] {
    let dither = &scenario.dither;
    let steering = &scenario.steering;
    [
        (
            Waveform::Square,
            dither.square_frequency_rad_per_s,
            amplitudes.square_rad,
        ),
        (
            Waveform::Sine,
            dither.sine_frequency_rad_per_s,
            amplitudes.sine_rad,
        ),
    ]
    .map(|(waveform, w, amplitude_rad)| Demand {
        waveform,
        amplitude_rad,
        inertia_torque_nm: steering.inertia_kg_m2 * w * w * amplitude_rad,
        motor_torque_nm: steering.motor_torque_nm().abs(),
        response: response(steering, w, amplitudes),
    })
}

/// The responses from 1 to 20,000 rad/s, fifty a decade.
pub fn responses(scenario: &Scenario<f64>, amplitudes: &Amplitudes) -> Vec<Response> {
    let (low, high) = FREQUENCIES_RAD_PER_S;
    let decades = (high / low).log10();
    let intervals = (decades * POINTS_PER_DECADE).ceil() as i32;
    (0..=intervals)
        .map(|k| {
            let share = f64::from(k) / f64::from(intervals);
            let w = low * 10.0_f64.powf(decades * share);
            response(&scenario.steering, w, amplitudes)
        })
        .collect()
}

/// The Bode diagram, magnitude above phase, with the frequencies of both dithers.
pub fn bode_chart(scenario: &Scenario<f64>, responses: &[Response]) -> Chart {
    let (low, high) = FREQUENCIES_RAD_PER_S;
    let frequency = AxisSpec::logarithmic("angular frequency \u{3c9} (rad/s)").from_to(low, high);
    let dither = &scenario.dither;
    let square = dither.square_frequency_rad_per_s;
    let sine = dither.sine_frequency_rad_per_s;
    let instants = vec![
        (square, format!("square, {} rad/s", four_digits(square))),
        (sine, format!("sine, {} rad/s", four_digits(sine))),
    ];
    let line = |value: fn(&Response) -> f64| {
        vec![Series {
            label: String::new(),
            points: responses
                .iter()
                .map(|response| (response.frequency_rad_per_s, value(response)))
                .collect(),
            look: Look::Line(0),
        }]
    };
    let unlabelled = |instants: &[(f64, String)]| {
        let at = |instant: &(f64, String)| (instant.0, String::new());
        instants.iter().map(at).collect()
    };
    Chart {
        heading: "What the steering passes of the motor's torque: 1/(Jw s\u{b2} + bw s)".into(),
        panels: vec![
            Panel {
                x: frequency.clone(),
                y: AxisSpec::logarithmic("magnitude (rad/(N m))"),
                series: line(|response| response.magnitude_rad_per_nm),
                instants: instants.clone(),
                ..Panel::default()
            },
            Panel {
                x: frequency,
                y: AxisSpec::linear("phase (degrees)").from_to(-185.0, -85.0),
                series: line(|response| response.phase_deg),
                instants: unlabelled(&instants),
                ..Panel::default()
            },
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;
    use shared_model::dither::Injection;
    use shared_model::friction::{FrictionLaw, FrictionMode};
    use shared_model::vehicle::{Model, STEERING_ANGLE};
    use std::f64::consts::TAU;

    const AMPLITUDES: Amplitudes = Amplitudes {
        square_rad: 0.1,
        sine_rad: 0.159,
    };

    /// The steering without friction and tyres, its motor current a sine: the model's own
    /// right-hand side.
    fn derivative(w: f64, time_s: f64, x: &Vector4<f64>) -> Vector4<f64> {
        let mut scenario = Scenario::reconstruction();
        scenario.friction.law = FrictionLaw::None;
        scenario.tires.front.peak_n = 0.0;
        scenario.tires.rear.peak_n = 0.0;
        scenario.steering.motor_current_a *= (w * time_s).sin();
        Model::new(&scenario).derivative(x, Injection::Off, FrictionMode::Neutral)
    }

    /// Amplitude (rad) and phase (degrees) of the angle in the last of the periods that it takes to
    /// settle.
    fn simulated(w: f64) -> (f64, f64) {
        const STEPS: usize = 400;
        let period_s = TAU / w;
        let step_s = period_s / STEPS as f64;
        // The free motion dies out with J_w/b_w = 0.05 s.
        let settled = STEPS * (1.5 / period_s).ceil() as usize;
        let mut x = Vector4::zeros();
        let (mut in_phase, mut ahead) = (0.0, 0.0);
        for k in 0..settled + STEPS {
            let t = k as f64 * step_s;
            if k >= settled {
                let (sin, cos) = (w * t).sin_cos();
                in_phase += x[STEERING_ANGLE] * sin * 2.0 / STEPS as f64;
                ahead += x[STEERING_ANGLE] * cos * 2.0 / STEPS as f64;
            }
            let half = 0.5 * step_s;
            let k1 = derivative(w, t, &x);
            let k2 = derivative(w, t + half, &(x + k1 * half));
            let k3 = derivative(w, t + half, &(x + k2 * half));
            let k4 = derivative(w, t + step_s, &(x + k3 * step_s));
            x += (k1 + (k2 + k3) * 2.0 + k4) * (step_s / 6.0);
        }
        let phase_deg = ahead.atan2(in_phase).to_degrees();
        let phase_deg = if phase_deg > 0.0 {
            phase_deg - 360.0
        } else {
            phase_deg
        };
        (in_phase.hypot(ahead), phase_deg)
    }

    #[test]
    fn the_closed_form_is_the_simulated_response() {
        let steering = Scenario::reconstruction().steering;
        for w in [1.0, 20.0, 300.0, 2000.0, 4000.0] {
            let (amplitude_rad, phase_deg) = simulated(w);
            let closed = response(&steering, w, &AMPLITUDES);
            let error = amplitude_rad / closed.reached_rad - 1.0;
            assert!(error.abs() < 1e-5, "{w} rad/s: {error:e}");
            let error_deg = phase_deg - closed.phase_deg;
            assert!(error_deg.abs() < 1e-3, "{w} rad/s: {error_deg}");
        }
    }

    #[test]
    fn the_papers_dither_needs_meganewton_metres() {
        let scenario = Scenario::reconstruction();
        let amplitudes = Amplitudes::from_volts(&scenario, 0.1, 1.0);
        let [square, sine] = demands(&scenario, &amplitudes);
        assert!((square.inertia_torque_nm - 4.0e6).abs() < 1.0);
        assert!((sine.inertia_torque_nm - 160e6 / TAU).abs() < 1.0);
        assert!((square.motor_torque_nm - 16.38).abs() < 1e-9);
        for demand in [square, sine] {
            let share = demand.motor_torque_nm / demand.inertia_torque_nm;
            assert!((demand.reached_share() / share - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn the_table_goes_from_end_to_end() {
        let all = responses(&Scenario::reconstruction(), &AMPLITUDES);
        assert_eq!(all[0].frequency_rad_per_s, 1.0);
        assert!((all[all.len() - 1].frequency_rad_per_s / 20_000.0 - 1.0).abs() < 1e-12);
        // At the corner frequency b_w/J_w = 20 rad/s the phase is half way.
        let corner = response(&Scenario::reconstruction().steering, 20.0, &AMPLITUDES);
        assert!((corner.phase_deg + 135.0).abs() < 1e-9);
    }
}
