//! Motions that wait for a lane. Threads share a queue.

use super::observables::Trajectory;
use super::task::Task;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{STEERING_RATE, State};
use std::sync::{Mutex, MutexGuard};

/// Longest step, s.
pub(super) const LONGEST_STEP_S: f64 = 0.2;

/// A motion on its way.
pub(super) struct Active<'a, const K: usize> {
    pub task: &'a Task,
    /// Index of the task.
    pub index: usize,
    /// Steps of its flight before it.
    pub entered_at_step: usize,
    pub mode: FrictionMode,
    /// Changes of mode in a row that came too soon.
    pub short_modes: usize,
    /// Index of the piece that it is in.
    pub segment: usize,
    /// Logarithms of the tangent vectors' growth since the piece began.
    pub log_stretching: [f64; K],
    /// That of the first since the start, as far as it has been counted.
    pub log_stretching_before: f64,
    pub trajectory: Trajectory<K>,
}

impl<'a, const K: usize> Active<'a, K> {
    fn at_start(index: usize, task: &'a Task) -> Self {
        Self {
            task,
            index,
            entered_at_step: 0,
            mode: task.start.friction,
            short_modes: 0,
            segment: 0,
            log_stretching: [0.0; K],
            log_stretching_before: 0.0,
            trajectory: Trajectory::at(&task.start),
        }
    }
}

/// The numbers of a motion that are in its lane as long as it has one.
pub(super) struct LaneData<const K: usize> {
    /// The state.
    pub x: [f64; 4],
    pub tangents: [[f64; 4]; K],
    /// Lengths that the tangent vectors had when they were made unit vectors, multiplied up.
    pub stretch: [f64; K],
    /// The step that the tolerance allows, s.
    pub step_s: f64,
    /// What is left of the piece, s.
    pub left_s: f64,
}

impl<const K: usize> LaneData<K> {
    /// Those of a motion's start.
    fn at(start: &State<f64>, left_s: f64) -> Self {
        let mut tangents = [[0.5; 4]; K];
        for (k, tangent) in tangents.iter_mut().enumerate() {
            // Linearly independent, and none along an axis, which may be invariant; a steering that
            // sticks has no rate.
            tangent[k] = 1.5;
            if start.friction == FrictionMode::Sticking {
                tangent[STEERING_RATE] = 0.0;
            }
        }
        Self {
            x: start.x.into(),
            tangents,
            stretch: [1.0; K],
            step_s: LONGEST_STEP_S,
            left_s,
        }
    }

    /// Those of a lane without a motion, which rests for ever.
    pub fn idle() -> Self {
        let rest = State {
            x: [0.0; 4].into(),
            friction: FrictionMode::Neutral,
        };
        Self {
            step_s: 0.0,
            ..Self::at(&rest, f64::INFINITY)
        }
    }
}

/// A motion without a lane.
pub(super) type Waiting<'a, const K: usize> = (Active<'a, K>, LaneData<K>);

/// Motions that wait for a lane.
pub(super) struct Queue<'a, const K: usize> {
    tasks: &'a [Task],
    /// Length of their first piece, s.
    first_s: f64,
    waiting: Mutex<Ends<'a, K>>,
}

struct Ends<'a, const K: usize> {
    /// Index of the next task that has not begun.
    next: usize,
    /// Motions that have, each with the time it has come to, s from its start.
    paused: Vec<(f64, Waiting<'a, K>)>,
}

impl<'a, const K: usize> Queue<'a, K> {
    /// All tasks, at least one, in their order.
    pub fn new(tasks: &'a [Task], first_s: f64) -> Self {
        let (next, paused) = (0, Vec::new());
        let waiting = Mutex::new(Ends { next, paused });
        Self {
            tasks,
            first_s,
            waiting,
        }
    }

    /// The first task; the others are like it.
    pub fn first(&self) -> &'a Task {
        &self.tasks[0]
    }

    /// How many motions wait.
    pub fn len(&self) -> usize {
        let waiting = self.lock();
        self.tasks.len() - waiting.next + waiting.paused.len()
    }

    /// The one that is furthest behind.
    pub fn next(&self) -> Option<Waiting<'a, K>> {
        let mut waiting = self.lock();
        let index = waiting.next;
        let Some(task) = self.tasks.get(index) else {
            return waiting.furthest_behind();
        };
        waiting.next += 1;
        let numbers = LaneData::at(&task.start, self.first_s);
        Some((Active::at_start(index, task), numbers))
    }

    /// Lets a motion wait that has come to `time_s` from its start.
    pub fn push(&self, time_s: f64, motion: Waiting<'a, K>) {
        self.lock().paused.push((time_s, motion));
    }

    fn lock(&self) -> MutexGuard<'_, Ends<'a, K>> {
        self.waiting.lock().expect("no thread ends with the lock")
    }
}

impl<'a, const K: usize> Ends<'a, K> {
    fn furthest_behind(&mut self) -> Option<Waiting<'a, K>> {
        let times = self.paused.iter().map(|(time_s, _)| time_s);
        let (least, _) = times.enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        Some(self.paused.swap_remove(least).1)
    }
}
