//! The right-hand side of the equations of motion, and its state.

use super::chassis::{SlipForm, Vehicle};
use crate::dither::Injection;
use crate::friction::{Friction, FrictionLaw, FrictionMode, Sign};
use crate::tire::Tire;
use crate::{Real, Scenario};
use nalgebra::Vector4;

/// Index of the sideslip angle beta (rad) in a state vector.
pub const SIDESLIP: usize = 0;
/// Index of the yaw rate gamma (rad/s) in a state vector.
pub const YAW_RATE: usize = 1;
/// Index of the front steering angle delta_f (rad) in a state vector.
pub const STEERING_ANGLE: usize = 2;
/// Index of the steering rate (rad/s) in a state vector.
pub const STEERING_RATE: usize = 3;

/// State of the model: the vector and the friction element's mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T> {
    /// [beta (rad), gamma (rad/s), delta_f (rad), delta_f' (rad/s)].
    pub x: Vector4<T>,
    /// Mode of the dry friction.
    pub friction: FrictionMode,
}

impl<T: Real> State<T> {
    /// The same state in another arithmetic.
    pub fn map<U: Real>(&self, f: impl FnMut(T) -> U) -> State<U> {
        State {
            x: self.x.map(f),
            friction: self.friction,
        }
    }
}

/// The right-hand side of (14) with its constants computed for one scenario and wheel speed.
#[derive(Debug, Clone, Copy)]
pub struct Model<T> {
    slip_form: SlipForm,
    front: Tire<T>,
    rear: Tire<T>,
    /// l_f/v and l_r/v, s.
    front_lever_s: T,
    rear_lever_s: T,
    /// 1/(m v).
    lateral_gain: T,
    /// l_f/I_z and l_r/I_z.
    front_yaw_gain: T,
    rear_yaw_gain: T,
    motor_torque_nm: T,
    trail_m: T,
    damping_nm_s_per_rad: T,
    inverse_steering_inertia: T,
    friction: Friction<T>,
    friction_limit_nm: T,
    dither_frequency_rad_per_s: T,
}

/// The constants of [`Model::derivative`], for its evaluation in another form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants<T> {
    /// Form of the slip angles.
    pub slip_form: SlipForm,
    /// l_f/v, s.
    pub front_lever_s: T,
    /// l_r/v, s.
    pub rear_lever_s: T,
    /// 1/(m v), s/(kg m).
    pub lateral_gain: T,
    /// l_f/I_z, 1/(kg m).
    pub front_yaw_gain: T,
    /// l_r/I_z, 1/(kg m).
    pub rear_yaw_gain: T,
    /// Torque of the motor about the steering axis, N m.
    pub motor_torque_nm: T,
    /// Lever arm of the self-aligning torque, m.
    pub trail_m: T,
    /// Viscous damping, N m s/rad.
    pub damping_nm_s_per_rad: T,
    /// 1/J_w, 1/(kg m^2).
    pub inverse_steering_inertia: T,
}

impl<T: Real> Model<T> {
    /// The constants of the derivative except those of tyres and friction.
    pub fn constants(&self) -> Constants<T> {
        Constants {
            slip_form: self.slip_form,
            front_lever_s: self.front_lever_s,
            rear_lever_s: self.rear_lever_s,
            lateral_gain: self.lateral_gain,
            front_yaw_gain: self.front_yaw_gain,
            rear_yaw_gain: self.rear_yaw_gain,
            motor_torque_nm: self.motor_torque_nm,
            trail_m: self.trail_m,
            damping_nm_s_per_rad: self.damping_nm_s_per_rad,
            inverse_steering_inertia: self.inverse_steering_inertia,
        }
    }

    /// The tyres of the front and rear axle.
    pub fn tires(&self) -> (&Tire<T>, &Tire<T>) {
        (&self.front, &self.rear)
    }

