//! Delayed feedback by the ECU in the loop.

use pil::closed_loop::{Run, run};
use pil::ecu::Software;
use pil::feedback::{change_over_period, root_mean_square, torques_nm};
use pil::manoeuvre::{Manoeuvre, from_text, load};
use pil::record::Record;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use shared_model::delayed_feedback::table::{DITHERED, UNDITHERED};
use shared_model::dither::Waveform;
use shared_model::policy::Suppression;
use shared_model::signal::Mode;
use std::path::Path;

fn scenario(duration_s: f64) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.controller.suppression = Suppression::DelayedFeedback;
    scenario.run.duration_s = duration_s;
    scenario
}

fn drive(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Run {
    let mut ecu = Software::new(&ecu_scenario(scenario, manoeuvre)).unwrap();
    let vehicle = VehicleNode::new(scenario, manoeuvre).unwrap();
    run(&mut ecu, vehicle, &mut || {}).unwrap()
}

fn manoeuvre(table: &str) -> Manoeuvre {
    from_text(&format!("[manoeuvre]\nname = \"test\"\n{table}"))
        .unwrap()
        .1
}

fn rms(values: &[f64]) -> f64 {
    root_mean_square(values.iter().copied())
}

/// The last records of a run.
fn last(run: &Run, count: usize) -> &[Record] {
    &run.records[run.records.len() - count..]
}

fn assert_active(run: &Run) {
    let last = run.actuations.last().unwrap().unwrap();
    assert_eq!(last.mode, Mode::Active, "faults {:#x}", last.faults);
}

/// The paper's chaos becomes the orbit, and the torque that remains is that of the PWM's resolution: a count is 0.05
/// N m.
#[test]
fn the_ecu_holds_the_orbit() {
    for (rpm, most_nm) in [(1650.0, 0.1), (1750.0, 0.1), (1850.0, 0.3)] {
        let scenario = scenario(90.0);
        let run = drive(&scenario, &Manoeuvre::constant(rpm, 10.0));
        assert_active(&run);
        let torques_nm = torques_nm(&run.records, &scenario);
        assert!(rms(&torques_nm[..2900]) < 0.03, "before 3 s");
        let greatest_nm = torques_nm.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(greatest_nm <= scenario.controller.feedback_torque_nm + 0.1);
        let rest_nm = rms(&torques_nm[torques_nm.len() - 20_000..]);
        assert!(rest_nm < most_nm, "{rpm} rpm: {rest_nm} N m");
        let period_s = UNDITHERED.at(rpm as f32).unwrap().period_s;
        let ticks = (1000.0 * period_s).round() as usize;
        let change = change_over_period(last(&run, 20_000), ticks);
        assert!(change < 0.03, "{rpm} rpm: {change} rad/s");
        // Without it the same motion is chaotic.
        let mut free = scenario;
        free.controller.suppression = Suppression::None;
        let run = drive(&free, &Manoeuvre::constant(rpm, 10.0));
        let change = change_over_period(last(&run, 20_000), ticks);
        assert!(change > 0.1, "{rpm} rpm without: {change} rad/s");
    }
}

/// Once captured it stays held while the speed changes.
#[test]
fn the_orbit_is_held_through_a_ramp_of_the_speed() {
    let scenario = scenario(140.0);
    let manoeuvre = manoeuvre(
        "wheel_speed_rpm = [[0.0, 1750.0], [60.0, 1750.0], [80.0, 1850.0], [120.0, 1650.0]]
        current_request_a = [[0.0, 10.0]]",
    );
    let run = drive(&scenario, &manoeuvre);
    assert_active(&run);
    let torques_nm = torques_nm(&run.records, &scenario);
    let (ramps, end) = (&torques_nm[60_000..120_000], &torques_nm[130_000..]);
    assert!(rms(ramps) < 1.0, "{} N m", rms(ramps));
    assert!(rms(end) < 0.1, "{} N m", rms(end));
}

/// With the dither beside it the orbit is the dither's, at once.
#[test]
fn both_together_give_the_dithers_orbit() {
    let mut scenario = scenario(20.0);
    scenario.controller.suppression = Suppression::Both;
    scenario.dither.waveform = Waveform::Square;
    let run = drive(&scenario, &Manoeuvre::constant(1750.0, 10.0));
    assert_active(&run);
    let period_s = DITHERED.at(1750.0).unwrap().period_s;
    let ticks = (1000.0 * period_s).round() as usize;
    let change = change_over_period(last(&run, 8_000), ticks);
    assert!(change < 0.02, "{change} rad/s");
    let yaw_rates = run.records[12_000..]
        .iter()
        .map(|r| r.yaw_rate_rad_per_s.abs());
    assert!(yaw_rates.fold(0.0, f64::max) < 1.0);
}

/// Noise, delay and a driver who steers: the ECU stays active and within its limits.
#[test]
fn disturbances_end_in_no_fault() {
    let scenario = scenario(40.0);
    let limit_a = scenario.controller.motor_current_a + 0.1;
    let constant = "wheel_speed_rpm = [[0.0, 1750.0]]\ncurrent_request_a = [[0.0, 10.0]]\n";
    let noisy = manoeuvre(&format!(
        "{constant}[manoeuvre.sensors.noise]\nyaw_rate_rad_per_s = 0.02"
    ));
    let late = manoeuvre(&format!("{constant}[manoeuvre.sensors]\ndelay_ticks = 2"));
    let steering = manoeuvre(
        "wheel_speed_rpm = [[0.0, 1750.0]]
        current_request_a = [[0.0, 10.0], [10.0, 10.0], [10.001, 14.0], [20.0, 14.0], [20.001, 8.0]]",
    );
    for manoeuvre in [noisy, late, steering] {
        let run = drive(&scenario, &manoeuvre);
        assert_active(&run);
        assert!(
            run.records
                .iter()
                .all(|r| r.motor_current_a.abs() <= limit_a)
        );
    }
}

/// Ramps of the speed, a driver who steers, noise, and delay: active, without a fault, over the whole manoeuvre.
#[test]
fn every_manoeuvre_ends_in_no_fault() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/manoeuvres");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let (mut scenario, manoeuvre) = load(&entry.path()).unwrap();
        for (suppression, waveform) in [
            (Suppression::Both, Waveform::Square),
            (Suppression::DelayedFeedback, Waveform::None),
        ] {
            scenario.controller.suppression = suppression;
            scenario.dither.waveform = waveform;
            let run = drive(&scenario, &manoeuvre);
            let last = run.actuations.last().unwrap().unwrap();
            let found = (last.mode, last.faults);
            let name = &manoeuvre.name;
            assert_eq!(found, (Mode::Active, 0), "{name}, {suppression:?}");
        }
        files += 1;
    }
    assert!(files >= 8, "{files} manoeuvres");
}

