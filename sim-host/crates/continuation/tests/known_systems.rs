//! Orbits and bifurcations that are known: by a closed form, from the literature, or by another program.

use continuation::arclength::{End, Settings};
use continuation::branch::{Branch, follow, orbit_at};
use continuation::curve;
use continuation::equilibrium::{self, Equilibria};
use continuation::orbit::{Guess, Orbit, Shooting};
use continuation::start::{Search, near_returns};
use continuation::system::{Equations, Parameters, System};
use continuation::{Bifurcation, Condition};
use nalgebra::{SVector, Vector2, Vector3, Vector4};
use shared_model::Real;
use std::f64::consts::TAU;

const TOLERANCE: f64 = 1e-12;
/// By `doublings.py` beside this file.
const ROESSLER_DOUBLING: f64 = 2.832_445_027_859;
const ROESSLER_SECOND_DOUBLING: f64 = 3.837_358_168_409;
const DUFFING_DOUBLING: f64 = 0.150_995_320_667;

/// A smooth system with its right-hand side, of which time may run backwards and states be in another
/// unit.
macro_rules! smooth {
    ($Name:ident, $At:ident, $n:literal, |$x:ident, $p:ident| $rates:expr) => {
        #[derive(Debug, Clone, Copy)]
        struct $Name {
            time: f64,
            unit: f64,
        }

        impl $Name {
            const PLAIN: Self = Self {
                time: 1.0,
                unit: 1.0,
            };
        }

        struct $At<T> {
            parameters: Parameters<T>,
            like: $Name,
        }

        impl System<$n> for $Name {
            type Mode = ();
            type Equations<T: Real> = $At<T>;

            fn equations<T: Real>(&self, parameters: Parameters<T>) -> $At<T> {
                $At {
                    parameters,
                    like: *self,
                }
            }
        }

        impl<T: Real> Equations<T, $n> for $At<T> {
            type Mode = ();

            fn mode_at(&self, _x: &SVector<T, $n>) {}

            fn derivative(&self, x: &SVector<T, $n>, (): ()) -> SVector<T, $n> {
                let unit = T::from_f64(self.like.unit);
                let $x = x.map(|value| value / unit);
                let $p = self.parameters;
                let rates: [T; $n] = $rates;
                let factor = unit * T::from_f64(self.like.time);
                SVector::from(rates).map(|rate| rate * factor)
            }
        }
    };
}

fn number<T: Real>(value: f64) -> T {
    T::from_f64(value)
}

// Parameters: c; a = b = 0.2.
smooth!(Roessler, RoesslerAt, 3, |x, p| [
    -x[1] - x[2],
    x[0] + number::<T>(0.2) * x[1],
    number::<T>(0.2) + x[2] * (x[0] - p[0]),
]);
// Parameters: rho, sigma; beta = 8/3.
smooth!(Lorenz, LorenzAt, 3, |x, p| [
    p[1] * (x[1] - x[0]),
    x[0] * (p[0] - x[2]) - x[1],
    x[0] * x[1] - number::<T>(8.0 / 3.0) * x[2],
]);
// r' = mu r + nu r^3 - r^5 and an angle of 1 rad/s.
smooth!(Radial, RadialAt, 2, |x, p| {
    let square = x[0] * x[0] + x[1] * x[1];
    let growth = p[0] + p[1] * square - square * square;
    [x[0] * growth - x[1], x[1] * growth + x[0]]
});
// An oscillation of radius 1 and 1 rad/s beside one that grows with mu at sqrt(2) rad/s.
smooth!(Torus, TorusAt, 4, |x, p| {
    let one = T::one();
    let growth = one - (x[0] * x[0] + x[1] * x[1]);
    let other = p[0] - (x[2] * x[2] + x[3] * x[3]);
    let rate = number::<T>(std::f64::consts::SQRT_2);
    [
        x[0] * growth - x[1],
        x[1] * growth + x[0],
        x[2] * other - rate * x[3],
        x[3] * other + rate * x[2],
    ]
});
// x'' + 0.2 x' - x + x^3 = gamma cos(t), the force from an oscillator; its multipliers are exp(-4 pi)
// and 1.
smooth!(Duffing, DuffingAt, 4, |x, p| {
    let growth = T::one() - (x[2] * x[2] + x[3] * x[3]);
    [
        x[1],
        x[0] - x[0] * x[0] * x[0] - number::<T>(0.2) * x[1] + p[0] * x[2],
        x[2] * growth - x[3],
        x[3] * growth + x[2],
    ]
});

