//! Faults between vehicle and ECU and in its interrupts, with the ECU's program on this host.

use pil::drive::{Drive, ecu_scenario};
use pil::ecu::{Ecu, Software};
use pil::fault::campaign::{Clean, Row, inject, totals};
use pil::fault::catalogue::{self, Class, Fault, Kind, SensorFailure, Signal};
use pil::fault::injector::Injector;
use pil::fault::judge::{Finder, Judge, Reaction, Verdict};
use pil::fault::tasks::Tasks;
use pil::fault::{accepted, manoeuvres};
use pil::manoeuvre::Manoeuvre;
use shared_model::Scenario;
use shared_model::exchange::Packet;
use shared_model::gate::Fault as GateFault;

/// Settled under the dither.
const TIME_S: f64 = 9.0;
const CONSTANT_SPEED: &str = "constant speed, square dither";

fn manoeuvre(name: &str) -> (Scenario<f64>, Manoeuvre) {
    let all = manoeuvres::all().expect("the files are valid");
    let found = all
        .into_iter()
        .find(|(_, manoeuvre)| manoeuvre.name == name);
    found.unwrap_or_else(|| panic!("no manoeuvre {name}"))
}

fn rows(names: &[&str], faults: &[Fault]) -> Vec<Row> {
    let cleans: Vec<Clean> = names
        .iter()
        .map(|name| {
            let (scenario, manoeuvre) = manoeuvre(name);
            Clean::drive(&scenario, &manoeuvre, &[TIME_S]).expect("it is valid")
        })
        .collect();
    inject(&cleans, faults, || {}).expect("nobody interrupts")
}

fn nan() -> Fault {
    Fault {
        kind: Kind::Sensor(Signal::YawRate, SensorFailure::NotANumber),
        ticks: None,
    }
}

#[test]
fn no_silent_fault_outside_the_list() {
    let faults = catalogue::all();
    let rows = rows(&[CONSTANT_SPEED, "speed ramp"], &faults);
    assert_eq!(rows.len(), 2 * faults.len());
    let unlisted: Vec<&Row> = rows.iter().filter(|row| row.is_unlisted()).collect();
    assert!(unlisted.is_empty(), "{unlisted:#?}");
    let totals = totals(&rows);
    for class in [
        Class::Sensor,
        Class::Link,
        Class::Timing,
        Class::Actuator,
        Class::Processor,
    ] {
        assert!(totals[&class].detected > 0, "{class:?}");
    }
    // What no sensor can give is found at once, everywhere.
    let impossible = [
        "sensor NaN",
        "sensor infinite",
        "sensor subnormal",
        "sensor out of range",
    ];
    for row in rows
        .iter()
        .filter(|row| impossible.contains(&row.kind.as_str()))
    {
        assert_eq!(
            (row.verdict, row.latency_ticks),
            (Verdict::Detected, Some(1)),
            "{row:?}"
        );
    }
    // The list is no blank cheque: its entries are met, and most faults are not on it.
    let listed = rows.iter().filter(|row| row.accepted.is_some()).count();
    assert!(
        listed > 0 && 3 * listed < rows.len(),
        "{listed} of {}",
        rows.len()
    );
    assert_eq!(accepted::reason(&nan()), None);
}

