//! Delayed feedback of a sensor's signal through the motor: which unstable orbits it holds, with which gains and
//! delays, and with how much torque.
//!
//! On the orbit the feedback vanishes, so the torque that remains is that of noise and of an error of the delay.
//! Its stability is that of a discrete system: the vehicle at the ECU's control rate, and the delay line as part
//! of the state. An odd number of real multipliers greater than 1 cannot be held by this law for most systems (H.
//! Nakajima, Physics Letters A 232 (1997) 207; for autonomous ones see E. W. Hooton, A. Amann, Physical Review
//! Letters 109 (2012) 154101); those of the vehicle's orbits are less than -1.

use crate::component::Component;
use crate::period::{TOLERANCE, maxima_of_turns, period_of_maxima};
use crate::settled::VehicleOrbit;
use crate::sweep::{Parameter, RunControl, SweepError, Values, scenarios};
use continuation::Failure;
use continuation::arclength::Settings;
use continuation::branch::{follow, orbit_at};
use continuation::orbit::{Guess, Shooting};
use continuation::start::{Search, near_returns};
use continuation::vehicle::Vehicle;
use engine::dual::Dual;
use nalgebra::{Matrix4, Vector4};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series, large_dots};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use shared_model::delayed_feedback::{DelayedFeedback, Law};
use shared_model::dither::{Application, Injection};
use shared_model::vehicle::{Model, State, YAW_RATE};
use shared_model::{Real, Scenario, integrate};
use std::collections::VecDeque;

/// Ticks of the delay line: 8 s at a control rate of 1 kHz.
const LINE: usize = 8192;
/// Periods after which the greatest multiplier is taken, and over which.
const SETTLING_PERIODS: usize = 60;
const MEASURED_PERIODS: usize = 120;
/// Transient before the search for the orbit, its length and tolerances, s.
const SEARCHED_AFTER_S: f64 = 60.0;
const SEARCHED_S: f64 = 100.0;
const SEARCH_TOLERANCE: f64 = 1e-9;
const ORBIT_TOLERANCE: f64 = 1e-11;
/// Parameters of the orbits: the speed, and one that is not varied.
const KEYS: [&str; 2] = [Parameter::Speed.key(), "vehicle.mass_kg"];
/// How far the branch of orbits is followed beyond the speeds, rpm.
const BEYOND_RPM: f64 = 1.0;
/// Its longest step, as a share of the range: near a homoclinic orbit Newton's method needs a close guess.
const LONGEST_STEP: f64 = 0.004;
/// Seed of the sensor's noise.
const NOISE_SEED: u64 = 20_071;
/// Greatest torque of a trajectory that is held, N m; at most half of the limit.
const HELD_NM: f64 = 0.5;
/// A torque, root mean square, that is small, as with an exact delay, N m.
const SMALL_NM: f64 = 0.05;
/// Part of a simulation at its end from which the torque is taken, s.
const JUDGED_S: f64 = 60.0;

/// A feedback: which signal, how strong, how late.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Feedback {
    /// The signal that is fed back.
    pub component: Component,
    /// Torque per difference of the signal, N m s/rad for rates and N m/rad for angles.
    pub gain: f64,
    /// Delay, s.
    pub delay_s: f64,
    /// Weight of a period relative to the one after it, 0 to less than 1.
    pub memory: f64,
    /// Greatest torque either way, about the steering axis, N m.
    pub limit_nm: f64,
    /// Rate at which the delay adapts, ticks per square of the signal's unit ([`Law::adaptation`]); 0 for a delay
    /// that stays.
    pub adaptation: f64,
    /// Ticks from the measurement to the torque, beside the one in which it is computed.
    pub latency_ticks: usize,
}

impl Feedback {
    fn law(&self, tick_s: f64) -> Law<f64> {
        Law {
            gain: self.gain,
            delay_ticks: self.delay_s / tick_s,
            memory: self.memory,
            limit_nm: self.limit_nm,
            adaptation: self.adaptation,
        }
    }
}

