//! Times of the Taylor engine on the jobs that `benches/peers` gives other integrators, and how
//! near they are to the machine's limit.

use clap::Parser;
use dynamics::map::cell::{Cell, cells};
use dynamics::map::plan::{Grid, Plan, Sheet, Start};
use dynamics::sweep::{RunControl, Timing};
use engine::Stepper;
use engine::reference::Reference;
use engine::taylor::{Ensemble, ORDER, Observables, Span, Trajectory};
use pulp::{Arch, Simd, WithSimd};
use rayon::ThreadPoolBuilder;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::friction::FrictionLaw;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

/// Times of the Taylor engine on jobs S, L, F and M (see benches/peers/README.md), and the share of
/// the machine's peak. Job E is S with exact slip angles, G with the Magic Formula; the fixed
/// step's time and error stand beside them.
#[derive(Parser)]
struct Arguments {
    /// Runs of each job
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// One JSON object per run of S, L and F, as `benches/peers/run --own` takes them; no M, no
    /// roofline
    #[arg(long)]
    json: bool,
    /// Cells of job M's map in each direction
    #[arg(long, default_value_t = 256)]
    cells: usize,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// Length of jobs S, L and F, s, and the instant at which their error is taken.
const TIME_S: f64 = 400.0;
const COMPARED_S: f64 = 10.0;
/// Largest error at that instant, rad and rad/s.
const MOST_ERROR: f64 = 7e-8;
/// Tolerances from coarse to fine, of which the first that keeps the error is taken.
const TOLERANCES: [f64; 11] = [
    4e-10, 3.2e-10, 2.5e-10, 2e-10, 1.6e-10, 1.3e-10, 1e-10, 5e-11, 2e-11, 1e-12, 1e-13,
];
/// Time for the processor's clock to rise before a job is measured.
const WARM_UP: Duration = Duration::from_millis(200);
/// Length of a motion of job M, s, half of it a transient.
const MAP_TIME_S: f64 = 200.0;

#[derive(Clone, Copy, PartialEq)]
enum Job {
    States,
    Exponents,
    Friction,
    ExactSlip,
    MagicFormula,
}

impl Job {
    /// Those of the peers.
    const COMMON: [Self; 3] = [Self::States, Self::Exponents, Self::Friction];
    /// Those whose right-hand side is no polynomial.
    const ANALYTIC: [Self; 2] = [Self::ExactSlip, Self::MagicFormula];

    fn name(self) -> &'static str {
        match self {
            Self::States => "S",
            Self::Exponents => "L",
            Self::Friction => "F",
            Self::ExactSlip => "E",
            Self::MagicFormula => "G",
        }
    }

    /// 31 wheel speeds.
    fn scenarios(self) -> Vec<Scenario<f64>> {
        let scenario = |k: usize| {
            let mut scenario = Scenario::reconstruction();
            if self != Self::Friction {
                scenario.friction.law = FrictionLaw::None;
            }
            match self {
                Self::ExactSlip => scenario.vehicle.slip_form = SlipForm::Exact,
                Self::MagicFormula => scenario.tires.model = TireModel::MagicFormula,
                _ => {}
            }
            let run = &mut scenario.run;
            run.wheel_speed_rpm = 1600.0 + 10.0 * k as f64;
            run.sideslip_rad = 0.01;
            run.yaw_rate_rad_per_s = 0.01;
            run.steering_angle_rad = 0.001;
            run.steering_rate_rad_per_s = 0.0;
            scenario
        };
        (0..31).map(scenario).collect()
    }

    /// Follows the motions; gives the ends, steps, changes of mode and the mean exponent.
    fn follow(self, motions: &Ensemble, time_s: f64, tolerance: f64) -> Outcome {
        let span = Span {
            time_s,
            tolerance,
            observables: Observables::default(),
            warm_up_s: 0.0,
            segments: 0,
        };
        match self {
            Self::Exponents => {
                let segments = (time_s / COMPARED_S) as usize;
                let found = motions.integrate::<1>(&Span { segments, ..span });
                let growth: f64 = found
                    .iter()
                    .flat_map(|f| &f.log_stretching)
                    .map(|g| g[0])
                    .sum();
                let mean = growth / time_s / found.len() as f64;
                Outcome::of(&found, Some(mean))
            }
            _ => Outcome::of(&motions.integrate::<0>(&span), None),
        }
    }
}

#[derive(Clone)]
struct Outcome {
    ends: Vec<[f64; 4]>,
    steps: usize,
    events: usize,
    mean_exponent_per_s: Option<f64>,
}

