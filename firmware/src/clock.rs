//! Time since the start, by the PWM's samples.

use core::sync::atomic::{AtomicU32, Ordering};

static SAMPLES: AtomicU32 = AtomicU32::new(0);
static SAMPLES_PER_MS: AtomicU32 = AtomicU32::new(1);

/// Sets the number of samples per millisecond; at least 1 is assumed.
pub fn set_rate(samples_per_ms: u32) {
    SAMPLES_PER_MS.store(samples_per_ms.max(1), Ordering::Relaxed);
}

/// Counts a sample and returns its index, from 0.
pub fn count_sample() -> u32 {
    SAMPLES.fetch_add(1, Ordering::Relaxed)
}

/// Time since the start, ms.
pub fn elapsed_ms() -> u32 {
    SAMPLES.load(Ordering::Relaxed) / SAMPLES_PER_MS.load(Ordering::Relaxed).max(1)
}

defmt::timestamp!("{=u32:ms}", elapsed_ms());