/// An orbit of one cycle, linearised at each control tick.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Its period, s.
    pub period_s: f64,
    /// A state on it.
    pub start: [f64; 4],
    /// Its multiplier of greatest modulus without feedback, beside 1.
    pub free_multiplier: f64,
    /// A whole number of ticks makes the period: about the control rate's.
    tick_s: f64,
    ticks: Vec<Tick>,
}

/// Derivatives of the state after a tick, by the state before and by the torque; and the rate of the state before.
#[derive(Debug, Clone)]
struct Tick {
    by_state: Matrix4<f64>,
    by_torque: Vector4<f64>,
    rate: Vector4<f64>,
}

impl Linearised {
    /// The orbit of one cycle nearest to the scenario's trajectory, stable or not; `None` if Newton's method
    /// finds none.
    ///
    /// ```
    /// let scenario = shared_model::Scenario::reconstruction();
    /// let orbit = dynamics::delayed_feedback::Linearised::of(&scenario).unwrap();
    /// assert!((1.68..1.70).contains(&orbit.period_s));
    /// assert!(orbit.free_multiplier < -1.0);
    /// ```
    pub fn of(scenario: &Scenario<f64>) -> Option<Self> {
        let vehicle = Vehicle::new(scenario, KEYS).ok()?;
        Self::at(scenario, &near_trajectory(&vehicle, scenario)?)
    }

    fn at(scenario: &Scenario<f64>, orbit: &VehicleOrbit) -> Option<Self> {
        let (period_s, start) = (orbit.period_s, *orbit.start());
        let count = (period_s * scenario.run.control_rate_hz).round();
        let tick_s = period_s / count;
        let free_multiplier = orbit.multipliers.first()?;
        Some(Self {
            period_s,
            start: start.into(),
            free_multiplier: free_multiplier.norm().copysign(free_multiplier.re),
            tick_s,
            ticks: ticks(scenario, start, tick_s, count as usize),
        })
    }

    /// The greatest modulus of a multiplier beside 1 under a feedback, by power iteration: the vehicle's state
    /// and the delay line, along the orbit. To first order in a delay unlike the period.
    pub fn greatest_multiplier(&self, feedback: &Feedback) -> f64 {
        let index = feedback.component.index;
        let mut perturbed = Perturbation::new(self, feedback);
        let mut log_growth = 0.0;
        for period in 0..SETTLING_PERIODS + MEASURED_PERIODS {
            interrupt::check();
            for tick in &self.ticks {
                perturbed.step(tick, index, feedback);
            }
            perturbed.remove_shift(self, index);
            let log_size = perturbed.normalise();
            if !log_size.is_finite() {
                // All of it is gone: as with the dead beat of a scalar system.
                return 0.0;
            }
            if period >= SETTLING_PERIODS {
                log_growth += log_size;
            }
        }
        (log_growth / MEASURED_PERIODS as f64).exp()
    }

    /// The gain of those tried with the least multiplier, that multiplier, and the range of those around it with
    /// multipliers less than 1.
    pub fn best_gain(&self, feedback: &Feedback, gains: &Values) -> Best {
        let at = |gain: f64| self.greatest_multiplier(&Feedback { gain, ..*feedback });
        let tried: Vec<(f64, f64)> = gains.iter().map(|gain| (gain, at(gain))).collect();
        let least = (0..tried.len())
            .min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))
            .unwrap_or(0);
        let holds = |k: &usize| tried[*k].1 < 1.0;
        let first = (0..=least).rev().take_while(holds).last();
        let last = (least..tried.len()).take_while(holds).last();
        Best {
            gain: tried[least].0,
            multiplier: tried[least].1,
            holding: first
                .zip(last)
                .map(|(first, last)| (tried[first].0, tried[last].0)),
        }
    }
}