impl Outcome {
    fn of<const K: usize>(found: &[Trajectory<K>], mean_exponent_per_s: Option<f64>) -> Self {
        Self {
            ends: found.iter().map(|f| f.end.x.into()).collect(),
            steps: found.iter().map(|f| f.steps).sum(),
            events: found.iter().map(|f| f.events).sum(),
            mean_exponent_per_s,
        }
    }
}

/// A job, measured.
#[derive(Clone)]
struct Measured {
    job: Job,
    tolerance: f64,
    error: f64,
    cpu_s: Vec<f64>,
    outcome: Outcome,
}

fn main() {
    let arguments = Arguments::parse();
    let one = pool(1);
    let measure = |job: Job| one.install(|| measure(job, arguments.runs));
    let mut measured = Job::COMMON.map(measure).to_vec();
    if arguments.json {
        measured.iter().for_each(print_json);
        return;
    }
    measured.extend(Job::ANALYTIC.map(measure));
    println!(
        "job  tolerance  error at 10 s  CPU s: median (least to greatest)     steps   changes of mode"
    );
    for row in &measured {
        let cpu = spread(&row.cpu_s);
        println!(
            "{:3}  {:9.0e}  {:13.1e}  {:25}  {:9}   {}",
            row.job.name(),
            row.tolerance,
            row.error,
            cpu,
            row.outcome.steps,
            row.outcome.events
        );
    }
    Job::ANALYTIC.into_iter().for_each(fixed_step);
    roofline(&measured[..Job::COMMON.len()], &one);
    map(arguments.cells);
}

fn pool(threads: usize) -> rayon::ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads can be started")
}

fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Median, least and greatest.
fn spread(seconds: &[f64]) -> String {
    let mut sorted = seconds.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (least, most) = (sorted[0], sorted[sorted.len() - 1]);
    format!("{:.4} ({least:.4} to {most:.4})", sorted[sorted.len() / 2])
}

