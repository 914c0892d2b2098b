//! Many trajectories, integrated on all threads.

use super::batch::{self, Batch};
use super::equation::{Analytic, Equation, Polynomial};
use super::observables::{Span, Trajectory};
use super::queue::Queue;
use super::task::{Task, Unsupported};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use shared_model::Scenario;
use shared_model::vehicle::SlipForm;
use std::marker::PhantomData;

/// Trajectories of scenarios from their initial states, under the mean of their dither from the
/// start.
///
/// ```
/// use engine::taylor::{Ensemble, Observables, Span};
///
/// let mut still = shared_model::Scenario::reconstruction();
/// still.run.sideslip_rad = 0.0;
/// still.run.steering_angle_rad = 0.0;
/// still.steering.motor_current_a = 0.0;
/// let span = Span { time_s: 10.0, tolerance: 1e-10, observables: Observables::default(), warm_up_s: 0.0, segments: 0 };
/// let found = Ensemble::new(&[still])?.integrate::<0>(&span);
/// // Without the motor's torque, straight ahead is an equilibrium.
/// assert_eq!(<[f64; 4]>::from(found[0].end.x), [0.0; 4]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Ensemble {
    tasks: Vec<Task>,
}

impl Ensemble {
    /// The trajectories at their initial states.
    ///
    /// # Errors
    /// If a scenario is not valid, or not supported by the engine.
    pub fn new(scenarios: &[Scenario<f64>]) -> Result<Self, Unsupported> {
        let tasks = scenarios.iter().map(Task::new).collect::<Result<_, _>>()?;
        Ok(Self { tasks })
    }

    /// Integrates all over a span, with `K` tangent vectors each, on all threads. The results are
    /// in the order of the scenarios.
    pub fn integrate<const K: usize>(&self, span: &Span) -> Vec<Trajectory<K>>
    where
        Tangents<K>: Compiled<K>,
    {
        Tangents::integrate(self, Arch::new(), span)
    }

    fn integrate_by<const K: usize>(&self, arch: Arch, span: &Span) -> Vec<Trajectory<K>> {
        let alike = self.tasks.chunk_by(|a, b| a.form() == b.form());
        let integrate = |tasks: &[Task]| match tasks[0].form() {
            (SlipForm::SmallAngle, 0, _) => integrate::<Polynomial, K>(arch, tasks, span),
            _ => integrate::<Analytic, K>(arch, tasks, span),
        };
        alike.flat_map(integrate).collect()
    }

    /// Continues from the ends of the trajectories.
    pub fn continue_from<const K: usize>(&mut self, found: &[Trajectory<K>]) {
        for (task, found) in self.tasks.iter_mut().zip(found) {
            task.start = found.end;
        }
    }
}

/// A number of tangent vectors.
#[derive(Debug)]
pub struct Tangents<const K: usize>;

/// A number of tangent vectors for which this crate holds compiled code, so that callers do not
/// compile the engine again.
pub trait Compiled<const K: usize> {
    /// Integrates the ensemble with a given instruction set.
    fn integrate(ensemble: &Ensemble, arch: Arch, span: &Span) -> Vec<Trajectory<K>>;
}

impl Compiled<0> for Tangents<0> {
    #[inline(never)]
    fn integrate(ensemble: &Ensemble, arch: Arch, span: &Span) -> Vec<Trajectory<0>> {
        ensemble.integrate_by(arch, span)
    }
}

impl Compiled<1> for Tangents<1> {
    #[inline(never)]
    fn integrate(ensemble: &Ensemble, arch: Arch, span: &Span) -> Vec<Trajectory<1>> {
        ensemble.integrate_by(arch, span)
    }
}

impl Compiled<4> for Tangents<4> {
    #[inline(never)]
    fn integrate(ensemble: &Ensemble, arch: Arch, span: &Span) -> Vec<Trajectory<4>> {
        ensemble.integrate_by(arch, span)
    }
}

/// Integrates tasks of one form, on each thread as many side by side as it has lanes.
fn integrate<E: Integrated, const K: usize>(
    arch: Arch,
    tasks: &[Task],
    span: &Span,
) -> Vec<Trajectory<K>> {
    let queue = &Queue::new(tasks, span.ends_s()[0]);
    let threads = rayon::current_num_threads();
    let most = tasks.len().div_ceil(threads);
    let batches = (0..threads).into_par_iter();
    let mut results: Vec<_> = batches
        .flat_map_iter(|_| {
            arch.dispatch(Share::<E, K> {
                queue,
                span,
                most,
                equation: PhantomData,
            })
        })
        .collect();
    results.sort_unstable_by_key(|&(index, _)| index);
    results.into_iter().map(|(_, found)| found).collect()
}