fn started<S: System<N>, const N: usize>(
    system: &S,
    parameters: Parameters<f64>,
    start: SVector<f64, N>,
    component: usize,
    cycles: usize,
) -> Guess<N> {
    let search = Search {
        start,
        transient_s: 300.0,
        observed_s: 300.0,
        component,
        most_cycles: cycles,
        tolerance: 1e-9,
    };
    near_returns(system, parameters, &search).unwrap()[cycles - 1].guess
}

fn branch<S: System<N>, const N: usize, const K: usize>(
    system: &S,
    guess: &Guess<N>,
    sign: f64,
    range: (f64, f64),
) -> Branch<S::Mode, N> {
    branch_in::<S, N, K>(1, system, guess, sign, range)
}

/// By that number of shots per period.
fn branch_in<S: System<N>, const N: usize, const K: usize>(
    segments: usize,
    system: &S,
    guess: &Guess<N>,
    sign: f64,
    range: (f64, f64),
) -> Branch<S::Mode, N> {
    let mut settings = Settings::over(&[range]);
    settings.greatest_multiplier = 1e9;
    let spans = settings.spans();
    let problem = Shooting::<S, N, K>::new(system, guess, &spans, segments, TOLERANCE).unwrap();
    let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters);
    let axis = problem.parameter_axis(sign);
    follow(&problem, unknowns.unwrap(), &axis, &settings, |_| true).unwrap()
}

fn only<M, const N: usize>(branch: &Branch<M, N>, kind: Bifurcation) -> (f64, f64) {
    let mut of_kind = branch
        .specials
        .iter()
        .filter(|special| special.kind == kind);
    let special = of_kind
        .next()
        .unwrap_or_else(|| panic!("no {}: {}", kind.name(), branch.end));
    assert!(of_kind.next().is_none(), "more than one {}", kind.name());
    (special.orbit.parameters[0], special.parameter_error)
}

fn roessler_orbit(system: &Roessler, c: f64, guess: &Guess<3>) -> Orbit<(), 3> {
    let guess = Guess {
        parameters: [c, 0.0],
        ..*guess
    };
    let problem = Shooting::<_, 3, 5>::new(system, &guess, &[1.0], 1, TOLERANCE).unwrap();
    let unknowns = problem
        .guess(&guess.start, guess.period_s, guess.parameters)
        .unwrap();
    orbit_at(&problem, unknowns).unwrap()
}

/// The orbit of one cycle in the chaotic attractor: its period is in the literature, and the product of
/// its multipliers is by Liouville's formula.
#[test]
fn the_unstable_orbit_of_roessler() {
    let system = Roessler::PLAIN;
    let guess = started(&system, [5.7, 0.0], Vector3::new(1.0, 1.0, 0.0), 0, 1);
    let orbit = roessler_orbit(&system, 5.7, &guess);
    assert!(
        (orbit.period_s - 5.881_088_455_554_8).abs() < 1e-9,
        "{}",
        orbit.period_s
    );
    assert!(!orbit.is_stable());
    assert!(orbit.trivial_error < 1e-8, "{:e}", orbit.trivial_error);
    let mean = mean_over(&orbit, |x| 0.2 + x[0] - 5.7);
    let product: f64 = orbit.multipliers.iter().map(|m| m.re).product();
    // The smaller one is 1e-14 of the larger: below rounding of the product.
    assert!(
        product.abs() < 1e-9 && mean * orbit.period_s < -20.0,
        "{product:e} {mean}"
    );
}

/// Mean over an orbit by the trapezoidal rule on its steps.
fn mean_over<const N: usize>(orbit: &Orbit<(), N>, f: impl Fn(&SVector<f64, N>) -> f64) -> f64 {
    let trajectory = &orbit.segments[0];
    let sum: f64 = trajectory
        .legs
        .iter()
        .zip(trajectory.states.windows(2))
        .map(|(leg, pair)| 0.5 * leg.step_s * (f(&pair[0]) + f(&pair[1])))
        .sum();
    sum / orbit.period_s
}

