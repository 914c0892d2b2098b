//! No false alarm: the ECU's program in the loop on clean drives, and the gate finds nothing. The
//! test in every run takes a million control ticks; ten million take minutes: `cargo test --release
//! -p sim-host --test clean_ticks -- --ignored`.

use pil::ecu::{Ecu, Software};
use pil::manoeuvre::{Manoeuvre, load};
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::gate::Faults;
use shared_model::signal::Mode;
use std::path::Path;

const WAVEFORMS: [Waveform; 3] = [Waveform::None, Waveform::Square, Waveform::Sine];

/// The files' manoeuvres, and constant speeds from rest to the fastest chaos, each waveform,
/// requests to both sides.
fn drives() -> Vec<(Scenario<f64>, Manoeuvre)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/manoeuvres");
    let files = folder.read_dir().expect("the examples are there");
    let mut drives: Vec<_> = files
        .map(|file| load(&file.expect("readable").path()).expect("valid"))
        .collect();
    // The same in every run, whatever the order of the folder.
    drives.sort_by(|a, b| a.1.name.cmp(&b.1.name));
    for rpm in (1200..=1950).step_by(50) {
        for (waveform, request_a) in WAVEFORMS.into_iter().zip([10.0, -12.0, 14.0]) {
            let mut scenario = Scenario::reconstruction();
            scenario.dither.waveform = waveform;
            let manoeuvre = Manoeuvre::constant(f64::from(rpm), request_a);
            drives.push((manoeuvre.begin(&scenario), manoeuvre));
        }
    }
    drives
}

/// Drives once; returns the control ticks.
fn drive(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> u64 {
    let mut vehicle = VehicleNode::new(scenario, manoeuvre).expect("valid");
    let mut ecu = Software::new(&ecu_scenario(scenario, manoeuvre)).expect("valid");
    let periods = vehicle.total_periods();
    for _ in 0..periods {
        let answered = ecu.period(&mut |packet| vehicle.answer(packet));
        answered.expect("the host's own program is always there");
    }
    // Every fault is latched, so its last word tells of all ticks.
    let actuation = vehicle.actuation().expect("the ECU talks");
    let faults: Vec<_> = Faults::from_bits(actuation.faults)
        .iter()
        .map(|fault| fault.name())
        .collect();
    assert!(faults.is_empty(), "{faults:?} in {manoeuvre:?}");
    assert_eq!(actuation.mode, Mode::Active, "{manoeuvre:?}");
    u64::from(periods / scenario.periods_per_tick())
}

/// Runs all loops repeatedly, with different noise each time, until the number of ticks is reached.
fn assert_no_false_alarm(least_ticks: u64) {
    let drives = drives();
    let noisy = drives
        .iter()
        .map(|(_, manoeuvre)| manoeuvre.sensors)
        .find(|sensors| sensors.noise.yaw_rate_rad_per_s > 0.0)
        .expect("one of the files has noise");
    let mut ticks = 0;
    for seed in 0.. {
        let round = drives.clone().into_par_iter();
        ticks += round
            .map(|(scenario, mut manoeuvre)| {
                // The first round is as the files have it.
                if seed > 0 {
                    let delay_ticks = manoeuvre.sensors.delay_ticks;
                    manoeuvre.sensors = noisy;
                    manoeuvre.sensors.delay_ticks = delay_ticks;
                    manoeuvre.sensors.seed = seed;
                }
                drive(&scenario, &manoeuvre)
            })
            .sum::<u64>();
        if ticks >= least_ticks {
            break;
        }
    }
    println!("{ticks} control ticks");
}

#[test]
fn no_false_alarm_in_a_million_ticks() {
    assert_no_false_alarm(1_000_000);
}

#[test]
#[ignore = "takes minutes"]
fn no_false_alarm_in_ten_million_ticks() {
    assert_no_false_alarm(10_000_000);
}