/// A right-hand side with the number of vectors in which its trajectories are integrated side by
/// side.
trait Integrated: Equation {
    /// Integrates trajectories of the queue, up to `most` at once.
    fn integrate_queue<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<batch::Result<K>>;
}

impl Integrated for Polynomial {
    // Two vectors: enough to hide the latency of a multiplication.
    #[inline(always)]
    fn integrate_queue<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<batch::Result<K>> {
        Batch::<S, 2, K, Self>::new(simd, queue, span, most).run()
    }
}

impl Integrated for Analytic {
    // One vector: the recurrences are long enough to hide their latencies.
    #[inline(always)]
    fn integrate_queue<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<batch::Result<K>> {
        Batch::<S, 1, K, Self>::new(simd, queue, span, most).run()
    }
}

/// One thread's share.
struct Share<'a, E, const K: usize> {
    queue: &'a Queue<'a, K>,
    span: &'a Span,
    most: usize,
    equation: PhantomData<E>,
}

impl<E: Integrated, const K: usize> WithSimd for Share<'_, E, K> {
    type Output = Vec<batch::Result<K>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        E::integrate_queue(simd, self.queue, self.span, self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::taylor::Observables;
    use pulp::x86::{V3, V4};
    use shared_model::dither::Waveform;
    use shared_model::tire::TireModel;

    /// Trajectories of all regimes: chaos, a period, stick, rest, and one that diverges; and of
    /// both kinds of right-hand side.
    fn scenarios() -> Vec<Scenario<f64>> {
        let scenario = |k: usize| {
            let mut scenario = Scenario::reconstruction();
            scenario.run.wheel_speed_rpm = 800.0 + 60.0 * k as f64;
            scenario.run.sideslip_rad = 0.02 - 0.003 * k as f64;
            if k % 3 == 1 {
                scenario.dither.waveform = Waveform::Square;
                scenario.dither.amplitude_v = 0.1;
            }
            if k > 20 {
                scenario.vehicle.slip_form = SlipForm::Exact;
                scenario.tires.model = TireModel::MagicFormula;
                scenario.run.wheel_speed_rpm = 1700.0;
            }
            if k == 11 || k == 13 {
                // At rest from the start, at exact zeros; with a friction of no torque.
                scenario.run.sideslip_rad = 0.0;
                scenario.run.steering_angle_rad = 0.0;
                scenario.steering.motor_current_a = 0.0;
                scenario.friction.coefficient = if k == 11 { 0.0 } else { 0.28 };
            }
            if k == 7 {
                (scenario.tires.front, scenario.tires.rear) =
                    shared_model::tire::HIGH_FRICTION_ROAD;
            }
            scenario
        };
        (0..40).map(scenario).collect()
    }

    fn span() -> Span {
        Span {
            time_s: 5.0,
            tolerance: 1e-11,
            observables: Observables {
                turns: [true; 4],
                section: Some((1, 0.0)),
            },
            warm_up_s: 1.0,
            segments: 4,
        }
    }

    /// Neither the instruction set, nor the neighbours in a vector, nor the number of threads
    /// changes a bit. On one thread the motions are more than its lanes, and take turns.
    #[test]
    fn bits_are_the_same_on_every_path_and_in_every_company() {
        let scenarios = scenarios();
        let ensemble = Ensemble::new(&scenarios).expect("all are supported");
        let portable = Tangents::<4>::integrate(&ensemble, Arch::Scalar, &span());
        let v3 = V3::try_new().map(Arch::V3);
        let v4 = V4::try_new().map(Arch::V4);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be started").install(|| {
                for arch in [v3, v4].into_iter().flatten() {
                    assert_eq!(
                        Tangents::<4>::integrate(&ensemble, arch, &span()),
                        portable,
                        "{arch:?}"
                    );
                }
            });
        }
        let alone = |scenario: &Scenario<f64>| {
            let one = Ensemble::new(std::slice::from_ref(scenario)).expect("it is supported");
            one.integrate::<4>(&span()).remove(0)
        };
        assert_eq!(scenarios.iter().map(alone).collect::<Vec<_>>(), portable);
        assert!(portable[7].early_end.is_some());
        assert!(portable.iter().any(|found| found.events > 0));
        assert!(portable.iter().all(|found| found.crossings.len() < 1000));
    }
}
