//! Time of an instance, in PWM periods.

use shared_model::short::Short;

/// A time within this share of a period around its start counts as the start: the times of a master
/// that adds up its steps are rounded.
const TOLERANCE: f64 = 1e-3;
/// Most PWM periods of a step, so that every call ends in seconds.
const MAX_STEP_PERIODS: f64 = 1e6;
/// Most PWM periods of a run; the counters of the program hold them.
const MAX_PERIODS: f64 = 4e9;

/// Time of an instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clock {
    start_s: f64,
    stop_s: Option<f64>,
    time_s: f64,
    /// Number of PWM periods that have begun.
    begun: u64,
}

/// PWM periods of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Periods {
    /// Number of periods that begin in it.
    pub begin: u64,
    /// Whether the last one ends with it.
    pub ends: bool,
}

impl Clock {
    /// At the start of an experiment, which may have an end.
    pub fn new(start_s: f64, stop_s: Option<f64>) -> Result<Self, String> {
        if !start_s.is_finite() {
            return Err(format!(
                "start time {} s: must be a finite number",
                Short(start_s)
            ));
        }
        // NaN is not after it.
        let is_after = |stop_s: &f64| *stop_s > start_s;
        if let Some(stop_s) = stop_s.filter(|stop_s| !is_after(stop_s)) {
            return Err(format!(
                "stop time {} s: must be after the start time, {} s",
                Short(stop_s),
                Short(start_s)
            ));
        }
        Ok(Self {
            start_s,
            stop_s,
            time_s: start_s,
            begun: 0,
        })
    }

    /// The present time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Advances by a step from `time_s` on, which must be the present time.
    pub fn step(&mut self, time_s: f64, step_s: f64, rate_hz: f64) -> Result<Periods, String> {
        let tolerance_s = TOLERANCE / rate_hz;
        // All comparisons are written so that NaN is refused.
        let most_s = MAX_STEP_PERIODS / rate_hz;
        if !(step_s > 0.0 && step_s <= most_s) {
            return Err(format!(
                "step size {} s: must be above 0 and at most {} s",
                Short(step_s),
                Short(most_s)
            ));
        }
        let is_present = (time_s - self.time_s).abs() <= tolerance_s;
        if !is_present {
            return Err(format!(
                "step from {} s: must continue at the present time, {} s",
                Short(time_s),
                Short(self.time_s)
            ));
        }
        let end_s = time_s + step_s;
        if let Some(stop_s) = self.stop_s.filter(|stop_s| end_s > stop_s + tolerance_s) {
            return Err(format!(
                "step to {} s: must not be beyond the stop time, {} s",
                Short(end_s),
                Short(stop_s)
            ));
        }
        let position = (end_s - self.start_s) * rate_hz;
        if position > MAX_PERIODS {
            return Err(format!(
                "step to {} s: an instance runs for at most {} s; reset it",
                Short(end_s),
                Short(MAX_PERIODS / rate_hz)
            ));
        }
        let begun = (position - TOLERANCE).ceil().max(0.0) as u64;
        let periods = Periods {
            begin: begun.saturating_sub(self.begun),
            ends: (position - position.round()).abs() <= TOLERANCE,
        };
        self.begun = self.begun.max(begun);
        self.time_s = end_s;
        Ok(periods)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Begun and whole periods after each step.
    fn run(step_s: f64, steps: usize) -> Vec<(u64, bool)> {
        let mut clock = Clock::new(0.0, None).unwrap();
        let mut begun = 0;
        let advanced = |_| {
            let periods = clock.step(clock.time_s(), step_s, 1e4).unwrap();
            begun += periods.begin;
            (begun, periods.ends)
        };
        (0..steps).map(advanced).collect()
    }

    #[test]
    fn periods_of_steps_of_all_sizes() {
        assert_eq!(run(1e-4, 3), [(1, true), (2, true), (3, true)]);
        assert_eq!(run(1e-3, 2), [(10, true), (20, true)]);
        assert_eq!(
            run(0.5e-4, 4),
            [(1, false), (1, true), (2, false), (2, true)]
        );
        assert_eq!(
            run(0.4e-4, 5),
            [(1, false), (1, false), (2, false), (2, false), (2, true)]
        );
        assert_eq!(run(2.5e-4, 2), [(3, false), (5, true)]);
    }

    /// The master adds up a million steps.
    #[test]
    fn rounding_does_not_add_up() {
        let (begun, ends) = run(1e-4, 1_000_000)[999_999];
        assert_eq!((begun, ends), (1_000_000, true));
    }
}
