//! Instructions of the host's integrator, counted by callgrind, so that a slower engine shows
//! without a clock.

use engine::taylor::{Ensemble, Observables, Span};
use shared_model::Scenario;
use shared_model::friction::FrictionLaw;
use std::process::Command;
use tests::golden::{Figure, check_figures};

/// Counts instructions; runs AVX2 code, but no AVX-512.
const COUNTER: &str = "valgrind";
/// Length of the motions, s.
const TIME_S: f64 = 20.0;

/// 16 motions from 1600 to 1900 rpm.
fn motions(law: FrictionLaw) -> Ensemble {
    let scenario = |k: u32| {
        let mut scenario = Scenario::reconstruction();
        scenario.friction.law = law;
        scenario.run.wheel_speed_rpm = 1600.0 + 20.0 * f64::from(k);
        scenario
    };
    let scenarios: Vec<_> = (0..16).map(scenario).collect();
    Ensemble::new(&scenarios).expect("all fit")
}

fn span(yaw_rate_turns: bool) -> Span {
    Span {
        time_s: TIME_S,
        tolerance: 1e-10,
        observables: Observables {
            turns: [false, yaw_rate_turns, false, false],
            section: None,
        },
        warm_up_s: 2.0,
        segments: 4,
    }
}

// The counted work: each runs alone in a process of its own.

#[test]
#[ignore = "counted by the test below"]
fn nothing() {
    motions(FrictionLaw::None);
}

#[test]
#[ignore = "counted by the test below"]
fn states() {
    motions(FrictionLaw::None).integrate::<0>(&span(false));
}

#[test]
#[ignore = "counted by the test below"]
fn states_and_turns() {
    motions(FrictionLaw::None).integrate::<0>(&span(true));
}

#[test]
#[ignore = "counted by the test below"]
fn largest_exponent() {
    motions(FrictionLaw::None).integrate::<1>(&span(false));
}

#[test]
#[ignore = "counted by the test below"]
fn spectrum() {
    motions(FrictionLaw::None).integrate::<4>(&span(false));
}

#[test]
#[ignore = "counted by the test below"]
fn friction() {
    motions(FrictionLaw::CoulombRate).integrate::<0>(&span(false));
}

/// Instructions of this program when it runs one of the above.
fn instructions(test: &str) -> u64 {
    let program = std::env::current_exe().expect("a test has its program's path");
    let output = Command::new(COUNTER)
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["--ignored", "--exact", test, "--test-threads=1"])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .expect("it was there a moment ago");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{messages}");
    let line = messages.lines().find(|line| line.contains("Collected : "));
    let count = line.and_then(|line| line.split("Collected : ").nth(1));
    let count = count.and_then(|digits| digits.trim().parse().ok());
    count.unwrap_or_else(|| panic!("no count in: {messages}"))
}

fn version(program: &str) -> Option<String> {
    let output = Command::new(program).arg("--version").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    text.lines().next().map(str::to_owned)
}

#[test]
fn the_engine_takes_no_more_instructions() {
    let Some(counter) = version(COUNTER) else {
        println!("untested: {COUNTER} is not installed");
        return;
    };
    let overhead = instructions("nothing");
    let names = [
        "states",
        "states_and_turns",
        "largest_exponent",
        "spectrum",
        "friction",
    ];
    let figures = names.map(|name| {
        let thousands = (instructions(name) - overhead) as f64 / 1e3;
        let a_motion_second = (thousands / (16.0 * TIME_S) * 100.0).round() / 100.0;
        Figure::new(name, a_motion_second, "thousands")
    });
    for figure in &figures {
        println!("{:20} {:>8} {}", figure.name, figure.value, figure.unit);
    }
    let about = "Instructions of the Taylor engine for one second of one motion, in thousands, with AVX2 under valgrind.";
    let rust = version("rustc").unwrap_or_default();
    check_figures("engine.txt", about, &format!("{rust}; {counter}"), &figures);
}
