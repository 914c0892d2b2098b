//! Instructions of the ECU's tasks, counted by the emulator. They are not cycles of a real core.

use qemu::Machine;
use qemu::telemetry::Recording;
use shared_model::{Real, Scenario};
use std::collections::BTreeMap;

/// Number of instructions and its frequency, in ascending order.
pub type Histogram = Vec<(u32, u64)>;

/// Instructions of both tasks in a run.
#[derive(Debug, Clone, Default)]
pub struct Instructions {
    /// The control task.
    pub control: Histogram,
    /// The slowest PWM task of each control tick.
    pub pwm: Histogram,
    /// PWM periods in a control tick.
    pub periods_a_tick: u32,
    /// Instructions that the core executes in a control tick.
    pub tick: f64,
}

impl Instructions {
    /// Of a run in open loop.
    pub fn of(recording: &Recording) -> Self {
        let header = &recording.header;
        let count = |counts: u16| recording.instructions(counts);
        let records = || recording.records.iter();
        Self {
            control: histogram(records().map(|record| count(record.control_cost))),
            pwm: histogram(records().map(|record| count(record.pwm_cost))),
            periods_a_tick: header.samples_per_step.into(),
            tick: f64::from(header.instruction_rate_hz) / f64::from(header.step_rate_hz),
        }
    }

    /// Of a run in the loop, from the counts of the PWM task (the maximum of one period) and of the
    /// control task, one pair per control tick. All timers of the machine must have their
    /// nominal clock.
    pub fn in_loop<T: Real>(
        costs: &[(u16, u16)],
        scenario: &Scenario<T>,
        machine: Machine,
    ) -> Self {
        let rate_hz = machine.instruction_rate_hz();
        // The costs are counted with the clock of the PWM timer.
        let instructions_per_count = rate_hz / machine.timer_clock_hz();
        let count = |counts: u16| (f64::from(counts) * instructions_per_count).round() as u32;
        Self {
            control: histogram(costs.iter().map(|&(_, control)| count(control))),
            pwm: histogram(costs.iter().map(|&(pwm, _)| count(pwm))),
            periods_a_tick: scenario.periods_per_tick(),
            tick: rate_hz / scenario.run.control_rate_hz.to_f64(),
        }
    }

    /// With the control tasks of another run in addition.
    pub fn with_control_of(mut self, other: &Self) -> Self {
        let all = self.control.iter().chain(&other.control);
        let mut control = BTreeMap::new();
        for &(count, times) in all {
            *control.entry(count).or_insert(0) += times;
        }
        self.control = control.into_iter().collect();
        self
    }

    /// Worst-case load of the core by both tasks; above 1 the core is overloaded.
    pub fn worst_share(&self) -> f64 {
        let pwm = f64::from(self.periods_a_tick) * f64::from(most(&self.pwm));
        (f64::from(most(&self.control)) + pwm) / self.tick
    }
}

fn histogram(instructions: impl Iterator<Item = u32>) -> Histogram {
    let mut histogram = BTreeMap::new();
    for count in instructions {
        *histogram.entry(count).or_insert(0) += 1;
    }
    histogram.into_iter().collect()
}

/// The greatest number of instructions; 0 if there are none.
pub fn most(histogram: &[(u32, u64)]) -> u32 {
    histogram.last().map_or(0, |&(count, _)| count)
}

/// The median number of instructions; 0 if there are none.
pub fn median(histogram: &[(u32, u64)]) -> u32 {
    let total: u64 = histogram.iter().map(|&(_, times)| times).sum();
    let mut seen = 0;
    for &(count, times) in histogram {
        seen += times;
        if 2 * seen >= total {
            return count;
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_do_not_exceed_the_median() {
        let histogram = histogram([5, 3, 3, 9].into_iter());
        assert_eq!(histogram, [(3, 2), (5, 1), (9, 1)]);
        assert_eq!((median(&histogram), most(&histogram)), (3, 9));
        assert_eq!((median(&[]), most(&[])), (0, 0));
    }

    #[test]
    fn the_worst_of_both_tasks_share_a_tick() {
        let instructions = Instructions {
            control: vec![(100, 7), (400, 1)],
            pwm: vec![(50, 8)],
            periods_a_tick: 10,
            tick: 1000.0,
        };
        assert!((instructions.worst_share() - 0.9).abs() < 1e-12);
    }
}
