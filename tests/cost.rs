//! Cost of Rust on the target: the model's step and the ECU program's tasks beside the C reference,
//! whose bits are equal.

use qemu::Machine;
use std::collections::BTreeMap;
use std::process::Command;
use tests::golden::{Figure, check_figures};
use tests::{TIME_OUT, image, run};

/// The image's build uses the same; `cargo xtask target-cost` prints how to install it.
const C_COMPILER: &str = "arm-none-eabi-gcc";
const IMAGE: &str = "c-reference";
/// Instructions of a call.
type Counted = BTreeMap<String, u32>;

/// Scenarios whose instructions are compared.
const MEASURED: [(&str, &str); 4] = [
    ("none", ""),
    (
        "square",
        "dither.waveform=square dither.amplitude_v=0.1 dither.start_time_s=0.2",
    ),
    (
        "sine",
        "dither.waveform=sine dither.amplitude_v=1.0 dither.start_time_s=0.2",
    ),
    (
        "feedback",
        "controller.suppression=delayed_feedback dither.start_time_s=0.2",
    ),
];
/// The model's alternatives, most of which spend their time in the same library: only bits are
/// compared.
const ALTERNATIVES: [&str; 3] = [
    "preset=printed dither.waveform=sine dither.amplitude_v=1.0",
    "friction.dithered=true dither.waveform=square dither.amplitude_v=0.1",
    "tires.model=magic_formula vehicle.slip_form=exact",
];

fn c_compiler() -> Option<String> {
    let output = Command::new(C_COMPILER).arg("--version").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    text.lines().next().map(str::to_owned)
}

/// The image's counts, by function and language; its exit code is 0 only if all bits were equal.
fn count(settings: &str) -> BTreeMap<(String, String), Counted> {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let words = settings.split_whitespace().map(str::to_owned);
    let words: Vec<String> = words.collect();
    let machine = Machine::Mps2An386;
    let finished = run(&image(IMAGE), machine, &words, folder.path(), TIME_OUT)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(finished.exit_code, 0, "{settings}: {:#?}", finished.log);
    finished.log.iter().filter_map(|line| cost(line)).collect()
}

/// `... cost FUNCTION LANGUAGE name number name number ...`
fn cost(line: &str) -> Option<((String, String), Counted)> {
    let (_, figures) = line.split_once(" cost ")?;
    let mut words = figures.split_whitespace();
    let call = (words.next()?.to_owned(), words.next()?.to_owned());
    let mut counted = Counted::new();
    while let (Some(name), Some(number)) = (words.next(), words.next()) {
        counted.insert(name.to_owned(), number.parse().ok()?);
    }
    Some((call, counted))
}

#[test]
fn rust_takes_no_more_instructions_than_c() {
    let Some(c_compiler) = c_compiler() else {
        println!("untested: {C_COMPILER} is not installed");
        return;
    };
    let mut figures = Vec::new();
    for (name, settings) in MEASURED {
        let counted = count(settings);
        for function in ["model-step", "pwm-period", "control-tick"] {
            let of = |language: &str| &counted[&(function.to_owned(), language.to_owned())];
            let (rust, c) = (of("rust"), of("c"));
            assert!(rust["calls"] >= 1000 && rust["calls"] == c["calls"]);
            let mut worst_ratio = 0.0_f64;
            for what in ["median", "mean", "most"] {
                let mut figure = |language: &str, value: u32| {
                    let name = format!("{name}/{function}/{language}-{what}");
                    figures.push(Figure::new(name, value, "instr"));
                };
                figure("rust", rust[what]);
                figure("c", c[what]);
                worst_ratio = worst_ratio.max(f64::from(rust[what]) / f64::from(c[what]));
            }
            let percent = (1000.0 * worst_ratio).round() / 10.0;
            let ratio = Figure::new(format!("{name}/{function}/rust-of-c"), percent, "%");
            figures.push(ratio.at_most(100.0));
        }
    }
    for figure in &figures {
        println!("{:36} {:>6} {}", figure.name, figure.value, figure.unit);
    }
    let about = "Instructions (no cycles) of a call on the board mps2: Rust, the same in C, and the greatest of the three ratios.\n\
         Scenarios: no dither, square wave, sine. docs/cost.md describes the count.";
    let compilers = format!("{}; {c_compiler}", image(IMAGE).compiler);
    check_figures("cost.txt", about, &compilers, &figures);
}

#[test]
fn every_alternative_of_the_model_has_the_bits_of_c() {
    if c_compiler().is_none() {
        println!("untested: {C_COMPILER} is not installed");
        return;
    }
    for settings in ALTERNATIVES {
        count(settings);
    }
}
