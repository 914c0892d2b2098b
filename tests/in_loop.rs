//! The firmware in the loop: the same commands as the program on the host, over every link and on
//! every board that the emulator has, twice the same bytes, and a clear end where the firmware is
//! dead.

use pil::closed_loop::run;
use pil::comparison::{Depth, compare};
use pil::ecu::Software;
use pil::manoeuvre::{Manoeuvre, load};
use pil::mil_sil_pil::{MilSilPil, ProcessorRun, Target, on_processor, run_all};
use pil::recording::Recording;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::session::{LinkKind, Session};
use qemu::{Machine, RunError};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::exchange::ToEcu;
use shared_model::frame::decode_actuation;
use shared_model::policy::Suppression;
use shared_model::signal::Mode;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tests::{board_image, image};

fn manoeuvres() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/manoeuvres")
}

/// A manoeuvre's first `duration_s`, s.
fn manoeuvre(file: &str, duration_s: f64) -> (Scenario<f64>, Manoeuvre) {
    let (mut scenario, manoeuvre) = load(&manoeuvres().join(file)).expect("the example is valid");
    scenario.run.duration_s = duration_s;
    (scenario, manoeuvre)
}

fn target(machine: Machine, link: LinkKind) -> Target {
    Target {
        image: board_image(machine.board(), "bench"),
        machine,
        link,
        time_out: Duration::from_secs(60),
    }
}

