//! Failures of the links between vehicle and ECU.

use dynamics::words::counted;
use std::fmt;

/// Failure of a link, for each frame while the fault lasts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkFailure {
    /// This bit is flipped.
    Corruption {
        /// Number of the bit.
        bit: u16,
    },
    /// The last frame before the fault is repeated.
    Repetition,
    /// Frames are lost.
    Loss,
    /// Of each three frames two are lost.
    TwoOfThreeLost,
    /// Frames are late by this number of control ticks.
    Delay {
        /// Control ticks.
        ticks: usize,
    },
    /// Frames are ever later: by one more control tick after each interval of this number.
    GrowingDelay {
        /// Control ticks.
        interval_ticks: usize,
    },
    /// The last frames before the fault in an endless loop.
    Replay {
        /// Number of frames.
        frames: usize,
    },
    /// An old frame replaces the new one.
    Insertion {
        /// Its age, control ticks.
        age_ticks: usize,
    },
    /// A frame of another sender: intact, but with another data ID.
    Masquerade,
    /// Intact frames whose counter is ahead by this.
    WrongSequence {
        /// Counts.
        ahead: u8,
    },
}

impl LinkFailure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Corruption { .. } => "sensor frame corrupted",
            Self::Repetition => "sensor frame repeated",
            Self::Loss | Self::TwoOfThreeLost => "sensor frame lost",
            Self::Delay { .. } | Self::GrowingDelay { .. } => "sensor frame late",
            Self::Replay { .. } => "sensor frames replayed",
            Self::Insertion { .. } => "sensor frame inserted",
            Self::Masquerade => "sensor frame masqueraded",
            Self::WrongSequence { .. } => "sensor frame out of sequence",
        }
    }
}

impl fmt::Display for LinkFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Corruption { bit } => write!(f, "bit {bit} flipped"),
            Self::Repetition => write!(f, "repeated"),
            Self::Loss => write!(f, "lost"),
            Self::TwoOfThreeLost => write!(f, "two of three lost"),
            Self::Delay { ticks } => write!(f, "late by {ticks}"),
            Self::GrowingDelay { interval_ticks } => {
                write!(
                    f,
                    "later by 1 after each {}",
                    counted(interval_ticks, "tick")
                )
            }
            Self::Replay { frames } => write!(f, "last {frames} in a loop"),
            Self::Insertion { age_ticks } => write!(f, "{} old", counted(age_ticks, "tick")),
            Self::Masquerade => write!(f, "of another sender"),
            Self::WrongSequence { ahead } => write!(f, "counter ahead by {ahead}"),
        }
    }
}

/// The failures of a link, with their duration in control ticks; `None` if permanent.
pub(super) fn all() -> Vec<(LinkFailure, Option<u32>)> {
    use LinkFailure::{
        Corruption, Delay, GrowingDelay, Insertion, Loss, Masquerade, Repetition, Replay,
        TwoOfThreeLost, WrongSequence,
    };
    let mut failures = Vec::new();
    let mut add = |failure, ticks: &[Option<u32>]| {
        failures.extend(ticks.iter().map(|&ticks| (failure, ticks)));
    };
    for bit in [0, 9, 18, 30, 77, 128, 191] {
        add(Corruption { bit }, &[Some(1)]);
    }
    add(Corruption { bit: 77 }, &[None]);
    add(Repetition, &[Some(1), Some(5), None]);
    add(Loss, &[1, 2, 3].map(Some));
    add(Loss, &[Some(8), Some(12), None]);
    add(TwoOfThreeLost, &[None]);
    for ticks in [1, 3, 20] {
        add(Delay { ticks }, &[None]);
    }
    add(GrowingDelay { interval_ticks: 8 }, &[None]);
    add(Replay { frames: 256 }, &[None]);
    for age_ticks in [2, 50, 256] {
        add(Insertion { age_ticks }, &[Some(1)]);
    }
    add(Masquerade, &[Some(1), None]);
    for ahead in [3, 100, 255] {
        add(WrongSequence { ahead }, &[Some(1), None]);
    }
    failures
}
