//! libFuzzer on one target, which the environment names with the folder where its seeds are to go.

#![no_main]

use fuzz::{TARGETS, Target};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use std::path::Path;
use std::sync::LazyLock;

/// Variable of the environment with the target's name.
const NAME: &str = "FUZZ_TARGET";
/// Variable with the folder.
const SEEDS: &str = "FUZZ_SEEDS";

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var(NAME).unwrap_or_default();
    Target::find(&name).unwrap_or_else(|| {
        let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
        panic!("{NAME}={name}: must be one of {}", names.join(", "))
    })
});

/// Writes the seeds, from which the search begins.
fn write_seeds() {
    let seeds = (TARGET.seeds)();
    if let Some(folder) = std::env::var_os(SEEDS) {
        for (k, seed) in seeds.iter().enumerate() {
            let path = Path::new(&folder).join(format!("seed-{k}"));
            std::fs::write(path, seed).expect("the folder of the seeds can be written");
        }
    }
}

fuzz_target!(
    init: {
        // A panic that the reader itself catches is none; any other comes to the driver, which ends with it.
        drop(std::panic::take_hook());
        std::panic::set_hook(Box::new(|_| ()));
        write_seeds();
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