fn run_in_loop(file: &str, duration_s: f64, machine: Machine, link: LinkKind) -> MilSilPil {
    let (mut scenario, manoeuvre) = manoeuvre(file, duration_s);
    scenario.servo.timer_clock_hz = machine.timer_clock_hz();
    let target = target(machine, link);
    run_all(&scenario, &manoeuvre, &target, &mut || {})
        .unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn on_target(link: LinkKind) -> ProcessorRun {
    let (scenario, manoeuvre) = manoeuvre("low-resolution-noise.toml", 1.0);
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let ecu = ecu_scenario(&scenario, &manoeuvre);
    let target = target(Machine::Mps2An386, link);
    on_processor(&ecu, vehicle, &target, &mut || {}).unwrap_or_else(|error| panic!("{error}"))
}

fn assert_agree(runs: &MilSilPil) {
    let name = &runs.name;
    assert!(
        runs.model_software.is_equal(),
        "{name}: {:?}",
        runs.model_software
    );
    assert!(
        runs.software_processor.is_equal(),
        "{name}: {:?}",
        runs.software_processor
    );
    let last = runs
        .processor
        .run
        .actuations
        .last()
        .expect("there are ticks");
    let last = last.expect("the ECU has reported");
    assert_eq!(
        (last.mode, last.faults),
        (Mode::Active, 0),
        "{name}: a false alarm"
    );
}

/// Until the dither has come in, or longer where more happens later.
#[test]
fn every_manoeuvre_gives_the_same_commands_at_every_level() {
    let mut files = 0;
    for entry in std::fs::read_dir(manoeuvres())
        .expect("the folder is there")
        .flatten()
    {
        let file = entry.file_name().to_string_lossy().into_owned();
        if !file.ends_with(".toml") {
            continue;
        }
        let duration_s = if file == "speed-ramp.toml" { 12.0 } else { 5.0 };
        for link in [LinkKind::Ticks, LinkKind::Files] {
            let runs = run_in_loop(&file, duration_s, Machine::Mps2An386, link);
            assert_agree(&runs);
            assert!(runs.software_processor.duties as f64 >= duration_s * 1e4);
            assert!(runs.software_processor.frames as f64 >= duration_s * 1e3 - 1.0);
        }
        files += 1;
    }
    assert!(files >= 8, "{files} manoeuvres");
}

/// Under the other ways to suppress, from where the delay line is full.
#[test]
fn manoeuvres_give_the_same_commands_under_delayed_feedback() {
    for file in [
        "constant-speed.toml",
        "delay-2.toml",
        "low-resolution-noise.toml",
        "sine-steer.toml",
        "speed-ramp.toml",
        "step-steer.toml",
    ] {
        for (suppression, waveform) in [
            (Suppression::DelayedFeedback, Waveform::None),
            (Suppression::Both, Waveform::Square),
        ] {
            let (mut scenario, manoeuvre) = manoeuvre(file, 6.0);
            scenario.controller.suppression = suppression;
            scenario.dither.waveform = waveform;
            scenario.dither.start_time_s = 0.0;
            let target = target(Machine::Mps2An386, LinkKind::Ticks);
            let runs = run_all(&scenario, &manoeuvre, &target, &mut || {})
                .unwrap_or_else(|error| panic!("{file}: {error}"));
            assert_agree(&runs);
        }
    }
}

#[test]
fn every_link_and_board_gives_the_same_commands() {
    let file = "constant-speed-sine.toml";
    for (machine, link) in [
        (Machine::Mps2An386, LinkKind::Timed),
        (Machine::Mps2An386, LinkKind::MeasuredTicks),
        (Machine::Mps2An500, LinkKind::Ticks),
        (Machine::NetduinoPlus2, LinkKind::Ticks),
        (Machine::Mps2An500, LinkKind::Files),
        (Machine::NetduinoPlus2, LinkKind::Files),
    ] {
        assert_agree(&run_in_loop(file, 4.0, machine, link));
    }
}

/// Exchanges per control tick and per PWM period are the same exchanges, in the same order.
#[test]
fn the_exchanges_do_not_depend_on_the_link() {
    let per_period = on_target(LinkKind::Files);
    for link in [LinkKind::Ticks, LinkKind::MeasuredTicks, LinkKind::Timed] {
        let other = on_target(link);
        assert_eq!(other.run.exchanges, per_period.run.exchanges, "{link:?}");
        assert_eq!(other.costs.len(), per_period.costs.len(), "{link:?}");
        let is_measured = other.costs.iter().skip(1).all(|&(pwm, _)| pwm > 0);
        assert_eq!(is_measured, link != LinkKind::Ticks, "{link:?}");
        assert!(other.costs.iter().skip(1).all(|&(_, control)| control > 0));
    }
}

/// One period per tick, and many.
#[test]
fn a_tick_has_any_allowed_number_of_periods() {
    for (pwm_rate_hz, control_rate_hz) in [(4000.0, 4000.0), (20_000.0, 100.0)] {
        let (mut scenario, manoeuvre) = manoeuvre("constant-speed.toml", 0.1);
        scenario.run.pwm_rate_hz = pwm_rate_hz;
        scenario.run.control_rate_hz = control_rate_hz;
        let target = target(Machine::Mps2An386, LinkKind::Ticks);
        let runs = run_all(&scenario, &manoeuvre, &target, &mut || {});
        let runs = runs.unwrap_or_else(|error| panic!("{pwm_rate_hz} Hz: {error}"));
        assert!(
            runs.agree(),
            "{pwm_rate_hz} Hz: {:?}",
            runs.software_processor
        );
    }
}

/// A captured duty other than the ECU's own is an error, not a fault that is ignored.
#[test]
fn a_fault_behind_the_pin_needs_an_exchange_per_period() {
    let (scenario, manoeuvre) = manoeuvre("constant-speed.toml", 0.2);
    let settings = qemu::settings::of(&ecu_scenario(&scenario, &manoeuvre));
    let limit = Duration::from_secs(20);
    let (image, machine) = (image("bench"), Machine::Mps2An386);
    let session = Session::start(&image, machine, &settings, LinkKind::Ticks, &[], limit);
    let mut session = session.expect("it starts");
    let mut packet = session.receive().expect("the first period").packet;
    packet.duty_code += 1;
    let error = session.send(&ToEcu {
        packet,
        stop: false,
    });
    assert!(
        matches!(error, Err(RunError::CapturedDuty { .. })),
        "{error:?}"
    );
}

#[test]
fn two_runs_and_a_replay_give_the_same_bytes() {
    for link in [LinkKind::Ticks, LinkKind::Files] {
        let (first, second) = (on_target(link), on_target(link));
        assert_eq!(first.run.exchanges, second.run.exchanges);
        assert_eq!(first.costs, second.costs);
    }
    let (first, second) = (on_target(LinkKind::Files), on_target(LinkKind::Files));
    assert_eq!(first.run.exchanges, second.run.exchanges);
    assert_eq!(
        first.costs, second.costs,
        "also every instruction is the same"
    );

    let (scenario, manoeuvre) = manoeuvre("low-resolution-noise.toml", 1.0);
    let recording = Recording {
        scenario: ecu_scenario(&scenario, &manoeuvre),
        exchanges: first.run.exchanges,
    };
    let mut bytes = Vec::new();
    recording.write(&mut bytes).expect("a buffer takes it");
    let read = Recording::read(&bytes).expect("it is whole");
    assert_eq!(read, recording);
    let replayed = read.replay().expect("the scenario is valid");
    assert_eq!(replayed, recording.exchanges);
}

#[test]
fn one_changed_bit_of_a_command_is_seen() {
    let (scenario, manoeuvre) = manoeuvre("constant-speed.toml", 0.2);
    let mut ecu = Software::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let exchanges = run(&mut ecu, vehicle, &mut || {})
        .expect("it runs on the host")
        .exchanges;
    let with_frame = exchanges
        .iter()
        .rposition(|one| one.from_ecu.frame.is_some());
    let at = with_frame.expect("there are frames");
    for bit in 0..8 * 24 {
        let mut changed = exchanges.clone();
        let frame = changed[at].from_ecu.frame.as_mut().expect("as found above");
        frame[bit / 8] ^= 1 << (bit % 8);
        let comparison = compare(&exchanges, &changed, Depth::Bytes);
        assert_eq!(
            (comparison.first, comparison.different_frames),
            (Some(at), 1)
        );
    }
    let mut changed = exchanges.clone();
    changed[7].from_ecu.duty_code ^= 1;
    assert_eq!(
        compare(&exchanges, &changed, Depth::Commands).first,
        Some(7)
    );
    changed.truncate(100);
    assert!(!compare(&exchanges[..7], &changed[..8], Depth::Bytes).is_equal());
    // The ECU's report at that frame is readable: the comparison is not one of zeros.
    let frame = exchanges[at].from_ecu.frame.expect("as found above");
    assert!(
        decode_actuation(&frame)
            .expect("a known mode")
            .motor_voltage_v
            > 2.9
    );
}

#[test]
fn a_firmware_that_dies_or_refuses_is_said() {
    let (scenario, manoeuvre) = manoeuvre("constant-speed.toml", 0.2);
    let ecu = ecu_scenario(&scenario, &manoeuvre);
    let start = |options: &[&str], settings: &[String]| {
        let limit = Duration::from_secs(3);
        let machine = Machine::Mps2An386;
        let image = image("bench");
        Session::start(&image, machine, settings, LinkKind::Files, options, limit)
    };
    let refused = start(&[], &["dither.amplitude_v=-1".into()]);
    let message = refused.err().expect("it is refused").to_string();
    assert!(message.contains("exit code 10"), "{message}");
    assert!(message.contains("dither.amplitude_v"), "{message}");

    // A core that stands still never opens the link.
    let silent = start(&["-S"], &[]).err();
    assert!(
        matches!(silent, Some(RunError::TimedOut { .. })),
        "{silent:?}"
    );

    // The host that stops answering is noticed when the pipes close; the emulator ends with the
    // session.
    let settings = qemu::settings::of(&ecu);
    let mut session = start(&[], &settings).expect("it starts");
    session.receive().expect("the first period");
    let error = session.receive().expect_err("it waits for its answer");
    assert!(matches!(error, RunError::TimedOut { .. }), "{error}");
}