/// The program with interrupts that can fail is the program, and without a fault nothing is found.
#[test]
fn without_a_fault_nothing_is_found() {
    let (mut scenario, manoeuvre) = manoeuvre("low resolution and noise");
    scenario.run.duration_s = 5.0;
    let own = ecu_scenario(&scenario, &manoeuvre);
    let mut software = Software::new(&own).expect("it is valid");
    let mut tasks = Tasks::new(&own).expect("it is valid");
    let mut drive = Drive::new(&scenario, &manoeuvre).expect("it is valid");
    let mut twin = drive.clone();
    let mut between = Injector::new(&scenario);
    // Behind the first frames, which start everything.
    let first_tick = 10;
    let mut judge = Judge::new(scenario.periods_per_tick(), first_tick);
    for _ in 0..drive.total_periods() {
        let (mut a, mut b) = (None, None);
        let told = software.period(&mut |sent| {
            a = Some(*sent);
            drive.answer(sent)
        });
        told.expect("a program on the host is always reached");
        tasks.period(&mut |sent| {
            b = Some(*sent);
            twin.answer_through(&mut between, sent)
        });
        assert_eq!(a, b);
        if twin.periods() > first_tick * scenario.periods_per_tick() {
            judge.look(&b.unwrap(), &a.unwrap(), &twin);
        }
    }
    let outcome = judge.conclude(between.stays_wrong());
    assert_eq!(
        (outcome.verdict, outcome.finding),
        (Verdict::Harmless, None)
    );
    assert!(outcome.peaks.steering_angle_rad > 0.1);
}

/// One count of duty that differs and is nowhere told is a silent fault.
#[test]
fn a_planted_silent_fault_is_found() {
    let (scenario, manoeuvre) = manoeuvre(CONSTANT_SPEED);
    let mut drive = Drive::new(&scenario, &manoeuvre).expect("it is valid");
    let clean = Packet {
        duty_code: 1250,
        frame: None,
    };
    drive.answer(&clean);
    let mut judge = Judge::new(scenario.periods_per_tick(), 0);
    // The vehicle has no frame yet, which is not this test's subject.
    let mut tasks = Tasks::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    for _ in 0..25 {
        tasks.period(&mut |sent| drive.answer(sent));
    }
    assert!(drive.actuation().is_some());
    judge.look(&clean, &clean, &drive);
    assert_eq!(judge.conclude(false).verdict, Verdict::Harmless);
    assert_eq!(judge.conclude(true).verdict, Verdict::Silent);
    let off = Packet {
        duty_code: 1251,
        ..clean
    };
    judge.look(&off, &clean, &drive);
    assert_eq!(judge.conclude(false).verdict, Verdict::Silent);
}

/// In the safe state the chaos comes back, unless the vehicle slows down as it is asked to.
#[test]
fn behind_the_safe_state_a_vehicle_that_obeys_calms_down() {
    let heedless = last_swing_rad_per_s(CONSTANT_SPEED);
    let obeying = last_swing_rad_per_s("obeyed speed limit");
    println!("swing of the yaw rate: {heedless} rad/s heedless, {obeying} rad/s obeying");
    assert!(heedless > 0.5, "{heedless}");
    assert!(obeying < 1e-3, "{obeying}");
}

/// Drives into a fault and gives the swing of the yaw rate in the last two seconds.
fn last_swing_rad_per_s(name: &str) -> f64 {
    let (scenario, manoeuvre) = manoeuvre(name);
    let mut tasks = Tasks::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    let mut drive = Drive::new(&scenario, &manoeuvre).expect("it is valid");
    let mut between = Injector::new(&scenario);
    let mut judge = Judge::new(scenario.periods_per_tick(), 0);
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut is_on = false;
    for _ in 0..drive.total_periods() {
        if !is_on && drive.plant().time_s() >= TIME_S {
            between.begin(nan());
            is_on = true;
        }
        let mut put_out = None;
        tasks.period(&mut |sent| {
            put_out = Some(*sent);
            drive.answer_through(&mut between, sent)
        });
        let put_out = put_out.expect("a duty in every period");
        if is_on {
            judge.look(&put_out, &put_out, &drive);
        }
        if drive.plant().time_s() > scenario.run.duration_s - 2.0 {
            let yaw_rate = drive.plant().truth().yaw_rate_rad_per_s;
            (least, greatest) = (yaw_rate.min(least), yaw_rate.max(greatest));
        }
    }
    let outcome = judge.conclude(false);
    assert_eq!(outcome.reaction, Reaction::SafeState);
    let finder = outcome.finding.map(|finding| finding.finder);
    assert!(
        matches!(finder, Some(Finder::Gate(faults)) if faults.contains(GateFault::SensorNotANumber)),
        "{finder:?}"
    );
    greatest - least
}