/// The orbit is that of one torque of the motor: at another request there is no torque of the feedback.
#[test]
fn a_request_unlike_the_tables_ends_the_feedback() {
    let scenario = scenario(30.0);
    let manoeuvre = manoeuvre(
        "wheel_speed_rpm = [[0.0, 1750.0]]
        current_request_a = [[0.0, 10.0], [10.0, 10.0], [10.001, 12.0], [20.0, 12.0], [20.001, 10.0]]",
    );
    let run = drive(&scenario, &manoeuvre);
    assert_active(&run);
    let torques_nm = torques_nm(&run.records, &scenario);
    for (from_s, to_s, is_on) in [(4, 10, true), (11, 20, false), (22, 30, true)] {
        let greatest_nm = torques_nm[1000 * from_s..1000 * to_s]
            .iter()
            .fold(0.0, |greatest: f64, torque_nm| {
                greatest.max(torque_nm.abs())
            });
        assert_eq!(greatest_nm > 0.3, is_on, "{from_s} s: {greatest_nm} N m");
    }
}

/// A condition of the table of robustness: its name, a manoeuvre's settings, and factors of the vehicle's numbers.
type Condition = (&'static str, &'static str, &'static [(&'static str, f64)]);

const CONDITIONS: [Condition; 21] = [
    ("none", "", &[]),
    (
        "noise 0.001 rad/s",
        "[manoeuvre.sensors.noise]\nyaw_rate_rad_per_s = 0.001",
        &[],
    ),
    (
        "noise 0.01 rad/s",
        "[manoeuvre.sensors.noise]\nyaw_rate_rad_per_s = 0.01",
        &[],
    ),
    (
        "noise 0.02 rad/s",
        "[manoeuvre.sensors.noise]\nyaw_rate_rad_per_s = 0.02",
        &[],
    ),
    (
        "resolution 0.01 rad/s",
        "[manoeuvre.sensors.resolution]\nyaw_rate_rad_per_s = 0.01",
        &[],
    ),
    ("one tick late", "[manoeuvre.sensors]\ndelay_ticks = 1", &[]),
    (
        "two ticks late",
        "[manoeuvre.sensors]\ndelay_ticks = 2",
        &[],
    ),
    ("mass -10 %", "", &[("vehicle.mass_kg", 0.9)]),
    ("mass -5 %", "", &[("vehicle.mass_kg", 0.95)]),
    ("mass +5 %", "", &[("vehicle.mass_kg", 1.05)]),
    ("mass +10 %", "", &[("vehicle.mass_kg", 1.1)]),
    (
        "yaw inertia -10 %",
        "",
        &[("vehicle.yaw_inertia_kg_m2", 0.9)],
    ),
    (
        "yaw inertia +10 %",
        "",
        &[("vehicle.yaw_inertia_kg_m2", 1.1)],
    ),
    ("friction -20 %", "", &[("friction.coefficient", 0.8)]),
    ("friction +20 %", "", &[("friction.coefficient", 1.2)]),
    (
        "front tyre's peak -10 %",
        "",
        &[("tires.front.peak_n", 0.9)],
    ),
    (
        "front tyre's peak +10 %",
        "",
        &[("tires.front.peak_n", 1.1)],
    ),
    (
        "both tyres' peaks -20 %",
        "",
        &[("tires.front.peak_n", 0.8), ("tires.rear.peak_n", 0.8)],
    ),
    (
        "both tyres' peaks -10 %",
        "",
        &[("tires.front.peak_n", 0.9), ("tires.rear.peak_n", 0.9)],
    ),
    (
        "both tyres' peaks +10 %",
        "",
        &[("tires.front.peak_n", 1.1), ("tires.rear.peak_n", 1.1)],
    ),
    (
        "both tyres' peaks +20 %",
        "",
        &[("tires.front.peak_n", 1.2), ("tires.rear.peak_n", 1.2)],
    ),
];

