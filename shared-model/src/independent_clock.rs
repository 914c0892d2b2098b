//! A slow clock of an oscillator of its own judges the control ticks, over several of them.
//!
//! The gate judges every tick by a fast counter. Where that counter has the oscillator of the ticks
//! themselves, an oscillator that is wrong is not found: both are wrong alike. A slow independent
//! clock finds it, but not in one tick: a tick of 1 ms is 32 counts of a clock of 32 kHz, and one
//! count more or less is 3 %. So it judges a window of at least 256 counts, 8 ms then, beside the
//! fast counter and not in place of it.
//!
//! An internal low-speed oscillator is inaccurate, and its accuracy limits what is found:
//!
//! * *Absolute*: the counts must be possible with the range of the data sheet and the tolerance of the
//!   gate. With 29.5 to 34 kHz and 20 %, ticks are found for certain that are 31 % too short or
//!   38 % too long, or more; with 17 to 47 kHz only those that are wrong by a factor of 3.5.
//! * *Change*: the second window is the reference for all later ones. A change by more than the
//!   gate's tolerance is found, but not one that was there at the start.

/// Least counts of a window: one count is 0.4 % of it.
const WINDOW_COUNTS: f32 = 256.0;
/// Counts by which a window can differ with nothing wrong: one at either end.
const RESOLUTION_COUNTS: u32 = 2;
/// Least tolerance: an RC oscillator drifts by some per cent with temperature and supply.
const LEAST_TOLERANCE: f32 = 0.1;

/// A free-running counter, upwards, with an oscillator of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IndependentClock {
    /// Nominal counts per second.
    pub nominal_hz: u32,
    /// Least counts per second, by the data sheet.
    pub least_hz: u32,
    /// Most counts per second, by the data sheet.
    pub most_hz: u32,
    /// Bits of the counter, 15 to 32.
    pub bits: u32,
}

/// The check of the ticks by an independent clock.
#[derive(Debug, Clone)]
pub struct ClockCheck {
    mask: u32,
    ticks_per_window: u32,
    least_counts: u32,
    most_counts: u32,
    tolerance_1024ths: u32,
    ticks: u32,
    start: u32,
    /// Windows so far, at most 2: the first is discarded, as the oscillator may still be starting.
    windows: u32,
    reference: u32,
}

impl ClockCheck {
    /// The check for ticks at `control_rate_hz`, with the tolerance of the gate for a tick.
    pub fn new(clock: &IndependentClock, control_rate_hz: f32, tick_tolerance: f32) -> Self {
        let tolerance = tick_tolerance.max(LEAST_TOLERANCE);
        let counts_per_tick = clock.nominal_hz as f32 / control_rate_hz;
        // Rounded up; a cast saturates.
        let ticks_per_window = (WINDOW_COUNTS / counts_per_tick) as u32 + 1;
        let window_s = ticks_per_window as f32 / control_rate_hz;
        let least = clock.least_hz as f32 * window_s * (1.0 - tolerance);
        let most = clock.most_hz as f32 * window_s * (1.0 + tolerance);
        Self {
            mask: u32::MAX >> (32 - clock.bits.clamp(15, 32)),
            ticks_per_window,
            least_counts: (least as u32).saturating_sub(RESOLUTION_COUNTS),
            most_counts: (most as u32).saturating_add(RESOLUTION_COUNTS),
            tolerance_1024ths: (1024.0 * tolerance) as u32,
            ticks: 0,
            start: 0,
            windows: 0,
            reference: 0,
        }
    }