/// The orbit of one cycle that the scenario's trajectory returns to.
fn near_trajectory(vehicle: &Vehicle, scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    let run = &scenario.run;
    let search = Search {
        start: Vector4::new(
            run.sideslip_rad,
            run.yaw_rate_rad_per_s,
            run.steering_angle_rad,
            run.steering_rate_rad_per_s,
        ),
        transient_s: SEARCHED_AFTER_S,
        observed_s: SEARCHED_S,
        component: YAW_RATE,
        most_cycles: 1,
        tolerance: SEARCH_TOLERANCE,
    };
    let found = near_returns(vehicle, vehicle.parameters(), &search).ok()?;
    orbit_near(vehicle, &found.first()?.guess)
}

fn orbit_near(vehicle: &Vehicle, guess: &Guess<4>) -> Option<VehicleOrbit> {
    let problem = Shooting::<_, 4, 6>::new(vehicle, guess, &[1.0], 1, ORBIT_TOLERANCE).ok()?;
    let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters);
    orbit_at(&problem, unknowns.ok()?).ok()
}

/// The orbits of one cycle over the speed: the branch through the first that a trajectory returns to.
fn branch_over_speed(scenarios: &[Scenario<f64>], range: (f64, f64)) -> Vec<VehicleOrbit> {
    let first = scenarios.iter().find_map(|scenario| {
        let vehicle = Vehicle::new(scenario, KEYS).ok()?;
        let orbit = near_trajectory(&vehicle, scenario)?;
        Some((vehicle, orbit))
    });
    let Some((vehicle, orbit)) = first else {
        return Vec::new();
    };
    let mut settings = Settings::over(&[range]);
    settings.longest_step = LONGEST_STEP;
    let both_ways = || -> Result<Vec<VehicleOrbit>, Failure> {
        let spans = settings.spans();
        let problem =
            Shooting::<_, 4, 6>::new(&vehicle, &orbit.guess(), &spans, 1, ORBIT_TOLERANCE)?;
        let guess = problem.guess(orbit.start(), orbit.period_s, orbit.parameters)?;
        let mut orbits = Vec::new();
        for sign in [-1.0, 1.0] {
            let axis = problem.parameter_axis(sign);
            orbits.extend(follow(&problem, guess.clone(), &axis, &settings, |_| true)?.orbits);
        }
        Ok(orbits)
    };
    both_ways().unwrap_or_default()
}

/// The orbit at a scenario's speed, from the nearest of a branch.
fn orbit_on(branch: &[VehicleOrbit], scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    let vehicle = Vehicle::new(scenario, KEYS).ok()?;
    let [rpm, _] = vehicle.parameters();
    let apart = |orbit: &VehicleOrbit| (orbit.parameters[0] - rpm).abs();
    let nearest = branch.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    let guess = Guess {
        parameters: vehicle.parameters(),
        ..nearest.guess()
    };
    orbit_near(&vehicle, &guess)
}

/// The best of the gains tried.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Best {
    /// The gain with the least multiplier.
    pub gain: f64,
    /// Its greatest multiplier.
    pub multiplier: f64,
    /// The gains around it, of those tried, that hold the orbit.
    pub holding: Option<(f64, f64)>,
}

/// Steps of the vehicle in a control tick: at the PWM's rate, as in the loop. At the control rate itself the instants
/// of stick and slip would err so much that a multiplier errs by 2 %.
fn steps_per_tick(scenario: &Scenario<f64>) -> u32 {
    let run = &scenario.run;
    (run.pwm_rate_hz / run.control_rate_hz).round().max(1.0) as u32
}

/// The vehicle of a scenario without dither, under the motor's constant torque.
fn undithered(scenario: &Scenario<f64>) -> (Model<f64>, f64) {
    let mut scenario = *scenario;
    scenario.dither.application = Application::Averaged;
    scenario.dither.amplitude_v = 0.0;
    (Model::new(&scenario), scenario.steering.motor_torque_nm())
}

