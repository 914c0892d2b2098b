//! Faults between vehicle and ECU and in the ECU's interrupts, with the ECU's program on the host.

use pil::ecu::{Ecu, Software};
use pil::fault::catalogue::{
    self, Class, Fault, Kind, LinkFailure, SensorFailure, ServoFailure, Signal, TimingFailure,
};
use pil::fault::host::{FaultFree, inject};
use pil::fault::injection::Injection;
use pil::fault::injector::Injector;
use pil::fault::judge::{Detector, Judge, Reaction, Verdict};
use pil::fault::row::Row;
use pil::fault::tasks::Tasks;
use pil::fault::totals::totals;
use pil::fault::{manoeuvres, waivers};
use pil::manoeuvre::Manoeuvre;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::exchange::Packet;
use shared_model::frame::decode_actuation;
use shared_model::gate::{Fault as GateFault, Faults};
use shared_model::signal::Mode;

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
    let fault_free: Vec<FaultFree> = names
        .iter()
        .map(|name| {
            let (scenario, manoeuvre) = manoeuvre(name);
            FaultFree::run(&scenario, &manoeuvre, &[TIME_S]).expect("it is valid")
        })
        .collect();
    inject(&fault_free, faults, &|| {}).expect("it is not interrupted")
}

fn nan() -> Fault {
    Fault {
        kind: Kind::Sensor(Signal::YawRate, SensorFailure::NotANumber),
        ticks: None,
    }
}

#[test]
fn sr20_every_undetected_fault_has_a_waiver() {
    let faults = catalogue::all();
    let rows = rows(&[CONSTANT_SPEED, "speed ramp"], &faults);
    assert_eq!(rows.len(), 2 * faults.len());
    let failures: Vec<&Row> = rows.iter().filter(|row| row.is_failure()).collect();
    assert!(failures.is_empty(), "{failures:#?}");
    let totals = totals(&rows);
    for class in [
        Class::Sensor,
        Class::Link,
        Class::Controller,
        Class::Timing,
        Class::Actuator,
        Class::Processor,
    ] {
        assert!(totals[&class].detected > 0, "{class:?}");
    }
    // A value that no sensor can have is detected immediately, on every manoeuvre.
    let impossible = [
        "sensor NaN",
        "sensor infinite",
        "sensor subnormal",
        "sensor out of range",
    ];
    for row in rows.iter().filter(|row| impossible.contains(&row.kind)) {
        assert_eq!(
            (row.verdict, row.latency_ticks),
            (Verdict::Detected, Some(1)),
            "{row:?}"
        );
    }
    // Waivers are used, and cover less than a third of the faults.
    let waived = rows.iter().filter(|row| row.waiver.is_some()).count();
    assert!(
        waived > 0 && 3 * waived < rows.len(),
        "{waived} of {}",
        rows.len()
    );
    assert_eq!(waivers::rationale(&Injection::Loop(nan())), None);
}

/// The program with interrupts that can fail equals the program, and nothing is detected without a
/// fault.
#[test]
fn nothing_is_detected_without_a_fault() {
    let (mut scenario, manoeuvre) = manoeuvre("low resolution and noise");
    scenario.run.duration_s = 5.0;
    let own = ecu_scenario(&scenario, &manoeuvre);
    let mut software = Software::new(&own).expect("it is valid");
    let mut tasks = Tasks::new(&own).expect("it is valid");
    let mut vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let mut second = vehicle.clone();
    let mut injector = Injector::new(&scenario);
    // After the start, in which the ECU is not active.
    let first_tick = 15;
    let mut judge = Judge::new(scenario.periods_per_tick(), first_tick);
    for _ in 0..vehicle.total_periods() {
        let (mut a, mut b) = (None, None);
        let answered = software.period(&mut |sent| {
            a = Some(*sent);
            vehicle.answer(sent)
        });
        answered.expect("a program on the host is always reached");
        tasks.period(&mut |sent| {
            b = Some(*sent);
            second.answer_through(&mut injector, sent)
        });
        assert_eq!(a, b);
        if second.periods() > first_tick * scenario.periods_per_tick() {
            judge.observe(&b.unwrap(), &a.unwrap(), &second);
        }
    }
    let outcome = judge.outcome(injector.is_value_corrupted());
    assert_eq!(
        (outcome.verdict, outcome.detection),
        (Verdict::NoEffect, None)
    );
    assert!(outcome.peaks.steering_angle_rad > 0.1);
}

