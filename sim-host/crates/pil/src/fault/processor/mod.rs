//! Faults of the ECU's processor: memory bits, interrupts, stack, watchdog and reset of the
//! firmware in QEMU, through its gdb stub. The same fault at the same tick gives the same run.

mod addresses;
mod bench;
mod debugger;

pub use bench::{BENCH_TICKS, Bench, FaultyRun};