/// The table of docs/feedback.md: `cargo test --release -p dithersteer-pil --test feedback -- --ignored --nocapture`.
#[test]
#[ignore = "a table of two minutes"]
fn robustness() {
    let settings = [
        ("as it is", Suppression::DelayedFeedback, 1e-3),
        (
            "adapting five times as fast",
            Suppression::DelayedFeedback,
            5e-3,
        ),
        ("without", Suppression::None, 1e-3),
    ];
    for (what, suppression, adaptation) in settings {
        println!("{what}: torque in the last 20 s of 200, N m rms, from four starts");
        for (condition, sensors, factors) in CONDITIONS {
            let line = "wheel_speed_rpm = [[0.0, 1750.0]]\ncurrent_request_a = [[0.0, 10.0]]\n";
            let manoeuvre = manoeuvre(&format!("{line}{sensors}"));
            let of_start = |start: i32| {
                let mut scenario = scenario(200.0);
                scenario.controller.suppression = suppression;
                scenario.controller.feedback_adaptation_s3_per_rad2 = adaptation;
                scenario.run.yaw_rate_rad_per_s = 0.1 * f64::from(start);
                for &(key, factor) in factors {
                    *scenario.number(key).unwrap() *= factor;
                }
                let run = drive(&scenario, &manoeuvre);
                assert_active(&run);
                let torques_nm = torques_nm(&run.records, &scenario);
                let yaw_rates = run.records[180_000..].iter().map(|r| r.yaw_rate_rad_per_s);
                let swing =
                    yaw_rates.clone().fold(f64::MIN, f64::max) - yaw_rates.fold(f64::MAX, f64::min);
                format!("{:.3} ({swing:.2} rad/s)", rms(&torques_nm[180_000..]))
            };
            let cells: Vec<String> = (0..4).map(of_start).collect();
            println!("| {condition} | {} |", cells.join(" | "));
        }
    }
}

/// The sentence on the speeds in docs/feedback.md, by the same command.
#[test]
#[ignore = "a table of a minute"]
fn speeds() {
    for adaptation in [1e-3, 5e-3] {
        println!(
            "adapting at {adaptation}: torque in the last 20 s of 150, N m rms and peak, from six starts"
        );
        for rpm in [
            1650.0, 1700.0, 1750.0, 1800.0, 1850.0, 1900.0, 1950.0, 1980.0,
        ] {
            let of_start = |start: i32| {
                let mut scenario = scenario(150.0);
                scenario.controller.feedback_adaptation_s3_per_rad2 = adaptation;
                scenario.run.yaw_rate_rad_per_s = 0.1 * f64::from(start);
                let run = drive(&scenario, &Manoeuvre::constant(rpm, 10.0));
                assert_active(&run);
                let torques_nm = torques_nm(last(&run, 20_000), &scenario);
                let peak_nm = torques_nm.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
                format!("{:.3} ({peak_nm:.1})", rms(&torques_nm))
            };
            let cells: Vec<String> = (0..6).map(of_start).collect();
            println!("| {rpm} rpm | {} |", cells.join(" | "));
        }
    }
}