/// A duty that differs by one count and raises no diagnostic is an undetected fault.
#[test]
fn a_planted_undetected_fault_is_classified() {
    let (scenario, manoeuvre) = manoeuvre(CONSTANT_SPEED);
    let mut vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let fault_free = Packet {
        duty_code: 1250,
        bridge_on: true,
        frame: None,
    };
    vehicle.answer(&fault_free);
    let mut judge = Judge::new(scenario.periods_per_tick(), 0);
    // Until the vehicle has its first frame.
    let mut tasks = Tasks::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    for _ in 0..25 {
        tasks.period(&mut |sent| vehicle.answer(sent));
    }
    assert!(vehicle.actuation().is_some());
    judge.observe(&fault_free, &fault_free, &vehicle);
    assert_eq!(judge.outcome(false).verdict, Verdict::NoEffect);
    assert_eq!(judge.outcome(true).verdict, Verdict::Undetected);
    let off = Packet {
        duty_code: 1251,
        ..fault_free
    };
    judge.observe(&off, &fault_free, &vehicle);
    assert_eq!(judge.outcome(false).verdict, Verdict::Undetected);
    // A bridge that is off without a report is one too.
    let mut judge = Judge::new(scenario.periods_per_tick(), 0);
    let off = Packet {
        bridge_on: false,
        ..fault_free
    };
    judge.observe(&off, &fault_free, &vehicle);
    assert_eq!(judge.outcome(false).verdict, Verdict::Undetected);
}

/// At steady motion no value of an old frame is implausible: a stuck gateway, a growing delay and a
/// lasting loss are found by the frames themselves.
#[test]
fn old_and_lost_frames_are_detected_at_steady_motion() {
    use LinkFailure::{GrowingDelay, Replay, TwoOfThreeLost};
    let frames_invalid = GateFault::FramesInvalid;
    let frame_age = GateFault::FrameAge;
    for rpm in [300.0, 1000.0] {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = Waveform::Square;
        scenario.run.duration_s = 4.0;
        let manoeuvre = Manoeuvre::constant(rpm, 2.0);
        let fault_free = FaultFree::run(&scenario, &manoeuvre, &[2.0]).expect("it is valid");
        for (failure, found_by, latest) in [
            (Replay { frames: 256 }, vec![frames_invalid, frame_age], 12),
            (
                GrowingDelay { interval_ticks: 8 },
                vec![frame_age],
                8 * 10 + 1,
            ),
            (TwoOfThreeLost, vec![frames_invalid], 20),
        ] {
            let fault = Fault {
                kind: Kind::SensorLink(failure),
                ticks: None,
            };
            let (faults, ticks) = first_safe_state(&scenario, &manoeuvre, fault);
            assert!(
                found_by.iter().any(|one| faults == (*one).into()),
                "{fault} at {rpm} rpm: {faults:?}"
            );
            assert!(ticks <= latest, "{fault} at {rpm} rpm: {ticks} ticks");
            let rows = inject(std::slice::from_ref(&fault_free), &[fault], &|| {});
            let rows = rows.expect("it is not interrupted");
            assert_eq!(rows[0].verdict, Verdict::Detected, "{:?}", rows[0]);
        }
    }
}

/// Faults of the safe state and the ticks to it, for a fault from 2 s on.
fn first_safe_state(
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    fault: Fault,
) -> (Faults, u32) {
    let mut tasks = Tasks::new(&ecu_scenario(scenario, manoeuvre)).expect("it is valid");
    let mut vehicle = VehicleNode::new(scenario, manoeuvre).expect("it is valid");
    let mut injector = Injector::new(scenario);
    let mut began = None;
    for _ in 0..vehicle.total_periods() {
        let is_tick = vehicle
            .periods()
            .is_multiple_of(scenario.periods_per_tick());
        if began.is_none() && is_tick && vehicle.plant().time_s() >= 2.0 {
            injector.begin(fault);
            began = Some(vehicle.periods());
        }
        let mut faults = Faults::NONE;
        tasks.period(&mut |sent| {
            if let Some(actuation) = sent.frame.and_then(|frame| decode_actuation(&frame).ok()) {
                faults = Faults::from_bits(actuation.faults);
            }
            vehicle.answer_through(&mut injector, sent)
        });
        if !faults.is_empty() {
            let periods = vehicle.periods() - began.expect("no fault before");
            // The frame reports it one tick later.
            return (faults, periods / scenario.periods_per_tick() - 1);
        }
    }
    panic!("{fault} is not found");
}