fn ticks(scenario: &Scenario<f64>, start: Vector4<f64>, tick_s: f64, count: usize) -> Vec<Tick> {
    let (model, torque_nm) = undithered(scenario);
    let mut dual = model.map(&Dual::<5>::constant);
    let mut torque = Dual::constant(torque_nm);
    torque.tangent[4] = 1.0;
    dual.set_motor_torque_nm(torque);
    let steps = steps_per_tick(scenario);
    let step_s = Dual::constant(tick_s / f64::from(steps));
    let mut state = model.state(start);
    let mut ticks = Vec::with_capacity(count);
    for _ in 0..count {
        let mode = model.mode_at(&state.x, Injection::Off);
        let rate = model.derivative(&state.x, Injection::Off, mode);
        let mut after = State {
            x: Vector4::from_fn(|i, _| {
                let mut seeded = Dual::constant(state.x[i]);
                seeded.tangent[i] = 1.0;
                seeded
            }),
            friction: state.friction,
        };
        for _ in 0..steps {
            integrate::step(&dual, &mut after, step_s, Injection::Off);
        }
        ticks.push(Tick {
            by_state: Matrix4::from_fn(|i, k| after.x[i].tangent[k]),
            by_torque: Vector4::from_fn(|i, _| after.x[i].tangent[4]),
            rate,
        });
        state = after.map(Real::to_f64);
    }
    ticks
}

/// A perturbation of the orbit: of the state, and of the values in the delay line.
struct Perturbation {
    state: Vector4<f64>,
    /// Of the line's values, the newest last.
    line: VecDeque<f64>,
    delay_ticks: f64,
    /// Torques on their way to the motor, the next first.
    torques_nm: VecDeque<f64>,
}

impl Perturbation {
    fn new(orbit: &Linearised, feedback: &Feedback) -> Self {
        let delay_ticks = (feedback.delay_s / orbit.tick_s).max(1.0);
        let length = delay_ticks.ceil() as usize + 1;
        Self {
            // Along all components, and no symmetry of the orbit.
            state: Vector4::new(1.0, -0.7, 0.5, 0.3),
            line: std::iter::repeat_n(0.0, length).collect(),
            delay_ticks,
            torques_nm: std::iter::repeat_n(0.0, feedback.latency_ticks).collect(),
        }
    }

    /// The value that was pushed last so many ticks ago.
    fn before(&self, ticks: f64) -> f64 {
        let whole = ticks.floor();
        let at = |back: usize| {
            let place = self.line.len().checked_sub(1 + back);
            place.map_or(0.0, |place| self.line[place])
        };
        let later = at(whole as usize);
        later + (ticks - whole) * (at(whole as usize + 1) - later)
    }

    fn step(&mut self, tick: &Tick, index: usize, feedback: &Feedback) {
        let signal = self.state[index];
        let delayed = self.before(self.delay_ticks - 1.0);
        self.torques_nm
            .push_back(feedback.gain * (delayed - signal));
        let torque_nm = self.torques_nm.pop_front().unwrap_or(0.0);
        self.line.pop_front();
        self.line
            .push_back((1.0 - feedback.memory) * signal + feedback.memory * delayed);
        self.state = tick.by_state * self.state + tick.by_torque * torque_nm;
    }

    /// Takes out the shift along the orbit, whose multiplier is 1: what is left crosses the section of the
    /// orbit's start at the same time.
    fn remove_shift(&mut self, orbit: &Linearised, index: usize) {
        let rate = orbit.ticks[0].rate;
        let share = self.state.dot(&rate) / rate.norm_squared();
        self.state -= rate * share;
        let rates = orbit.ticks.iter().rev().cycle();
        for (value, tick) in self.line.iter_mut().rev().zip(rates) {
            *value -= share * tick.rate[index];
        }
    }

