//! Series of one axle's cornering force and of its rate of change with the slip angle.

use super::lanes::Lanes;
use super::series::{Atan, ORDER, Series, SinCos, inner_product, inner_square, product};
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::tire::{MagicFormula, Tire};

/// Series of one axle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axle<S: Simd, const V: usize> {
    pub slip_angle: Series<S, V>,
    pub force: Series<S, V>,
    /// Its rate of change with the slip angle.
    pub slope: Series<S, V>,
}

impl<S: Simd, const V: usize> Axle<S, V> {
    /// Room for them.
    pub fn new(simd: S) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        Self {
            slip_angle: zero,
            force: zero,
            slope: zero,
        }
    }
}

/// The tyres of one axle.
pub(super) trait Tires<S: Simd, const V: usize> {
    /// No tyre in any lane, with room for tyres like this one under a dither.
    fn new(simd: S, like: &Tire<f64>, injection: Injection<f64>) -> Self;

    /// Puts a tyre into a lane, of the kind that there is room for.
    fn set_lane(&mut self, lane: usize, tire: &Tire<f64>, injection: Injection<f64>);

    /// Takes a lane's tyre off.
    fn free_lane(&mut self, lane: usize);

    /// Coefficient `n` of the force, and of its slope if that is asked for, given the slip angle's
    /// up to `n`.
    fn load(&mut self, n: usize, axle: &mut Axle<S, V>, with_slope: bool);
}

/// Cubic tyres, softened by the mean of a dither: F = alpha (k1 - k2 alpha^2), dF/dalpha = k1 - 3
/// k2 alpha^2.
#[derive(Debug, Clone, Copy)]
pub(super) struct CubicTires<S: Simd, const V: usize> {
    linear: Lanes<S, V>,
    /// -k2.
    cubic: Lanes<S, V>,
    /// Force over slip angle.
    secant: Series<S, V>,
}

impl<S: Simd, const V: usize> Tires<S, V> for CubicTires<S, V> {
    fn new(simd: S, _: &Tire<f64>, _: Injection<f64>) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self {
            linear: zero,
            cubic: zero,
            secant: [zero; ORDER + 1],
        }
    }

    fn set_lane(&mut self, lane: usize, tire: &Tire<f64>, injection: Injection<f64>) {
        if let Tire::Cubic(tire) = tire {
            let tire = tire.averaged(injection);
            self.linear.as_mut_slice()[lane] = tire.linear_n_per_rad;
            self.cubic.as_mut_slice()[lane] = -tire.cubic_n_per_rad3;
        }
    }

    fn free_lane(&mut self, lane: usize) {
        self.linear.as_mut_slice()[lane] = 0.0;
        self.cubic.as_mut_slice()[lane] = 0.0;
    }

    // What the slip angle's newest coefficient adds to the force is one product with the slope: the
    // next order waits for no more.
    #[inline(always)]
    fn load(&mut self, n: usize, axle: &mut Axle<S, V>, with_slope: bool) {
        let angle = &axle.slip_angle;
        if n == 0 {
            let softening = self.cubic * (angle[0] * angle[0]);
            self.secant[0] = self.linear + softening;
            axle.slope[0] = self.linear + softening.scale(3.0);
            axle.force[0] = self.secant[0] * angle[0];
            return;
        }
        let inner = inner_square(angle, n);
        let known = inner.mul_add(self.cubic * angle[0], inner_product(&self.secant, angle, n));
        axle.force[n] = axle.slope[0].mul_add(angle[n], known);
        let softening = self.cubic * (angle[0] + angle[0]).mul_add(angle[n], inner);
        self.secant[n] = softening;
        if with_slope {
            axle.slope[n] = softening.scale(3.0);
        }
    }
}

/// Tyres after the Magic Formula (6) and (7), under the mean of a dither: F = D sin(C atan(B (1 -
/// E) alpha + E atan(B alpha))) at several slip angles about the mean one, all with the same
/// weight.
#[derive(Debug, Clone)]
pub(super) struct MagicTires<S: Simd, const V: usize> {
    /// B.
    stiffness: Lanes<S, V>,
    /// B (1 - E).
    linear: Lanes<S, V>,
    curvature: Lanes<S, V>,
    shape: Lanes<S, V>,
    /// D over the number of slip angles.
    peak: Lanes<S, V>,
    probes: Vec<Probe<S, V>>,
}

/// The formula at one distance from the mean slip angle.
#[derive(Debug, Clone, Copy)]
struct Probe<S: Simd, const V: usize> {
    /// The distance, rad.
    offset: Lanes<S, V>,
    /// atan(B alpha).
    inner: Atan<S, V>,
    /// Arctangent of B (1 - E) alpha + E atan(B alpha).
    outer: Atan<S, V>,
    /// Of C times that.
    sine: SinCos<S, V>,
    /// Derivative of the sine with respect to the outer argument, over C; and of that argument
    /// with respect to the angle.
    of_sine: Series<S, V>,
    of_argument: Series<S, V>,
}