    /// The model of a scenario, which must be valid.
    pub fn new(scenario: &Scenario<T>) -> Self {
        let (vehicle, steering) = (&scenario.vehicle, &scenario.steering);
        let mut friction = scenario.friction;
        let friction_limit_nm = friction.limit_nm(steering.pneumatic_trail_m);
        if friction_limit_nm == T::zero() {
            // A friction law without torque would only change modes without effect, endlessly where
            // the steering comes to rest.
            friction.law = FrictionLaw::None;
        }
        let mut model = Self {
            slip_form: vehicle.slip_form,
            front: Tire::new(scenario.tires.model, &scenario.tires.front),
            rear: Tire::new(scenario.tires.model, &scenario.tires.rear),
            // Until the speed is set below.
            front_lever_s: T::zero(),
            rear_lever_s: T::zero(),
            lateral_gain: T::zero(),
            front_yaw_gain: vehicle.front_axle_distance_m / vehicle.yaw_inertia_kg_m2,
            rear_yaw_gain: vehicle.rear_axle_distance_m / vehicle.yaw_inertia_kg_m2,
            motor_torque_nm: steering.motor_torque_nm(),
            trail_m: steering.trail_m(),
            damping_nm_s_per_rad: steering.damping_nm_s_per_rad,
            inverse_steering_inertia: T::one() / steering.inertia_kg_m2,
            friction,
            friction_limit_nm,
            dither_frequency_rad_per_s: scenario.dither.frequency_rad_per_s(),
        };
        model.set_wheel_speed_rpm(vehicle, scenario.run.wheel_speed_rpm);
        model
    }

    /// Continues at another wheel speed N, rpm, for a speed that changes slowly: (14) holds it
    /// constant and has no term in its rate.
    pub fn set_wheel_speed_rpm(&mut self, vehicle: &Vehicle<T>, wheel_speed_rpm: T) {
        let speed = vehicle.speed_m_per_s(wheel_speed_rpm);
        self.front_lever_s = vehicle.front_axle_distance_m / speed;
        self.rear_lever_s = vehicle.rear_axle_distance_m / speed;
        self.lateral_gain = T::one() / (vehicle.mass_kg * speed);
    }

    /// Continues with another torque of the motor about the steering axis, r_s tau_M, N m.
    pub fn set_motor_torque_nm(&mut self, motor_torque_nm: T) {
        self.motor_torque_nm = motor_torque_nm;
    }

    /// The same right-hand side in another arithmetic.
    pub fn map<U: Real>(&self, f: &impl Fn(T) -> U) -> Model<U> {
        Model {
            slip_form: self.slip_form,
            front: self.front.map(f),
            rear: self.rear.map(f),
            front_lever_s: f(self.front_lever_s),
            rear_lever_s: f(self.rear_lever_s),
            lateral_gain: f(self.lateral_gain),
            front_yaw_gain: f(self.front_yaw_gain),
            rear_yaw_gain: f(self.rear_yaw_gain),
            motor_torque_nm: f(self.motor_torque_nm),
            trail_m: f(self.trail_m),
            damping_nm_s_per_rad: f(self.damping_nm_s_per_rad),
            inverse_steering_inertia: f(self.inverse_steering_inertia),
            friction: self.friction.map(f),
            friction_limit_nm: f(self.friction_limit_nm),
            dither_frequency_rad_per_s: f(self.dither_frequency_rad_per_s),
        }
    }

    /// The state in which a run of the scenario starts.
    pub fn initial_state(&self, scenario: &Scenario<T>) -> State<T> {
        let run = &scenario.run;
        self.state(Vector4::new(
            run.sideslip_rad,
            run.yaw_rate_rad_per_s,
            run.steering_angle_rad,
            run.steering_rate_rad_per_s,
        ))
    }

    /// The state with the given vector, its friction mode as it is without dither.
    pub fn state(&self, x: Vector4<T>) -> State<T> {
        State {
            x,
            friction: self.mode_at(&x, Injection::Off),
        }
    }

    /// Slip angles of the front and rear tyres, rad, equations (4) and (5).
    pub fn slip_angles(&self, x: &Vector4<T>) -> (T, T) {
        let (beta, gamma, delta) = (x[SIDESLIP], x[YAW_RATE], x[STEERING_ANGLE]);
        let (front, rear) = match self.slip_form {
            SlipForm::SmallAngle => (self.front_lever_s * gamma, self.rear_lever_s * gamma),
            SlipForm::Exact => {
                let along = gamma * beta.cos();
                (
                    (self.front_lever_s * along).atan(),
                    (self.rear_lever_s * along).atan(),
                )
            }
        };
        (beta + front - delta, beta - rear)
    }

    /// Cornering forces of the front and rear tyres, N, with the dither ahead of them.
    #[inline(always)]
    pub fn cornering_forces(&self, x: &Vector4<T>, injection: Injection<T>) -> (T, T) {
        let (front, rear) = self.slip_angles(x);
        (
            self.front.force(front, injection),
            self.rear.force(rear, injection),
        )
    }