    /// Scales it to size 1; the logarithm of its size before.
    fn normalise(&mut self) -> f64 {
        let size = self
            .line
            .iter()
            .fold(self.state.amax(), |size, value| size.max(value.abs()));
        self.state /= size;
        let others = self.line.iter_mut().chain(&mut self.torques_nm);
        others.for_each(|value| *value /= size);
        size.ln()
    }
}

/// A trajectory under feedback.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Held {
    /// Root mean square of the torque over the last minute, N m.
    pub torque_rms_nm: f64,
    /// Its greatest magnitude over the last minute, N m.
    pub torque_peak_nm: f64,
    /// Time from switching on until the torque stays below 0.5 N m and half of its limit, s; none if it does not.
    pub capture_s: Option<f64>,
    /// Maxima of the yaw rate in a cycle over the last minute; none if they do not repeat.
    pub maxima: Option<usize>,
    /// The delay at the end, s.
    pub delay_s: f64,
    /// Least and greatest yaw rate over the last minute, rad/s.
    pub yaw_rates_rad_per_s: (f64, f64),
}

/// The conditions of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Conditions {
    /// Time before the feedback is switched on, s.
    pub free_s: f64,
    /// Time with it, s.
    pub time_s: f64,
    /// Standard deviation of the sensor's noise, in the signal's unit.
    pub noise: f64,
}

/// The trajectory of a vehicle without dither, the feedback being computed at the control rate and switched on after
/// a while. The torque is held over a control tick.
pub fn simulate(plant: &Scenario<f64>, feedback: &Feedback, conditions: &Conditions) -> Held {
    let rate_hz = plant.run.control_rate_hz;
    let tick_s = 1.0 / rate_hz;
    let steps = steps_per_tick(plant);
    let step_s = tick_s / f64::from(steps);
    let (mut model, constant_nm) = undithered(plant);
    let mut state = model.initial_state(plant);
    let mut law = DelayedFeedback::<f64, LINE>::new(feedback.law(tick_s));
    let mut noise = Noise::new(conditions.noise);
    let mut torques_nm: VecDeque<f64> = std::iter::repeat_n(0.0, feedback.latency_ticks).collect();
    let ticks = |time_s: f64| (time_s * rate_hz) as u64;
    let free = ticks(conditions.free_s);
    let all = free + ticks(conditions.time_s);
    let judged = all.saturating_sub(ticks(JUDGED_S));
    let index = feedback.component.index;
    let held_nm = HELD_NM.min(0.5 * feedback.limit_nm);
    let (mut squares, mut peak_nm, mut last_great) = (0.0, 0.0_f64, free);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut turns = Vec::new();
    let mut last = (state.x[YAW_RATE], 0.0);
    for tick in 0..all {
        interrupt::check();
        if tick == free {
            // The line is full; what it has adapted to in chaos is none of the orbit's.
            law.restart();
        }
        let wanted_nm = law.run(state.x[index] + noise.next());
        // The line fills before it is switched on.
        torques_nm.push_back(if tick < free { 0.0 } else { wanted_nm });
        let torque_nm = torques_nm.pop_front().unwrap_or(0.0);
        model.set_motor_torque_nm(constant_nm + torque_nm);
        for _ in 0..steps {
            integrate::step(&model, &mut state, step_s, Injection::Off);
        }
        if torque_nm.abs() > held_nm {
            last_great = tick;
        }
        if tick >= judged {
            squares += torque_nm * torque_nm;
            peak_nm = peak_nm.max(torque_nm.abs());
            low = low.min(state.x[YAW_RATE]);
            high = high.max(state.x[YAW_RATE]);
        }
        let change = state.x[YAW_RATE] - last.0;
        if tick > judged && change * last.1 < 0.0 {
            turns.push((tick as f64 * tick_s, last.0));
        }
        last = (state.x[YAW_RATE], change);
    }
    let range = high - low;
    let maxima = maxima_of_turns(&turns, range);
    Held {
        torque_rms_nm: (squares / (all - judged).max(1) as f64).sqrt(),
        torque_peak_nm: peak_nm,
        capture_s: (last_great < judged).then(|| (last_great - free) as f64 * tick_s),
        maxima: period_of_maxima(&maxima, range, TOLERANCE).maxima(),
        delay_s: law.delay_ticks() * tick_s,
        yaw_rates_rad_per_s: (low, high),
    }
}