#[test]
fn lorenz_by_literature_and_liouville() {
    let system = Lorenz::PLAIN;
    let parameters = [28.0, 10.0];
    let guess = Guess {
        start: Vector3::new(-13.763_610_682_134, -19.578_751_942_452, 27.0),
        period_s: 1.558_652,
        parameters,
    };
    let problem = Shooting::<_, 3, 5>::new(&system, &guess, &[10.0], 1, TOLERANCE).unwrap();
    let unknowns = problem
        .guess(&guess.start, guess.period_s, parameters)
        .unwrap();
    let orbit = orbit_at(&problem, unknowns).unwrap();
    assert!(
        (orbit.period_s - 1.558_652_210_716_174).abs() < 1e-10,
        "{}",
        orbit.period_s
    );
    // The smaller multiplier is 1e-10, which the matrix has to 1e-12.
    let product = orbit.across.determinant();
    let wanted = (-(10.0 + 1.0 + 8.0 / 3.0) * orbit.period_s).exp();
    assert!(
        (product / wanted - 1.0).abs() < 5e-3,
        "{product:e} {wanted:e}"
    );
}

/// Backwards in time its multiplier is 1e9: one shot does not carry that, several do.
#[test]
fn lorenz_backwards_by_multiple_shooting() {
    let system = Lorenz {
        time: -1.0,
        unit: 1.0,
    };
    let parameters = [28.0, 10.0];
    let guess = Guess {
        start: Vector3::new(-13.763_610_682_134, -19.578_751_942_452, 27.0),
        period_s: 1.558_652_210_7,
        parameters,
    };
    let forward = Shooting::<_, 3, 5>::new(&Lorenz::PLAIN, &guess, &[10.0], 1, TOLERANCE).unwrap();
    let unknowns = forward
        .guess(&guess.start, guess.period_s, parameters)
        .unwrap();
    let exact = orbit_at(&forward, unknowns).unwrap();
    let guess = Guess {
        start: *exact.start(),
        ..guess
    };
    let problem = Shooting::<_, 3, 5>::new(&system, &guess, &[10.0], 12, TOLERANCE).unwrap();
    // The states of the segments from the orbit forwards.
    let mut states = vec![];
    for k in 0..12 {
        let time_s = exact.period_s * f64::from(12 - k) / 12.0;
        let at = continuation::trajectory::integrate(
            &Lorenz::PLAIN,
            parameters,
            exact.start(),
            time_s,
            TOLERANCE,
        );
        states.push(if k == 0 {
            *exact.start()
        } else {
            *at.unwrap().end()
        });
    }
    let orbit = orbit_at(
        &problem,
        problem.unknowns(&states, exact.period_s * (1.0 + 1e-6), parameters),
    )
    .unwrap();
    assert!(
        (orbit.period_s - exact.period_s).abs() < 1e-9,
        "{}",
        orbit.period_s
    );
    let greatest = orbit.multipliers[0].re;
    let wanted = (13.0 + 2.0 / 3.0) * orbit.period_s;
    let other = exact.multipliers[0].re;
    assert!(
        (greatest.abs().ln() - (wanted + other.abs().ln())).abs() < 1e-5,
        "{greatest:e}"
    );
}

#[test]
fn hopf_of_lorenz_is_subcritical_where_its_closed_form_is() {
    let system = Lorenz::PLAIN;
    let at = |rho: f64| {
        let x = (8.0 / 3.0 * (rho - 1.0)).sqrt();
        Vector3::new(x, x, rho - 1.0)
    };
    let settings = Settings::over(&[(15.0, 30.0)]);
    let problem =
        Equilibria::<_, 3, 5>::new(&system, (), &at(20.0), [20.0, 10.0], &settings.spans());
    let branch = equilibrium::follow(
        &problem,
        problem.unknowns(&at(20.0), [20.0, 10.0]),
        1.0,
        &settings,
    )
    .unwrap();
    assert_eq!(branch.end, End::Range);
    let [hopf] = &branch.hopf[..] else {
        panic!("{:?}", branch.hopf)
    };
    let beta = 8.0 / 3.0;
    let critical = |sigma: f64| sigma * (sigma + beta + 3.0) / (sigma - beta - 1.0);
    assert!(
        (hopf.at.parameters[0] - critical(10.0)).abs() < 1e-9,
        "{:?}",
        hopf.at
    );
    assert!(hopf.first_lyapunov_coefficient > 0.0);
    // Over both parameters it is the closed form too.
    let settings = Settings::over(&[(10.0, 60.0), (5.0, 20.0)]);
    let curve =
        curve::of_hopf::<_, 3, 5>(&system, (), &at(24.0), &hopf.at, 1.0, &settings).unwrap();
    assert!(
        curve.points.len() > 10 && curve.end == End::Range,
        "{}",
        curve.points.len()
    );
    for point in &curve.points {
        let [rho, sigma] = point.parameters;
        assert!(
            (rho - critical(sigma)).abs() < 1e-7,
            "{rho} {sigma} {}",
            critical(sigma)
        );
    }
    // The orbit that is born exists below, and ends where its period has no bound.
    let (displacement, period_s) = problem.orbit_guess(&hopf.at, 0.05).unwrap();
    let guess = Guess {
        start: hopf.at.x + displacement,
        period_s,
        parameters: [hopf.at.parameters[0], 10.0],
    };
    let mut settings = Settings::over(&[(10.0, 30.0)]);
    settings.greatest_multiplier = 1e6;
    let shooting =
        Shooting::<_, 3, 5>::new(&system, &guess, &settings.spans(), 1, TOLERANCE).unwrap();
    let unknowns = shooting
        .guess(&guess.start, period_s, guess.parameters)
        .unwrap();
    let tangent = shooting.state_axis(&displacement);
    let orbits = follow(&shooting, unknowns, &tangent, &settings, |_| true).unwrap();
    let last = &orbits.orbits[orbits.orbits.len() - 1];
    // The homoclinic orbit is at 13.926.
    assert!(
        (last.parameters[0] - 13.926).abs() < 0.01,
        "{} {}: {}",
        last.parameters[0],
        last.period_s,
        orbits.end
    );
}