/// The states at 10 s: to 18 digits and more for the peers' jobs, by the reference integrator for
/// the others.
fn reference(job: Job) -> Vec<[f64; 4]> {
    if Job::ANALYTIC.contains(&job) {
        let end = |scenario: &Scenario<f64>| {
            let reference = Reference::new(scenario, 1e-13);
            let state = reference.expect("it is valid").run(COMPARED_S).cloned();
            let state = state.expect("it stays bounded");
            state.x.into()
        };
        return job.scenarios().iter().map(end).collect();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../benches/peers/reference.json");
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let all: Value = serde_json::from_str(&text).expect("the reference is JSON");
    let states = &all["jobs"][job.name()]["states"];
    let number = |k: usize, i: usize| {
        let digits = states[k][i].as_str().expect("digits");
        digits.parse().expect("a number")
    };
    (0..job.scenarios().len())
        .map(|k| std::array::from_fn(|i| number(k, i)))
        .collect()
}

/// Largest distance of a component.
fn worst(ends: &[[f64; 4]], reference: &[[f64; 4]]) -> f64 {
    let pairs = ends.iter().flatten().zip(reference.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The same work by the ECU's fixed step, at a thousandth of a second.
fn fixed_step(job: Job) {
    let scenarios = job.scenarios();
    let follow = |time_s: f64| -> Vec<[f64; 4]> {
        let end = |scenario: &Scenario<f64>| {
            let mut motion = Stepper::new(scenario).expect("it is valid");
            motion.observe(time_s, |_, _| {}).expect("it stays bounded");
            motion.state().x.into()
        };
        scenarios.iter().map(end).collect()
    };
    let error = worst(&follow(COMPARED_S), &reference(job));
    let start = cpu_s();
    black_box(follow(TIME_S));
    println!(
        "{:3}  fixed step  {error:12.1e}  {:.4}",
        job.name(),
        cpu_s() - start
    );
}

fn measure(job: Job, runs: usize) -> Measured {
    let motions = Ensemble::new(&job.scenarios()).expect("the jobs fit");
    let reference = reference(job);
    let error_at = |tolerance: f64| {
        worst(
            &job.follow(&motions, COMPARED_S, tolerance).ends,
            &reference,
        )
    };
    let kept = |tolerance: &f64| error_at(*tolerance) <= MOST_ERROR;
    let tolerance = TOLERANCES
        .into_iter()
        .find(kept)
        .expect("the error is kept");
    let run = || {
        let start = cpu_s();
        let outcome = job.follow(&motions, TIME_S, tolerance);
        (cpu_s() - start, outcome)
    };
    let start = Instant::now();
    let mut outcome = run().1;
    while start.elapsed() < WARM_UP {
        outcome = run().1;
    }
    Measured {
        job,
        tolerance,
        error: error_at(tolerance),
        cpu_s: (0..runs.max(1)).map(|_| run().0).collect(),
        outcome,
    }
}

fn print_json(row: &Measured) {
    for cpu_s in &row.cpu_s {
        let setting = format!("order {ORDER}, last term below {:.0e}", row.tolerance);
        let line = json!({
            "job": row.job.name(),
            "cpu_s": cpu_s,
            "error": row.error,
            "setting": setting,
            "mean_exponent_per_s": row.outcome.mean_exponent_per_s,
            "mode_changes": row.outcome.events,
        });
        println!("{line}");
    }
}

/// Floating-point operations of the recurrences and of the state behind a step; choosing the step
/// is not counted.
fn flops(tangents: usize) -> usize {
    let of_order = |n: usize| {
        let square = 2 * (n / 2 + 1) + 1;
        let product = 2 * (n + 1);
        let linear = 4 + 2 + 17;
        2 * (square + product + 2) + linear + tangents * (2 * product + linear)
    };
    let sums: usize = (0..ORDER).map(of_order).sum();
    sums + (1 + tangents) * 4 * 2 * ORDER
}

/// Share of the peak that was reached, the peak measured by the same instruction set on this
/// machine, now.
fn roofline(measured: &[Measured], one: &rayon::ThreadPool) {
    let peak = one.install(|| Arch::new().dispatch(Peak));
    println!(
        "peak of multiply-add on one core, measured: {:.1} GFLOP/s",
        peak / 1e9
    );
    for row in measured {
        let flops = flops(usize::from(row.job == Job::Exponents));
        let least_s = row.cpu_s.iter().copied().fold(f64::INFINITY, f64::min);
        let rate = (flops * row.outcome.steps) as f64 / least_s;
        println!(
            "{}: {flops} flops a step, {:.1} ns a step, {:.1} GFLOP/s, {:.0} % of the peak",
            row.job.name(),
            1e9 * least_s / row.outcome.steps as f64,
            rate / 1e9,
            100.0 * rate / peak
        );
    }
}

/// Independent multiply-adds on registers.
struct Peak;

impl WithSimd for Peak {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        const CHAINS: usize = 10;
        const ROUNDS: usize = 20_000_000;
        let factor = simd.splat_f64s(black_box(0.999));
        let mut sums = [simd.splat_f64s(black_box(1.0)); CHAINS];
        let start = cpu_s();
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = simd.mul_add_f64s(*sum, factor, factor);
            }
        }
        let time_s = cpu_s() - start;
        black_box(sums);
        (2 * CHAINS * ROUNDS * S::F64_LANES) as f64 / time_s
    }
}

/// Job M: the cells of a map over wheel speed and amplitude, tile by tile, on one thread and on
/// two.
fn map(cells_a_side: usize) {
    let axis = |from, to| Grid {
        from,
        to,
        count: cells_a_side,
    };
    let sheet = Sheet {
        waveform: Waveform::Square,
        start: Start::Given,
        amplitudes_v: axis(0.0, 0.2),
    };
    let timing = Timing {
        transient_s: 0.5 * MAP_TIME_S,
        observed_s: 0.5 * MAP_TIME_S,
    };
    let speeds_rpm = axis(1000.0, 2000.0);
    let plan = Plan::new(Scenario::reconstruction(), vec![sheet], speeds_rpm, timing);
    let plan = plan.expect("the map is valid");
    let tiles: Vec<usize> = (0..plan.tiles()).collect();
    let run = |threads: usize| {
        pool(threads).install(|| {
            let start = Instant::now();
            let tile = |&tile: &usize| cells(&plan, &plan.places(tile)).expect("the cells fit");
            let cells = RunControl::none().points(&tiles, tile);
            let cells: Vec<Cell> = cells.into_iter().flatten().flatten().collect();
            (start.elapsed().as_secs_f64(), cells)
        })
    };
    let (one_s, cells) = run(1);
    let (two_s, cells_of_two) = run(2);
    assert!(cells == cells_of_two, "threads change nothing");
    println!(
        "M: {cells_a_side} x {cells_a_side} cells x {MAP_TIME_S} s: {one_s:.1} s on one thread, {two_s:.1} s on two: {:.2} times; {:.0} cells/s",
        one_s / two_s,
        plan.cells() as f64 / two_s
    );
}