    /// Takes the counter at a control tick; false if a window ended that was too short or too long.
    pub fn tick(&mut self, counter: u32) -> bool {
        self.ticks = self.ticks.saturating_add(1);
        if self.ticks < self.ticks_per_window {
            return true;
        }
        self.ticks = 0;
        let counts = counter.wrapping_sub(self.start) & self.mask;
        self.start = counter;
        match self.windows {
            0 => {
                self.windows = 1;
                return true;
            }
            1 => {
                self.windows = 2;
                self.reference = counts;
            }
            _ => {}
        }
        let is_possible = (self.least_counts..=self.most_counts).contains(&counts);
        let change = u64::from(counts.abs_diff(self.reference));
        let allowed = (u64::from(self.reference) * u64::from(self.tolerance_1024ths)) >> 10;
        is_possible && change <= allowed + u64::from(RESOLUTION_COUNTS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f32 = 1000.0;
    const TOLERANCE: f32 = 0.2;
    const G474: IndependentClock = IndependentClock {
        nominal_hz: 32_000,
        least_hz: 29_500,
        most_hz: 34_000,
        bits: 16,
    };
    const F405: IndependentClock = IndependentClock {
        nominal_hz: 32_000,
        least_hz: 17_000,
        most_hz: 47_000,
        bits: 15,
    };

    /// Ticks until the check finds that the ticks are `factor` times as long as nominal, from
    /// `change_at` on; `None` if it does not in 2000 ticks.
    fn found(clock: &IndependentClock, actual_hz: f64, change_at: u32, factor: f64) -> Option<u32> {
        let mut check = ClockCheck::new(clock, RATE_HZ, TOLERANCE);
        let mut time_s = 0.3;
        (0..2000).find(|&tick| {
            let factor = if tick < change_at { 1.0 } else { factor };
            time_s += factor / f64::from(RATE_HZ);
            let counter = (time_s * actual_hz) as u64 as u32 & (u32::MAX >> (32 - clock.bits));
            !check.tick(counter)
        })
    }

    #[test]
    fn right_ticks_pass_with_every_oscillator_of_the_data_sheet() {
        for clock in [G474, F405] {
            for step in 0..=100 {
                let span = f64::from(clock.most_hz - clock.least_hz);
                let actual_hz = f64::from(clock.least_hz) + span * f64::from(step) / 100.0;
                assert_eq!(found(&clock, actual_hz, 0, 1.0), None, "{actual_hz} Hz");
                // Within the tolerance of a tick.
                for factor in [0.85, 1.15] {
                    assert_eq!(found(&clock, actual_hz, 500, factor), None);
                }
            }
        }
    }

    #[test]
    fn a_change_beyond_the_tolerance_is_found_in_two_windows() {
        for clock in [G474, F405] {
            for actual_hz in [clock.least_hz, clock.nominal_hz, clock.most_hz] {
                for factor in [0.0, 0.5, 0.75, 1.25, 2.0] {
                    let tick = found(&clock, actual_hz.into(), 500, factor);
                    let ticks = tick.expect("it is found") - 500;
                    assert!(ticks <= 18, "{factor}: after {ticks} ticks");
                }
            }
        }
    }

    #[test]
    fn ticks_that_are_wrong_from_the_start_are_found_beyond_the_oscillators_range() {
        for actual_hz in [29_500.0, 32_000.0, 34_000.0] {
            for factor in [0.5, 0.67, 1.42, 2.0] {
                let tick = found(&G474, actual_hz, 0, factor);
                assert!(tick.is_some_and(|tick| tick < 30), "{actual_hz} {factor}");
            }
        }
        // An oscillator that may be anything finds little, and that is all.
        for actual_hz in [17_000.0, 47_000.0] {
            for factor in [0.27, 3.4] {
                assert!(found(&F405, actual_hz, 0, factor).is_some());
            }
        }
        assert_eq!(found(&F405, 32_000.0, 0, 1.5), None);
    }

    #[test]
    fn a_clock_that_stands_still_is_found() {
        assert!(found(&G474, 0.0, 0, 1.0).is_some());
    }

    /// A fast counter judges every tick; a narrow tolerance of the gate is not taken from a clock
    /// that drifts.
    #[test]
    fn the_window_is_as_short_as_the_resolution_allows() {
        let fast = IndependentClock {
            nominal_hz: 25_000_000,
            least_hz: 25_000_000,
            most_hz: 25_000_000,
            bits: 32,
        };
        assert_eq!(ClockCheck::new(&fast, RATE_HZ, 0.2).ticks_per_window, 1);
        assert_eq!(ClockCheck::new(&G474, RATE_HZ, 0.2).ticks_per_window, 9);
        assert_eq!(ClockCheck::new(&G474, 20.0, 0.2).ticks_per_window, 1);
        assert_eq!(ClockCheck::new(&G474, 20.0, 0.01).tolerance_1024ths, 102);
    }
}
