//! libFuzzer on one target, which the environment names.

#![no_main]

use fuzz::{TARGETS, Target};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use std::sync::LazyLock;

/// Variable of the environment with the target's name.
const NAME: &str = "FUZZ_TARGET";

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var(NAME).unwrap_or_default();
    Target::find(&name).unwrap_or_else(|| {
        let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
        panic!("{NAME}={name}: must be one of {}", names.join(", "))
    })
});

fuzz_target!(
    init: {
        // A panic that the reader itself catches is none; any other comes to the driver, which ends with it.
        drop(std::panic::take_hook());
        std::panic::set_hook(Box::new(|_| ()));
        LazyLock::force(&TARGET);
    },
    |bytes: &[u8]| {
        if !TARGET.passes(bytes) {
            eprintln!("{} fails", TARGET.name);
            std::process::abort();
        }
    }
);

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    let size = fuzzer_mutate(data, size, max_size);
    // Some stay as they are, so that damage is tried too.
    if seed % 8 == 0 {
        return size;
    }
    let mut repaired = data[..size].to_vec();
    (TARGET.repair)(&mut repaired);
    let size = repaired.len().min(max_size);
    data[..size].copy_from_slice(&repaired[..size]);
    size
});