/// mu = r^4 - nu r^2; the fold is at r^2 = nu/2, mu = -nu^2/4.
#[test]
fn the_fold_of_a_radial_orbit_and_its_curve() {
    let system = Radial::PLAIN;
    let guess = Guess {
        start: Vector2::new(1.0, 0.0),
        period_s: TAU,
        parameters: [0.0, 1.0],
    };
    let branch = branch::<_, 2, 4>(&system, &guess, -1.0, (-0.4, 0.5));
    let (mu, error) = only(&branch, Bifurcation::Fold);
    assert!((mu + 0.25).abs() < 1e-10 && error < 1e-9, "{mu} {error:e}");
    for orbit in &branch.orbits {
        let square = orbit.start().norm_squared();
        let [mu, _] = orbit.parameters;
        let wanted = (TAU * (mu + 3.0 * square - 5.0 * square * square)).exp();
        assert!((mu + square - square * square).abs() < 1e-9);
        assert!(
            (orbit.multipliers[0].re - wanted).abs() < 1e-8 * wanted,
            "{wanted}"
        );
    }
    let fold = branch
        .specials
        .iter()
        .find(|special| special.kind == Bifurcation::Fold)
        .unwrap();
    let settings = Settings::over(&[(-2.0, 0.5), (0.3, 2.0)]);
    let problem = Shooting::<_, 2, 4>::new(&system, &guess, &[1.0], 1, TOLERANCE).unwrap();
    let curve = curve::of_orbits(&problem, Bifurcation::Fold, &fold.orbit, 1.0, &settings).unwrap();
    assert!(
        curve.points.len() > 10,
        "{} {}",
        curve.points.len(),
        curve.end
    );
    for orbit in &curve.points {
        let [mu, nu] = orbit.parameters;
        assert!((mu + nu * nu / 4.0).abs() < 1e-8, "{mu} {nu}");
    }
}

/// Its Hopf bifurcation is at mu = 0, and subcritical where nu > 0: at nu = 0 the first Lyapunov coefficient is
/// zero, where the curve of the fold ends (N. N. Bautin).
#[test]
fn the_hopf_curve_of_a_radial_orbit_changes_its_criticality_where_the_fold_ends() {
    let system = Radial::PLAIN;
    let sizes = Vector2::new(1.0, 1.0);
    let settings = Settings::over(&[(-0.5, 0.5)]);
    let start = [-0.3, 1.0];
    let problem = Equilibria::<_, 2, 4>::new(&system, (), &sizes, start, &settings.spans());
    let guess = problem.unknowns(&Vector2::zeros(), start);
    let branch = equilibrium::follow(&problem, guess, 1.0, &settings).unwrap();
    let hopf = &branch.hopf[0];
    let settings = Settings::over(&[(-0.5, 0.5), (-1.0, 2.0)]);
    let curve = curve::of_hopf::<_, 2, 4>(&system, (), &sizes, &hopf.at, -1.0, &settings).unwrap();
    let [point] = &curve.codimension_two[..] else {
        panic!("{:?}", curve.codimension_two)
    };
    assert_eq!(point.condition, Condition::GeneralisedHopf);
    // Differences of the Jacobian, 1e-3 apart, take the term of fifth degree for one of third.
    let [mu, nu] = point.parameters;
    assert!(mu.abs() < 1e-9 && nu.abs() < 5e-6, "{mu} {nu}");
}