/// Normal noise, the same in every run.
struct Noise {
    distribution: Option<Normal<f64>>,
    generator: Pcg64,
}

impl Noise {
    fn new(deviation: f64) -> Self {
        Self {
            distribution: Normal::new(0.0, deviation).ok().filter(|_| deviation > 0.0),
            generator: Pcg64::seed_from_u64(NOISE_SEED),
        }
    }

    fn next(&mut self) -> f64 {
        let drawn = |distribution: &Normal<f64>| distribution.sample(&mut self.generator);
        self.distribution.as_ref().map_or(0.0, drawn)
    }
}

/// What a feedback does at one wheel speed.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Point {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Period of the orbit of one cycle, s.
    pub period_s: f64,
    /// Its multiplier of greatest modulus without feedback, beside 1.
    pub free_multiplier: f64,
    /// The best gain.
    pub best: Best,
    /// The trajectory from the scenario's start under the best gain.
    pub held: Held,
}

/// What is to be computed: the gains tried, and the lengths of the simulation without and with feedback.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// The feedback; its gain and its delay are chosen for each speed.
    pub feedback: Feedback,
    /// The gains tried.
    pub gains: Values,
    /// Error of the delay in the simulation, s.
    pub delay_error_s: f64,
    /// The conditions of the simulation.
    pub conditions: Conditions,
}

/// Orbits, best gains and simulations over the wheel speed, each with the orbit's own period as delay. `plant` is
/// the vehicle that is simulated, which may be another than the scenario, whose orbits give delay and gain; `None`
/// at a speed where no orbit of one cycle is found. Speeds that were not begun before a request to stop are left
/// out.
///
/// # Errors
/// If a scenario is not valid.
pub fn over_speed(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    plan: &Plan,
    plant: &Scenario<f64>,
    control: RunControl,
) -> Result<Vec<Option<Point>>, SweepError> {
    let scenarios = scenarios(scenario, Parameter::Speed, speeds_rpm)?;
    let (first, last) = scenarios
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), one| {
            let rpm = one.run.wheel_speed_rpm;
            (low.min(rpm), high.max(rpm))
        });
    let range = (first - BEYOND_RPM, last + BEYOND_RPM);
    let plant =
        |scenario: &Scenario<f64>| Parameter::Speed.set(plant, scenario.run.wheel_speed_rpm);
    let branch = interrupt::catch(|| branch_over_speed(&scenarios, range)).unwrap_or_default();
    let points = control.points(&scenarios, |scenario| {
        let orbit = Linearised::at(scenario, &orbit_on(&branch, scenario)?)?;
        let delayed = Feedback {
            delay_s: orbit.period_s,
            ..plan.feedback
        };
        let best = orbit.best_gain(&delayed, &plan.gains);
        let feedback = Feedback {
            gain: best.gain,
            delay_s: orbit.period_s + plan.delay_error_s,
            ..delayed
        };
        Some(Point {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            period_s: orbit.period_s,
            free_multiplier: orbit.free_multiplier,
            best,
            held: simulate(&plant(scenario), &feedback, &plan.conditions),
        })
    });
    Ok(points.into_iter().flatten().collect())
}

/// One gain and one error of the delay.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Cell {
    /// The gain.
    pub gain: f64,
    /// Error of the delay, s.
    pub delay_error_s: f64,
    /// Greatest modulus of a multiplier of the orbit, to first order in the error.
    pub multiplier: f64,
    /// The simulation.
    pub held: Held,
}

