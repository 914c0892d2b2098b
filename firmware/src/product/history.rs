//! The history of starts and faults, in RAM that no start-up code touches.

use core::mem::MaybeUninit;
use core::ptr::{read_volatile, write_volatile};
use shared_model::diagnostic::{HISTORY_WORDS, History, Record};

/// Outside `.data` and `.bss`, so it survives a reset.
// SAFETY: without a start value, and any words are some words.
#[unsafe(link_section = ".uninit.history")]
static mut WORDS: MaybeUninit<[u32; HISTORY_WORDS]> = MaybeUninit::uninit();

/// The history; empty after power-on, or if it is damaged.
pub fn read() -> History {
    // SAFETY: any words are some words. Main program and fault handlers use them one after the
    // other: those do not return.
    let words = unsafe { read_volatile((&raw const WORDS).cast()) };
    History::from_words(&words).unwrap_or_default()
}

/// Writes the history.
pub fn write(history: &History) {
    // SAFETY: as in `read`.
    unsafe { write_volatile((&raw mut WORDS).cast(), history.to_words()) };
}

/// Adds a record, for the program after the reset.
pub fn add(record: Record) {
    let mut history = read();
    history.add(Record {
        start: history.starts as u16,
        ..record
    });
    write(&history);
}
