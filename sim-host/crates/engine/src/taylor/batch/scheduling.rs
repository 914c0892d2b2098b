//! Motions get on, take turns, come to their ends and get off.

use super::{Batch, greatest};
use crate::taylor::equation::Equation;
use crate::taylor::lanes::Lanes;
use crate::taylor::queue::{LaneData, Waiting};
use crate::taylor::series::Series;
use measures::Reason;
use measures::early_end::BOUND;
use pulp::Simd;
use shared_model::vehicle::State;

impl<'a, S: Simd, const V: usize, const K: usize, E: Equation> Batch<'a, S, V, K, E> {
    /// The last motions take turns in the lanes: the one furthest ahead waits for the one furthest
    /// behind, so that all end together and no lane is empty for long.
    #[inline(never)]
    pub(super) fn take_turns(&mut self) {
        if !(1..=self.lanes.len()).contains(&self.queue.len()) {
            return;
        }
        let active = (0..self.lanes.len()).filter(|&lane| self.lanes[lane].is_some());
        let ahead = active.max_by(|&a, &b| self.time_s(a).total_cmp(&self.time_s(b)));
        let Some(lane) = ahead else {
            return;
        };
        let time_s = self.time_s(lane);
        if let Some(motion) = self.take(lane) {
            self.queue.push(time_s, motion);
            self.load_next(lane);
        }
    }

    /// Ends pieces and motions that are at their ends, and motions that leave all bounds.
    #[inline(always)]
    pub(super) fn finish_segments(&mut self) {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let room = splat(BOUND) - greatest(&self.expansion.x, 0);
        if splat(0.0).all_less(self.left_s.min(room)) {
            return;
        }
        for lane in 0..Lanes::<S, V>::COUNT {
            self.finish_lane(lane);
        }
    }

    #[inline(never)]
    fn finish_lane(&mut self, lane: usize) {
        let Some(motion) = &self.lanes[lane] else {
            return;
        };
        let ended_early = motion.trajectory.early_end.is_some();
        let bounded = self.state(lane).iter().all(|value| value.abs() < BOUND);
        if !ended_early && !bounded {
            self.end_early(lane, Reason::Diverges);
        }
        if ended_early || !bounded {
            self.unload(lane);
        } else if self.left_s.as_slice()[lane] <= 0.0 {
            self.finish_segment(lane);
        }
    }

    fn finish_segment(&mut self, lane: usize) {
        if K > 0 {
            self.accumulate_stretching(lane);
        }
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        // The first piece is for the tangent vectors to turn into their directions.
        if motion.segment > 0 {
            motion.trajectory.log_stretching.push(motion.log_stretching);
        }
        motion.log_stretching = [0.0; K];
        if motion.segment + 1 == self.ends_s.len() {
            self.unload(lane);
            return;
        }
        motion.segment += 1;
        let length_s = self.ends_s[motion.segment] - self.ends_s[motion.segment - 1];
        self.left_s.as_mut_slice()[lane] = length_s;
    }

    /// Puts a motion's findings aside, and the next motion into its lane.
    fn unload(&mut self, lane: usize) {
        if let Some((mut motion, numbers)) = self.take(lane) {
            motion.trajectory.end = State {
                x: numbers.x.into(),
                friction: motion.mode,
            };
            for (i, x) in numbers.x.into_iter().enumerate() {
                motion.trajectory.extend(i, x);
            }
            self.results.push((motion.index, motion.trajectory));
        }
        self.load_next(lane);
    }

    pub(super) fn load_next(&mut self, lane: usize) {
        match self.queue.next() {
            Some(motion) => self.load(lane, motion),
            None => self.set_lane_data(lane, &LaneData::idle()),
        }
    }

    fn load(&mut self, lane: usize, (mut motion, numbers): Waiting<'a, K>) {
        self.set_lane_data(lane, &numbers);
        let (model, injection) = (&motion.task.model, motion.task.injection);
        self.expansion.set_lane(lane, model, injection);
        motion.entered_at_step = self.steps;
        self.lanes[lane] = Some(motion);
        self.active += 1;
        self.load_mode(lane);
    }

    /// Takes a motion out of its lane, which rests.
    fn take(&mut self, lane: usize) -> Option<Waiting<'a, K>> {
        let mut motion = self.lanes[lane].take()?;
        motion.trajectory.steps += self.steps - motion.entered_at_step;
        let numbers = LaneData {
            x: self.state(lane),
            tangents: self.expansion.tangents.each_ref().map(|tangent| {
                let coefficient = |x: &Series<S, V>| x[0].as_slice()[lane];
                tangent.each_ref().map(coefficient)
            }),
            stretch: self.stretch.map(|stretch| stretch.as_slice()[lane]),
            step_s: self.step_s.as_slice()[lane],
            left_s: self.left_s.as_slice()[lane],
        };
        self.active -= 1;
        self.expansion.free_lane(lane);
        self.guards.free_lane(lane);
        Some((motion, numbers))
    }

    pub(super) fn set_lane_data(&mut self, lane: usize, numbers: &LaneData<K>) {
        for i in 0..4 {
            self.expansion.x[i][0].as_mut_slice()[lane] = numbers.x[i];
            for k in 0..K {
                let component = &mut self.expansion.tangents[k][i][0];
                component.as_mut_slice()[lane] = numbers.tangents[k][i];
            }
        }
        for k in 0..K {
            self.stretch[k].as_mut_slice()[lane] = numbers.stretch[k];
        }
        self.step_s.as_mut_slice()[lane] = numbers.step_s;
        self.left_s.as_mut_slice()[lane] = numbers.left_s;
    }
}