/// Multiplier and simulation at each gain of the plan and each error of the delay, at the scenario's speed; none if
/// there is no orbit of one cycle. Cells that were not begun before a request to stop are left out.
pub fn region(
    scenario: &Scenario<f64>,
    plan: &Plan,
    errors_s: &Values,
    plant: &Scenario<f64>,
    control: RunControl,
) -> Option<Vec<Cell>> {
    let orbit = Linearised::of(scenario)?;
    let of_gain = |gain| errors_s.iter().map(move |error_s| (gain, error_s));
    let places: Vec<(f64, f64)> = plan.gains.iter().flat_map(of_gain).collect();
    let cells = control.points(&places, |&(gain, delay_error_s)| {
        let feedback = Feedback {
            gain,
            delay_s: orbit.period_s + delay_error_s,
            ..plan.feedback
        };
        Cell {
            gain,
            delay_error_s,
            multiplier: orbit.greatest_multiplier(&feedback),
            held: simulate(plant, &feedback, &plan.conditions),
        }
    });
    Some(cells.into_iter().flatten().collect())
}

/// The cells by what they hold, over the error of the delay and the gain.
pub fn region_chart(cells: &[Cell], feedback: &Feedback, wheel_speed_rpm: f64) -> Chart {
    type Holds = fn(&Cell) -> bool;
    let groups: [(&str, Holds); 3] = [
        ("periodic, torque less than 0.05 N m", |cell| {
            cell.held.maxima.is_some() && cell.held.torque_rms_nm < SMALL_NM
        }),
        ("periodic, more torque", |cell| {
            cell.held.maxima.is_some() && cell.held.torque_rms_nm >= SMALL_NM
        }),
        ("not periodic", |cell| cell.held.maxima.is_none()),
    ];
    let series = groups.iter().enumerate().flat_map(|(n, (label, holds))| {
        let of_group = cells.iter().filter(|cell| holds(cell));
        let points = of_group.map(|cell| (1e3 * cell.delay_error_s, cell.gain));
        large_dots(label, n, points.collect())
    });
    Chart {
        heading: format!(
            "Delayed feedback at {wheel_speed_rpm} rpm: gain and delay that hold the orbit"
        ),
        panels: vec![Panel {
            caption: "regime and root mean square of the torque, by simulation".into(),
            x: AxisSpec::linear("delay less period (ms)"),
            y: AxisSpec::linear(&format!("gain (N m per {})", feedback.component.unit)),
            series: series.collect(),
            ..Panel::default()
        }],
    }
}

/// Multipliers without and with feedback, and the torque that is left, over the wheel speed.
pub fn chart(points: &[Point]) -> Chart {
    let line = |label: &str, n, of: fn(&Point) -> f64| Series {
        label: label.into(),
        points: points
            .iter()
            .map(|point| (point.wheel_speed_rpm, of(point)))
            .collect(),
        look: Look::Line(n),
    };
    let x = || AxisSpec::linear(Parameter::Speed.name());
    let panel = |caption: &str, y: AxisSpec, series, levels| Panel {
        caption: caption.into(),
        x: x(),
        y,
        series,
        levels,
        ..Panel::default()
    };
    Chart {
        heading: "Delayed feedback: the orbit of one cycle over the wheel speed".into(),
        panels: vec![
            panel(
                "greatest modulus of a multiplier",
                AxisSpec::linear("modulus"),
                vec![
                    line("without feedback", 1, |point| point.free_multiplier.abs()),
                    line("with the best gain", 0, |point| point.best.multiplier),
                ],
                vec![1.0],
            ),
            panel(
                "torque of the last minute, beside the motor's constant one",
                AxisSpec::logarithmic("torque (N m)"),
                vec![
                    line("peak", 1, |point| point.held.torque_peak_nm),
                    line("root mean square", 0, |point| point.held.torque_rms_nm),
                ],
                Vec::new(),
            ),
        ],
    }
}
