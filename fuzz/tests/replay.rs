//! The corpus, and mutations of it that are the same every time: no panic, no more memory than a
//! multiple of the input.

use fastrand::Rng;
use fuzz::mutate::mutate;
use fuzz::{TARGETS, Target};
use std::fs;
use std::path::Path;

/// Longest input that mutations make.
const LONGEST: usize = 1 << 16;

/// The target's files in the corpus, and its seeds.
fn inputs(target: &Target) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target.name);
    let files =
        fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    let kept = paths.iter().map(|path| fs::read(path).unwrap());
    kept.chain((target.seeds)()).collect()
}

fn run(target: &Target) {
    let inputs = inputs(target);
    for input in &inputs {
        target.check(input);
        let mut repaired = input.clone();
        (target.repair)(&mut repaired);
        target.check(&repaired);
    }
    let mut rng = Rng::with_seed(0x00D1_7E55);
    let mut input = Vec::new();
    for k in 0..target.mutations {
        // Mutations of mutations go further; a fresh start every now and then.
        if k % 16 == 0 || input.len() > LONGEST {
            input.clone_from(&inputs[rng.usize(..inputs.len())]);
        }
        let other = &inputs[rng.usize(..inputs.len())];
        mutate(target, &mut rng, &mut input, other);
        let passed = target.passes(&input);
        assert!(
            passed,
            "{}: mutation {k} fails: {}",
            target.name,
            hex(&input)
        );
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

macro_rules! replays {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            run(Target::find(stringify!($name)).expect("there is such a target"));
        })*

        #[test]
        fn no_target_is_left_out() {
            let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

replays! {
    telemetry recording tile configuration manoeuvre record settings serial frames elf log
}

/// The counted memory is the reader's.
#[test]
fn a_reader_that_takes_too_much_is_found() {
    let greedy = Target {
        read: |bytes| drop(std::hint::black_box(vec![0_u8; 10 * bytes.len()])),
        multiple: 9,
        ..Target::find("serial").map(|t| Target { ..*t }).unwrap()
    };
    assert!(greedy.passes(&[0; 100]));
    assert!(!greedy.passes(&vec![0; 1 << 20]));
}

/// Mutations of seeds get past the check sums.
#[test]
fn repaired_inputs_are_read() {
    for (name, is_read) in [
        (
            "telemetry",
            (|b| qemu::telemetry::Recording::decode(b).is_ok()) as fn(&[u8]) -> bool,
        ),
        ("recording", |b| pil::recording::Recording::read(b).is_ok()),
        ("tile", |b| {
            dynamics::map::tiles::parsed(std::str::from_utf8(b).unwrap()).is_ok()
        }),
    ] {
        let target = Target::find(name).unwrap();
        let seed = &(target.seeds)()[0];
        assert!(is_read(seed), "{name}");
        // A digit of the last row, or a bit of the last record, with the check sum left as it was
        // and made right.
        let mut changed = seed.clone();
        let at = changed.len() - 40;
        let digit = changed[at..]
            .iter()
            .position(u8::is_ascii_digit)
            .unwrap_or(0);
        changed[at + digit] ^= 1;
        assert!(!is_read(&changed), "{name}");
        (target.repair)(&mut changed);
        assert!(is_read(&changed), "{name}");
    }
}