#[test]
fn a_torus_is_born_where_the_second_oscillation_grows() {
    let guess = Guess {
        start: Vector4::new(1.0, 0.0, 0.0, 0.0),
        period_s: TAU,
        parameters: [-0.3, 0.0],
    };
    let branch = branch::<_, 4, 6>(&Torus::PLAIN, &guess, 1.0, (-0.3, 0.3));
    let (mu, error) = only(&branch, Bifurcation::NeimarkSacker);
    assert!(mu.abs() < 1e-9 && error < 1e-8, "{mu:e} {error:e}");
}

/// By an independent program: shooting in Python with DOP853 of SciPy.
#[test]
fn doublings_of_roessler_and_duffing_are_those_of_another_program() {
    let plain = started(
        &Roessler::PLAIN,
        [2.5, 0.0],
        Vector3::new(1.0, 1.0, 0.0),
        0,
        1,
    );
    let first = branch::<_, 3, 5>(&Roessler::PLAIN, &plain, 1.0, (2.0, 5.0));
    let (c, error) = only(&first, Bifurcation::PeriodDoubling);
    assert!(
        (c - ROESSLER_DOUBLING).abs() < 1e-7 && error < 1e-8,
        "{c:.12} {error:e}"
    );
    // The same in a unit a thousand times smaller.
    let scaled = Roessler {
        time: 1.0,
        unit: 1e3,
    };
    let guess = Guess {
        start: plain.start * 1e3,
        ..plain
    };
    let again = branch::<_, 3, 5>(&scaled, &guess, 1.0, (2.0, 5.0));
    assert!((only(&again, Bifurcation::PeriodDoubling).0 - c).abs() < 1e-9);
    // And backwards, where the stable orbit is unstable.
    let backwards = Roessler {
        time: -1.0,
        unit: 1.0,
    };
    let again = branch_in::<_, 3, 5>(8, &backwards, &plain, 1.0, (2.0, 3.0));
    assert!((only(&again, Bifurcation::PeriodDoubling).0 - c).abs() < 1e-7);
    // On the branch of twice the period the next one.
    let special = first
        .specials
        .iter()
        .find(|s| s.kind == Bifurcation::PeriodDoubling)
        .unwrap();
    let settings = Settings::over(&[(2.0, 5.0)]);
    let problem =
        Shooting::<_, 3, 5>::new(&Roessler::PLAIN, &plain, &settings.spans(), 1, TOLERANCE)
            .unwrap();
    let problem = problem.at_orbit(&special.orbit, &settings.spans()).unwrap();
    let (problem, unknowns, tangent) = problem.doubled(&special.orbit, 0.02).unwrap();
    let second = follow(&problem, unknowns, &tangent, &settings, |_| true).unwrap();
    let doublings = second
        .specials
        .iter()
        .filter(|s| s.kind == Bifurcation::PeriodDoubling);
    let next = doublings.map(|s| s.orbit.parameters[0]).next().unwrap();
    assert!((next - ROESSLER_SECOND_DOUBLING).abs() < 1e-7, "{next:.12}");
}

#[test]
fn the_doubling_of_duffing_is_that_of_another_program() {
    let start = Vector4::new(1.0, 0.0, 1.0, 0.0);
    let plain = started(&Duffing::PLAIN, [0.15, 0.0], start, 0, 1);
    let branch = branch::<_, 4, 6>(&Duffing::PLAIN, &plain, 1.0, (0.1, 0.5));
    let doublings = branch
        .specials
        .iter()
        .filter(|s| s.kind == Bifurcation::PeriodDoubling);
    let first = doublings.map(|s| s.orbit.parameters[0]).next().unwrap();
    assert!((first - DUFFING_DOUBLING).abs() < 1e-8, "{first:.12}");
}

/// A mass on a belt: it sticks up to `STATIC`, and slips with `KINETIC` friction. Its speed relative to the
/// belt is always backwards.
#[derive(Debug)]
struct Belt;
#[derive(Debug, Clone, Copy, PartialEq)]
enum Contact {
    Sticks,
    Slips,
}
const STATIC_N: f64 = 1.5;
const KINETIC_N: f64 = 0.9;
struct BeltAt<T>(Parameters<T>);

impl System<2> for Belt {
    type Mode = Contact;
    type Equations<T: Real> = BeltAt<T>;