/// The slip angles about the mean one at which the formula gives its mean under a dither, rad.
pub(super) fn offsets(tire: &Tire<f64>, injection: Injection<f64>) -> Vec<f64> {
    match (tire, injection) {
        (Tire::Cubic(_), _) => Vec::new(),
        (_, Injection::Off) => vec![0.0],
        (_, Injection::Shift { offset }) => vec![offset],
        (_, Injection::SquareMean { amplitude }) => vec![amplitude, -amplitude],
        (Tire::MagicFormula(_, mean), Injection::SineMean { amplitude }) => {
            mean.offsets(amplitude).collect()
        }
    }
}

impl<S: Simd, const V: usize> MagicTires<S, V> {
    fn set_formula(&mut self, lane: usize, tire: &MagicFormula<f64>) {
        self.stiffness.as_mut_slice()[lane] = tire.stiffness_per_rad;
        self.linear.as_mut_slice()[lane] = tire.stiffness_per_rad * (1.0 - tire.curvature);
        self.curvature.as_mut_slice()[lane] = tire.curvature;
        self.shape.as_mut_slice()[lane] = tire.shape;
        self.peak.as_mut_slice()[lane] = tire.peak_n / self.probes.len() as f64;
    }
}

impl<S: Simd, const V: usize> Tires<S, V> for MagicTires<S, V> {
    fn new(simd: S, like: &Tire<f64>, injection: Injection<f64>) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        let probe = Probe {
            offset: zero,
            inner: Atan::new(simd),
            outer: Atan::new(simd),
            sine: SinCos::new(simd),
            of_sine: [zero; ORDER + 1],
            of_argument: [zero; ORDER + 1],
        };
        Self {
            stiffness: zero,
            linear: zero,
            curvature: zero,
            shape: zero,
            peak: zero,
            probes: vec![probe; offsets(like, injection).len()],
        }
    }

    fn set_lane(&mut self, lane: usize, tire: &Tire<f64>, injection: Injection<f64>) {
        if let Tire::MagicFormula(formula, _) = tire {
            self.set_formula(lane, formula);
            for (probe, offset) in self.probes.iter_mut().zip(offsets(tire, injection)) {
                probe.offset.as_mut_slice()[lane] = offset;
            }
        }
    }

    fn free_lane(&mut self, lane: usize) {
        let none = MagicFormula {
            stiffness_per_rad: 0.0,
            shape: 0.0,
            peak_n: 0.0,
            curvature: 0.0,
        };
        self.set_formula(lane, &none);
    }

    #[inline(always)]
    fn load(&mut self, n: usize, axle: &mut Axle<S, V>, with_slope: bool) {
        let zero = self.peak.zero();
        let (mut sines, mut slopes) = (zero, zero);
        for probe in &mut self.probes {
            let mut angle = axle.slip_angle[n];
            if n == 0 {
                angle = angle + probe.offset;
            }
            probe.inner.push(n, self.stiffness * angle);
            let bent = self.curvature * probe.inner.value[n];
            probe.outer.push(n, self.linear.mul_add(angle, bent));
            probe.sine.push(n, self.shape * probe.outer.value[n]);
            sines = sines + probe.sine.sin[n];
            if !with_slope {
                continue;
            }
            let of_bent = self.curvature * self.stiffness * probe.inner.slope[n];
            probe.of_argument[n] = if n == 0 {
                self.linear + of_bent
            } else {
                of_bent
            };
            probe.of_sine[n] = product(&probe.sine.cos, &probe.outer.slope, n);
            slopes = slopes + product(&probe.of_sine, &probe.of_argument, n);
        }
        axle.force[n] = self.peak * sines;
        if with_slope {
            axle.slope[n] = self.peak * self.shape * slopes;
        }
    }
}

/// Tyres of the kind that the motions have.
pub(super) enum EitherTires<S: Simd, const V: usize> {
    Cubic(CubicTires<S, V>),
    Magic(MagicTires<S, V>),
}

impl<S: Simd, const V: usize> Tires<S, V> for EitherTires<S, V> {
    fn new(simd: S, like: &Tire<f64>, injection: Injection<f64>) -> Self {
        match like {
            Tire::Cubic(_) => Self::Cubic(Tires::new(simd, like, injection)),
            Tire::MagicFormula(..) => Self::Magic(Tires::new(simd, like, injection)),
        }
    }

    fn set_lane(&mut self, lane: usize, tire: &Tire<f64>, injection: Injection<f64>) {
        match self {
            Self::Cubic(tires) => tires.set_lane(lane, tire, injection),
            Self::Magic(tires) => tires.set_lane(lane, tire, injection),
        }
    }

    fn free_lane(&mut self, lane: usize) {
        match self {
            Self::Cubic(tires) => tires.free_lane(lane),
            Self::Magic(tires) => tires.free_lane(lane),
        }
    }

    #[inline(always)]
    fn load(&mut self, n: usize, axle: &mut Axle<S, V>, with_slope: bool) {
        match self {
            Self::Cubic(tires) => tires.load(n, axle, with_slope),
            Self::Magic(tires) => tires.load(n, axle, with_slope),
        }
    }
}