    /// Torque on the steering at rest from motor and tyres, r_s tau_M - tau_a, N m.
    pub fn driving_torque_nm(&self, x: &Vector4<T>, injection: Injection<T>) -> T {
        let (front, _) = self.cornering_forces(x, injection);
        self.motor_torque_nm - self.trail_m * front
    }

    /// Time derivative of the state vector, equation (14) with (24)'s effective nonlinearities,
    /// friction in `mode`.
    #[inline(always)]
    pub fn derivative(
        &self,
        x: &Vector4<T>,
        injection: Injection<T>,
        mode: FrictionMode,
    ) -> Vector4<T> {
        let (gamma, rate) = (x[YAW_RATE], x[STEERING_RATE]);
        let (front, rear) = self.cornering_forces(x, injection);
        let yaw = self.front_yaw_gain * front - self.rear_yaw_gain * rear;
        let acceleration = match mode {
            FrictionMode::Sticking => T::zero(),
            _ => {
                let torque = self.motor_torque_nm
                    - self.trail_m * front
                    - self.damping_nm_s_per_rad * rate
                    - self.friction_torque_nm(x, injection, mode);
                torque * self.inverse_steering_inertia
            }
        };
        Vector4::new(
            (front + rear) * self.lateral_gain - gamma,
            match self.slip_form {
                SlipForm::SmallAngle => yaw,
                SlipForm::Exact => yaw * x[SIDESLIP].cos(),
            },
            rate,
            acceleration,
        )
    }

    /// Index in the state vector of the friction law's argument: steering rate, or steering angle
    /// in the printed law.
    pub fn friction_argument(&self) -> usize {
        match self.friction.law {
            FrictionLaw::PrintedAngle => STEERING_ANGLE,
            FrictionLaw::None | FrictionLaw::CoulombRate => STEERING_RATE,
        }
    }

    /// The friction law's sign function under the dither.
    pub fn friction_sign(&self, injection: Injection<T>) -> Sign<T> {
        if self.friction.law == FrictionLaw::None {
            return Sign::Zero;
        }
        Sign::new(
            self.friction
                .injection(injection, self.dither_frequency_rad_per_s),
        )
    }

    /// The friction mode in which a step begins: at rest decided by the torques, else by the sign's
    /// argument.
    pub fn mode_at(&self, x: &Vector4<T>, injection: Injection<T>) -> FrictionMode {
        let argument = x[self.friction_argument()];
        if argument == T::zero() && self.can_stick(injection) {
            self.mode_at_rest(x, injection)
        } else {
            self.friction_sign(injection).mode(argument)
        }
    }

    /// Greatest friction torque, N m.
    pub fn friction_limit_nm(&self) -> T {
        self.friction_limit_nm
    }

    /// The steering comes to rest and may stick: Coulomb friction whose sign function is not
    /// dithered, or not yet.
    pub fn can_stick(&self, injection: Injection<T>) -> bool {
        let (lower, upper) = (T::zero(), T::zero());
        self.friction.law == FrictionLaw::CoulombRate
            && self.friction_sign(injection) == Sign::Stepped { lower, upper }
    }

    /// The mode in which the steering leaves rest, or stays.
    pub fn mode_at_rest(&self, x: &Vector4<T>, injection: Injection<T>) -> FrictionMode {
        let torque = self.driving_torque_nm(x, injection);
        if torque > self.friction_limit_nm {
            FrictionMode::Positive
        } else if torque < -self.friction_limit_nm {
            FrictionMode::Negative
        } else {
            FrictionMode::Sticking
        }
    }

    fn friction_torque_nm(&self, x: &Vector4<T>, injection: Injection<T>, mode: FrictionMode) -> T {
        match mode {
            FrictionMode::Positive => self.friction_limit_nm,
            FrictionMode::Negative => -self.friction_limit_nm,
            FrictionMode::Sticking => T::zero(),
            FrictionMode::Neutral => match self.friction_sign(injection) {
                sign @ Sign::Smooth { .. } => {
                    self.friction_limit_nm * sign.at(x[self.friction_argument()])
                }
                Sign::Stepped { .. } | Sign::Zero => T::zero(),
            },
        }
    }
}
