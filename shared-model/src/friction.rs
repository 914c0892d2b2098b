//! Dry friction of the steering: Coulomb friction on the steering rate with true stick, and the law
//! as printed in the paper.

use crate::Real;
use crate::dither::Injection;
use crate::listed;
use crate::parameter::parameters;

/// Standard gravity as equation (13) prints it, m/s^2.
const GRAVITY_M_PER_S2: f64 = 9.8;

listed! {
    /// The quantity that the friction torque depends on.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum FrictionLaw {
        /// No friction.
        None => "none",
        /// Opposes the steering rate. At rest the torque takes any value up to its limit: the steering sticks as long as
        /// that balances the other torques.
        CoulombRate => "coulomb_rate",
        /// Sign of the steering angle, as equation (13) prints it.
        PrintedAngle => "printed_angle",
    }
}

parameters! {
    section "friction";
    /// Parameters of the steering's dry friction.
    pub struct Friction {
        choices {
            /// The quantity that the torque depends on.
            law: FrictionLaw,
            /// Whether the dither also acts ahead of the friction's sign function. On the steering angle it adds W; on the
            /// steering rate it adds W times the dither's angular frequency, which all but removes the friction.
            dithered: bool,
        }
        /// Coefficient of friction mu.
        coefficient: 0.0..=10.0,
        /// Load F_w on the front wheels, kg.
        front_wheel_load_kg: 0.0..=1e5,
    }
}

impl<T: Real> Friction<T> {
    /// Greatest friction torque tau_c = 9.8 t_p mu F_w, N m, equation (13).
    ///
    /// ```
    /// let friction = shared_model::Scenario::reconstruction().friction;
    /// assert!((friction.limit_nm(0.012) - 6.5856_f64).abs() < 1e-9);
    /// ```
    pub fn limit_nm(&self, pneumatic_trail_m: T) -> T {
        match self.law {
            FrictionLaw::None => T::zero(),
            FrictionLaw::CoulombRate | FrictionLaw::PrintedAngle => {
                T::from_f64(GRAVITY_M_PER_S2)
                    * pneumatic_trail_m
                    * self.coefficient
                    * self.front_wheel_load_kg
            }
        }
    }

    /// The dither as the sign function's argument meets it: in rad for the printed law, in rad/s
    /// for Coulomb's.
    pub fn injection(&self, injection: Injection<T>, frequency_rad_per_s: T) -> Injection<T> {
        match (self.dithered, self.law) {
            (false, _) | (_, FrictionLaw::None) => Injection::Off,
            (true, FrictionLaw::PrintedAngle) => injection,
            (true, FrictionLaw::CoulombRate) => injection.scaled(frequency_rad_per_s),
        }
    }
}

listed! {
    /// State of the friction element, held over a step. The sign is that of the friction law's argument; the torque opposes
    /// it.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum FrictionMode {
        /// At rest, held by friction.
        Sticking = 0,
        /// Argument negative.
        Negative = 1,
        /// Argument between the two steps of a square wave's mean: no torque.
        Neutral = 2,
        /// Argument positive.
        Positive = 3,
    }
}

impl FrictionMode {
    /// The mode with the given code, if there is one.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|&mode| mode as u8 == code)
    }
}

/// The sign function under dither: either piecewise constant with steps at `lower` and `upper`, or
/// smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sign<T> {
    /// No friction: zero everywhere.
    Zero,
    /// -1 below `lower`, 0 between, 1 above `upper`. Without dither both are 0; a held sample of
    /// the signal moves both by its negative; the mean over a square wave of amplitude A has
    /// them at -A and A, equation (21).
    Stepped {
        /// Upper end of -1.
        lower: T,
        /// Lower end of 1.
        upper: T,
    },
    /// Mean over a sine of amplitude A, equation (27): (2/pi) asin(u/A) within A, the sign outside.
    Smooth {
        /// Amplitude A, in the argument's unit; positive.
        amplitude: T,
    },
}

impl<T: Real> Sign<T> {
    /// The sign function under the given dither.
    pub fn new(injection: Injection<T>) -> Self {
        let zero = T::zero();
        match injection {
            Injection::SineMean { amplitude } if amplitude > zero => Self::Smooth { amplitude },
            Injection::Off | Injection::SineMean { .. } => Self::Stepped {
                lower: zero,
                upper: zero,
            },
            Injection::SquareMean { amplitude } => Self::Stepped {
                lower: -amplitude,
                upper: amplitude,
            },
            Injection::Shift { offset } => Self::Stepped {
                lower: -offset,
                upper: -offset,
            },
        }
    }

    /// The value at `argument`, from -1 to 1.
    ///
    /// ```
    /// use shared_model::{dither::Injection, friction::Sign};
    /// let square = Sign::new(Injection::SquareMean { amplitude: 0.5 });
    /// assert_eq!([-1.0, 0.2, 1.0].map(|u| square.at(u)), [-1.0, 0.0, 1.0]);
    /// let sine = Sign::new(Injection::SineMean { amplitude: 1.0 });
    /// assert!((sine.at(0.5) - 1.0 / 3.0_f64).abs() < 1e-15);
    /// ```
    pub fn at(&self, argument: T) -> T {
        match self {
            Self::Zero => T::zero(),
            Self::Stepped { .. } => match self.mode(argument) {
                FrictionMode::Positive => T::one(),
                FrictionMode::Negative => -T::one(),
                FrictionMode::Neutral | FrictionMode::Sticking => T::zero(),
            },
            Self::Smooth { amplitude } => {
                let ratio = argument / *amplitude;
                if ratio >= T::one() {
                    T::one()
                } else if ratio <= -T::one() {
                    -T::one()
                } else {
                    ratio.asin() * T::from_f64(core::f64::consts::FRAC_2_PI)
                }
            }
        }
    }

    /// The mode at `argument`; only a stepped sign has any but neutral.
    pub fn mode(&self, argument: T) -> FrictionMode {
        match self {
            Self::Stepped { upper, .. } if argument > *upper => FrictionMode::Positive,
            Self::Stepped { lower, .. } if argument < *lower => FrictionMode::Negative,
            _ => FrictionMode::Neutral,
        }
    }

    /// The first step that the argument passes on its way to `argument` when it comes from `mode`,
    /// and the mode after it.
    pub fn crossing(&self, mode: FrictionMode, argument: T) -> Option<(T, FrictionMode)> {
        use FrictionMode::{Negative, Neutral, Positive};
        let Self::Stepped { lower, upper } = *self else {
            return None;
        };
        let apart = lower < upper;
        match mode {
            Positive if argument < upper => Some((upper, if apart { Neutral } else { Negative })),
            Negative if argument > lower => Some((lower, if apart { Neutral } else { Positive })),
            Neutral if apart && argument > upper => Some((upper, Positive)),
            Neutral if apart && argument < lower => Some((lower, Negative)),
            _ => None,
        }
    }
}