    fn equations<T: Real>(&self, parameters: Parameters<T>) -> BeltAt<T> {
        BeltAt(parameters)
    }

    fn longest_step_s(&self) -> f64 {
        0.2
    }
}

impl<T: Real> Equations<T, 2> for BeltAt<T> {
    type Mode = Contact;

    fn mode_at(&self, x: &Vector2<T>) -> Contact {
        if x[1] < self.0[0] {
            Contact::Slips
        } else {
            Contact::Sticks
        }
    }

    fn derivative(&self, x: &Vector2<T>, mode: Contact) -> Vector2<T> {
        match mode {
            Contact::Sticks => Vector2::new(self.0[0], T::zero()),
            Contact::Slips => Vector2::new(x[1], number::<T>(KINETIC_N) - x[0]),
        }
    }

    fn margins(&self, x: &Vector2<T>, mode: Contact) -> [T; 2] {
        let none = number(f64::INFINITY);
        match mode {
            Contact::Sticks => [number::<T>(STATIC_N) - x[0], none],
            Contact::Slips => [self.0[0] - x[1], none],
        }
    }

    fn next_mode(&self, x: &mut Vector2<T>, mode: Contact, _passed: usize) -> Contact {
        match mode {
            Contact::Sticks => Contact::Slips,
            Contact::Slips => {
                x[1] = self.0[0];
                Contact::Sticks
            }
        }
    }

    fn is_confined(&self, mode: Contact) -> bool {
        mode == Contact::Sticks
    }
}

#[test]
fn stick_and_slip_on_a_belt_by_its_closed_form() {
    let guess = Guess {
        start: Vector2::new(KINETIC_N, -1.2),
        period_s: 6.5,
        parameters: [1.0, 0.0],
    };
    let branch = branch::<_, 2, 4>(&Belt, &guess, 1.0, (0.5, 2.0));
    assert_eq!(branch.end, End::Range);
    for orbit in &branch.orbits {
        let speed = orbit.parameters[0];
        let drop = (STATIC_N - KINETIC_N) / speed;
        let wanted = TAU - 2.0 * drop.atan() + 2.0 * drop;
        assert!(
            (orbit.period_s - wanted).abs() < 1e-9,
            "{speed}: {} {wanted}",
            orbit.period_s
        );
        // Whatever differed before it sticks is gone after it.
        assert!(orbit.multipliers[0].norm() < 1e-9);
        assert_eq!(orbit.modes().len(), 2);
    }
}

#[test]
fn a_state_at_rest_or_on_its_way_is_refused() {
    let rest = Guess {
        start: Vector2::new(0.0, 0.0),
        period_s: TAU,
        parameters: [-0.1, 1.0],
    };
    let refused = Shooting::<_, 2, 4>::new(&Radial::PLAIN, &rest, &[1.0], 1, TOLERANCE);
    assert_eq!(refused.err(), Some(continuation::Failure::AtRest));
    let away = Guess {
        start: Vector2::new(3.0, 0.0),
        period_s: TAU,
        parameters: [0.0, 1.0],
    };
    let backwards = Radial {
        time: -1.0,
        unit: 1.0,
    };
    let refused = Shooting::<_, 2, 4>::new(&backwards, &away, &[1.0], 1, TOLERANCE);
    assert!(matches!(
        refused.err(),
        Some(continuation::Failure::Diverges { .. })
    ));
}

/// z' = (mu + i) z + 2 nu |z|^2 z along the eigenvector of length 1, so that the coefficient is 2 nu.
#[test]
fn the_first_lyapunov_coefficient_of_a_radial_system() {
    for nu in [-1.0, 1.0] {
        let parameters = [-0.1, nu];
        let settings = Settings::over(&[(-0.2, 0.2)]);
        let sizes = Vector2::new(1.0, 1.0);
        let spans = settings.spans();
        let problem = Equilibria::<_, 2, 4>::new(&Radial::PLAIN, (), &sizes, parameters, &spans);
        let guess = problem.unknowns(&Vector2::zeros(), parameters);
        let branch = equilibrium::follow(&problem, guess, 1.0, &settings).unwrap();
        let [hopf] = &branch.hopf[..] else {
            panic!("{:?}", branch.hopf)
        };
        assert!(hopf.at.parameters[0].abs() < 1e-12);
        // The fifth power adds to the differences of the third derivative.
        let coefficient = hopf.first_lyapunov_coefficient;
        assert!((coefficient - 2.0 * nu).abs() < 1e-5, "{coefficient}");
    }
}
