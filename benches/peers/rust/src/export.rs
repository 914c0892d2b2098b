//! The model's coefficients and reference values of its right-hand side, from the shared model.

use nalgebra::Vector4;
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Injection;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::Model;

/// Speeds of every job, rpm.
fn wheel_speeds_rpm() -> impl Iterator<Item = f64> {
    (0..31).map(|i| 1600.0 + 10.0 * f64::from(i))
}

/// Constants of the right-hand side at one speed.
#[derive(Clone, Copy, Serialize)]
pub struct Coefficients {
    /// Wheel speed, rpm.
    pub wheel_speed_rpm: f64,
    /// l_f/v, s.
    pub front_lever_s: f64,
    /// l_r/v, s.
    pub rear_lever_s: f64,
    /// 1/(m v), s/(kg m).
    pub lateral_gain: f64,
    /// l_f/I_z, 1/(kg m).
    pub front_yaw_gain: f64,
    /// l_r/I_z, 1/(kg m).
    pub rear_yaw_gain: f64,
    /// k1, N/rad.
    pub front_linear_n_per_rad: f64,
    /// k2, N/rad^3.
    pub front_cubic_n_per_rad3: f64,
    /// k3, N/rad.
    pub rear_linear_n_per_rad: f64,
    /// k4, N/rad^3.
    pub rear_cubic_n_per_rad3: f64,
    /// r_s tau_M, N m.
    pub motor_torque_nm: f64,
    /// t_p + t_m, m.
    pub trail_m: f64,
    /// b_w, N m s/rad.
    pub damping_nm_s_per_rad: f64,
    /// 1/J_w, 1/(kg m^2).
    pub inverse_inertia_per_kg_m2: f64,
    /// tau_c, N m.
    pub friction_limit_nm: f64,
}

impl Coefficients {
    fn new(scenario: &Scenario<f64>) -> Self {
        let Scenario {
            vehicle,
            steering,
            friction,
            ..
        } = scenario;
        let speed_m_per_s = vehicle.speed_m_per_s(scenario.run.wheel_speed_rpm);
        let (front, rear) = (scenario.tires.front.cubic(), scenario.tires.rear.cubic());
        Self {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            front_lever_s: vehicle.front_axle_distance_m / speed_m_per_s,
            rear_lever_s: vehicle.rear_axle_distance_m / speed_m_per_s,
            lateral_gain: 1.0 / (vehicle.mass_kg * speed_m_per_s),
            front_yaw_gain: vehicle.front_axle_distance_m / vehicle.yaw_inertia_kg_m2,
            rear_yaw_gain: vehicle.rear_axle_distance_m / vehicle.yaw_inertia_kg_m2,
            front_linear_n_per_rad: front.linear_n_per_rad,
            front_cubic_n_per_rad3: front.cubic_n_per_rad3,
            rear_linear_n_per_rad: rear.linear_n_per_rad,
            rear_cubic_n_per_rad3: rear.cubic_n_per_rad3,
            motor_torque_nm: steering.motor_torque_nm(),
            trail_m: steering.trail_m(),
            damping_nm_s_per_rad: steering.damping_nm_s_per_rad,
            inverse_inertia_per_kg_m2: 1.0 / steering.inertia_kg_m2,
            friction_limit_nm: friction.limit_nm(steering.pneumatic_trail_m),
        }
    }
}

/// The scenario at each speed.
fn scenarios() -> impl Iterator<Item = Scenario<f64>> {
    wheel_speeds_rpm().map(|wheel_speed_rpm| {
        let mut scenario = Scenario::reconstruction();
        scenario.run.wheel_speed_rpm = wheel_speed_rpm;
        scenario
    })
}

/// The constants at each speed.
pub fn coefficients() -> Vec<Coefficients> {
    scenarios().map(|s| Coefficients::new(&s)).collect()
}

/// The shared model's right-hand side at one state and along one tangent.
#[derive(Serialize)]
pub struct Sample {
    /// Index of the speed.
    pub lane: usize,
    /// Friction's torque, N m.
    pub friction_nm: f64,
    /// 1 as long as the steering moves, 0 in stick.
    pub free: f64,
    /// State.
    pub x: [f64; 4],
    /// Tangent vector.
    pub tangent: [f64; 4],
    /// Time derivative of the state.
    pub rates: [f64; 4],
    /// Time derivative of the tangent vector.
    pub tangent_rates: [f64; 4],
}

/// Reference values of the right-hand side at random states, the same ones in every run.
pub fn samples() -> Vec<Sample> {
    let mut seed = 1_u64;
    // From -1 to 1, by a linear congruential generator's high bits.
    let mut random = move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let modes = [
        FrictionMode::Sticking,
        FrictionMode::Negative,
        FrictionMode::Neutral,
        FrictionMode::Positive,
    ];
    let mut samples = Vec::new();
    for (lane, scenario) in scenarios().enumerate() {
        let model = Model::new(&scenario);
        let limit_nm = model.friction_limit_nm();
        for mode in modes {
            let mut x = Vector4::new(0.3, 1.0, 0.5, 1.0).map(|scale| scale * random());
            let mut tangent = Vector4::from_fn(|_, _| random());
            let (free, friction_nm) = match mode {
                FrictionMode::Sticking => (0.0, 0.0),
                FrictionMode::Negative => (1.0, -limit_nm),
                FrictionMode::Neutral => (1.0, 0.0),
                FrictionMode::Positive => (1.0, limit_nm),
            };
            if mode == FrictionMode::Sticking {
                // At rest, and so is its neighbour.
                (x[3], tangent[3]) = (0.0, 0.0);
            }
            // The neutral mode's torque is the sign's at the rate; without a law there is none.
            let model = if mode == FrictionMode::Neutral {
                let mut scenario = scenario;
                scenario.friction.law = shared_model::friction::FrictionLaw::None;
                Model::new(&scenario)
            } else {
                model
            };
            let rates = |x: Vector4<f64>| model.derivative(&x, Injection::Off, mode);
            // Exact but for rounding: the right-hand side is a cubic polynomial.
            let difference = |h: f64| rates(x + tangent * h) - rates(x - tangent * h);
            let step = 0.25;
            let tangent_rates = (difference(step) * 8.0 - difference(2.0 * step)) / (12.0 * step);
            samples.push(Sample {
                lane,
                friction_nm,
                free,
                x: x.into(),
                tangent: tangent.into(),
                rates: rates(x).into(),
                tangent_rates: tangent_rates.into(),
            });
        }
    }
    samples
}