/// A servo whose pin sticks in the safe state: its bridge is switched off, and the current decays.
#[test]
fn sr05_sr06_a_servo_that_sticks_in_the_safe_state_loses_its_voltage() {
    let (scenario, manoeuvre) = manoeuvre(CONSTANT_SPEED);
    let mut tasks = Tasks::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    let mut vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let mut injector = Injector::new(&scenario);
    let lasting = |kind| Fault { kind, ticks: None };
    let mut stage = 0;
    let mut stuck_code = 0;
    let mut last = None;
    while vehicle.plant().time_s() < TIME_S + 1.0 {
        let time_s = vehicle.plant().time_s();
        if stage == 0 && time_s >= TIME_S {
            injector.begin(lasting(Kind::SensorLink(LinkFailure::Loss)));
            stage = 1;
        }
        if stage == 1 && time_s >= TIME_S + 0.1 {
            assert!(vehicle.plant().motor_current_a() > 5.0);
            injector.begin(lasting(Kind::Servo(ServoFailure::Stuck)));
            stage = 2;
        }
        tasks.period(&mut |sent| {
            last = Some(*sent);
            let reply = vehicle.answer_through(&mut injector, sent);
            stuck_code = reply.duty_code;
            reply
        });
    }
    let actuation = vehicle.actuation().expect("it reports");
    assert_eq!(actuation.mode, Mode::Safe);
    assert!(!actuation.bridge_on && !last.expect("a packet").bridge_on);
    assert!(stuck_code > 1400, "the pin is stuck at {stuck_code}");
    let current_a = vehicle.plant().motor_current_a();
    assert!(current_a.abs() < 1e-6, "{current_a} A");
}

/// Where the dither is ramped out the chaos returns, unless the vehicle slows down as demanded. Where it
/// is kept the motion stays that of the dither, and a vehicle that slows down keeps only its ripple.
#[test]
fn after_the_safe_state_a_vehicle_that_slows_down_turns_steadily() {
    let clock = Kind::Timing(TimingFailure::Clock(0.5));
    for (kind, fault, ripple_rad_per_s) in [
        (nan().kind, GateFault::SensorNotANumber, 0.02),
        (clock, GateFault::TickWindow, 1e-3),
    ] {
        let constant = last_peak_to_peak_rad_per_s(CONSTANT_SPEED, kind, fault);
        let slowing = last_peak_to_peak_rad_per_s("obeyed speed limit", kind, fault);
        println!(
            "{}: peak-to-peak yaw rate {constant} rad/s at constant speed, {slowing} rad/s after slowing down",
            fault.name()
        );
        assert!(constant > 0.5, "{constant}");
        assert!(slowing < ripple_rad_per_s, "{slowing}");
    }
}

/// The peak-to-peak yaw rate of the last two seconds of a run with a fault.
fn last_peak_to_peak_rad_per_s(name: &str, kind: Kind, fault: GateFault) -> f64 {
    let (scenario, manoeuvre) = manoeuvre(name);
    let mut tasks = Tasks::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    let mut vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let mut injector = Injector::new(&scenario);
    let mut judge = Judge::new(scenario.periods_per_tick(), 0);
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut is_on = false;
    for _ in 0..vehicle.total_periods() {
        if !is_on && vehicle.plant().time_s() >= TIME_S {
            match kind {
                Kind::Timing(failure) => tasks.fail(failure),
                _ => injector.begin(Fault { kind, ticks: None }),
            }
            is_on = true;
        }
        let mut sent_last = None;
        tasks.period(&mut |sent| {
            sent_last = Some(*sent);
            vehicle.answer_through(&mut injector, sent)
        });
        let sent_last = sent_last.expect("a duty in every period");
        if is_on {
            judge.observe(&sent_last, &sent_last, &vehicle);
        }
        if vehicle.plant().time_s() > scenario.run.duration_s - 2.0 {
            let yaw_rate = vehicle.plant().truth().yaw_rate_rad_per_s;
            (least, greatest) = (yaw_rate.min(least), yaw_rate.max(greatest));
        }
    }
    let outcome = judge.outcome(false);
    assert_eq!(outcome.reaction, Reaction::SafeState);
    let detector = outcome.detection.map(|first| first.detector);
    assert!(
        matches!(detector, Some(Detector::Gate(faults)) if faults.contains(fault)),
        "{detector:?}"
    );
    greatest - least
}
