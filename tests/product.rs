//! The product's image: it boots alone, speaks on its bus, and meets bad configurations, bad buses
//! and bad starts in a defined state.

use image::Image;
use image::call_graph::CallGraph;
use pil::ecu::{Ecu as _, OnBus};
use pil::manoeuvre::{Manoeuvre, load};
use pil::mil_sil_pil::{Target, run_all};
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::Machine;
use qemu::bus_session::{BusSession, Servo, Tick};
use qemu::configured::{configured, place};
use qemu::session::LinkKind;
use shared_model::Scenario;
use shared_model::bus::{self, Message};
use shared_model::configuration::{BLOCK_LEN, ERASED, Part, block};
use shared_model::diagnostic::{Diagnostic, FAULTS_IN_A_ROW, decode_diagnostic};
use shared_model::dither::Waveform;
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::frame::decode_actuation;
use shared_model::gate::{Fault, Faults};
use shared_model::signal::{Actuation, Mode};
use std::path::Path;
use std::time::Duration;
use tests::{board_image, image};

const BOARDS: [&str; 4] = ["mps2", "netduinoplus2", "nrf52840dk", "nucleog474re"];
/// Boards with a CAN.
const CAN_BOARDS: [&str; 2] = ["netduinoplus2", "nucleog474re"];
const BOARD: &str = "mps2";
const MACHINE: Machine = Machine::Mps2An386;
const LIMIT: Duration = Duration::from_secs(20);
/// Numbers of the firmware's faults.
const HARD_FAULT: u8 = 2;
const WATCHDOG: u8 = 3;

/// The product's own use: dither as soon as the speed is known.
fn scenario() -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = Waveform::Sine;
    scenario.dither.start_time_s = 0.0;
    scenario.run.duration_s = 1.0;
    scenario
}

fn manoeuvre() -> Manoeuvre {
    // A small request, so that the lead-in is short.
    Manoeuvre::constant(1750.0, 0.1)
}

fn ecu() -> Scenario<f32> {
    ecu_scenario(&scenario(), &manoeuvre())
}

fn product(scenario: &Scenario<f32>) -> Image {
    configured(&image("ecu"), scenario, BOARD).expect("it has the place")
}

fn start(image: &Image) -> BusSession {
    BusSession::start(image, MACHINE, LIMIT).unwrap_or_else(|error| panic!("{error}"))
}

/// The ECU and a vehicle that answers it.
struct Loop {
    ecu: OnBus,
    vehicle: VehicleNode,
}

impl Loop {
    fn start(image: &Image) -> Self {
        Self {
            ecu: OnBus::new(start(image), ecu().periods_per_tick()),
            vehicle: VehicleNode::new(&scenario(), &manoeuvre()).expect("it is valid"),
        }
    }

    /// Control ticks; `disturb` changes the vehicle's answers.
    fn ticks(&mut self, ticks: u32, mut disturb: impl FnMut(Packet) -> Packet) {
        for _ in 0..10 * ticks {
            let vehicle = &mut self.vehicle;
            let answer = &mut |from_ecu: &Packet| disturb(vehicle.answer(from_ecu));
            self.ecu
                .period(answer)
                .unwrap_or_else(|error| panic!("{error}"));
        }
    }

    fn actuation(&self) -> Actuation<f32> {
        *self.vehicle.actuation().expect("the ECU has reported")
    }

    fn servo(&mut self) -> Servo {
        self.ecu.session().servo().expect("it can be read")
    }
}

fn without_frame(packet: Packet) -> Packet {
    Packet {
        frame: None,
        ..packet
    }
}

/// Lets the ECU run until it has sent a status, and returns it with the codes of its faults.
fn status(session: &mut BusSession) -> (Diagnostic, Vec<u8>) {
    let mut status = None;
    let mut faults = Vec::new();
    for _ in 0..100 {
        let received = session
            .run_freely(Duration::from_millis(20))
            .unwrap_or_else(|error| panic!("{error}"));
        for frame in &received.diagnostics {
            match decode_diagnostic(frame).expect("it is of this version") {
                Diagnostic::Fault { record, .. } => faults.push(record.fault),
                start @ Diagnostic::Status { .. } => {
                    // A whole turn: all records of the start are in between.
                    if status == Some(start) || faults.len() >= 4 {
                        return (start, faults);
                    }
                    if status.is_some() {
                        return (start, faults);
                    }
                    faults.clear();
                    status = Some(start);
                }
            }
        }
    }
    panic!("the ECU sends no status");
}

fn configuration_code(session: &mut BusSession) -> u8 {
    match status(session) {
        (Diagnostic::Status { configuration, .. }, _) => configuration,
        other => panic!("{other:?}"),
    }
}

fn is_neutral(servo: Servo) -> bool {
    !servo.bridge && servo.duty == servo.neutral && servo.neutral > 0
}

#[test]
fn no_breakpoint_is_in_the_product() {
    for board in BOARDS {
        let breakpoints = |name: &str| -> u32 {
            let graph = CallGraph::read(&board_image(board, name).bytes).expect("it is whole");
            graph.functions.values().map(|f| f.breakpoints).sum()
        };
        assert_eq!(breakpoints("ecu"), 0, "{board}");
        if CAN_BOARDS.contains(&board) {
            assert_eq!(breakpoints("ecu-can"), 0, "{board}");
        }
        assert!(breakpoints("bench") > 4, "{board}: the count can see them");
    }
}

/// The lead-in and a fifth of a second, with the dither from the start: a debugger's stop costs the
/// emulator some milliseconds.
#[test]
fn every_manoeuvre_gives_the_commands_of_the_host_over_the_bus() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/manoeuvres");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).expect("it is there").flatten() {
        if entry.path().extension().is_none_or(|it| it != "toml") {
            continue;
        }
        let (mut scenario, manoeuvre) = load(&entry.path()).expect("the example is valid");
        scenario.run.duration_s = 0.2;
        scenario.dither.start_time_s = 0.0;
        let target = Target {
            image: image("ecu"),
            machine: MACHINE,
            link: LinkKind::Uart,
            time_out: LIMIT,
        };
        let runs = run_all(&scenario, &manoeuvre, &target, &mut || {});
        let runs = runs.unwrap_or_else(|error| panic!("{}: {error}", manoeuvre.name));
        assert!(runs.agree(), "{}: {:?}", runs.name, runs.software_processor);
        assert!(runs.software_processor.duties >= 2000);
        assert!(runs.software_processor.frames >= 199);
        println!("{}: {:.2} times real time", runs.name, runs.speed());
        files += 1;
    }
    assert!(files >= 8, "{files} manoeuvres");
}

#[test]
fn sr18_the_dither_is_back_as_soon_as_the_speed_is_known() {
    let mut run = Loop::start(&product(&ecu()));
    let ramp = (1000.0 * ecu().controller.dither_ramp_s) as u32;
    run.ticks(ramp + 20, |packet| packet);
    let before = run.actuation();
    assert_eq!(before.mode, Mode::Active);
    assert!(before.dither_amplitude_v > 0.5, "{before:?}");
    run.ecu.session().reset().expect("it can be reset");
    run.ticks(ramp + 20, |packet| packet);
    let after = run.actuation();
    assert_eq!(after.mode, Mode::Active, "{after:?}");
    assert_eq!(after.dither_amplitude_v, before.dither_amplitude_v);
}

#[test]
fn sr17_bad_configurations_are_refused_by_name_with_the_servo_neutral() {
    let raw = image("ecu");
    let flash = place(&raw).expect("it has the place");
    let good = product(&ecu());
    let blocks = |change: &dyn Fn(&mut [u8])| {
        let mut image = good.clone();
        change(&mut image.bytes[flash.clone()]);
        image
    };
    let with_checksum = |bytes: &mut [u8], at: usize, value: u8| {
        bytes[at] = value;
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[..12 + length]);
        bytes[12 + length..16 + length].copy_from_slice(&sum.to_le_bytes());
    };
    let mut out_of_range = ecu();
    out_of_range.vehicle.mass_kg = 0.0;
    let mut other_clock = ecu();
    other_clock.servo.timer_clock_hz = 16e6;
    let other_board = |bytes: &mut [u8]| {
        bytes[..BLOCK_LEN].copy_from_slice(&block(Part::Application, &ecu(), "nucleog474re"));
    };
    let cases: Vec<(&str, Image, u8)> = vec![
        ("erased", raw.clone(), 1),
        ("gate erased", blocks(&|b| b[BLOCK_LEN..].fill(ERASED)), 17),
        ("no magic", blocks(&|b| b[0] = 0), 2),
        (
            "parts swapped",
            blocks(&|b| {
                let (a, z) = b.split_at_mut(BLOCK_LEN);
                a.swap_with_slice(z);
            }),
            2,
        ),
        ("newer version", blocks(&|b| with_checksum(b, 4, !b[4])), 3),
        ("another board", blocks(&other_board), 4),
        ("longer than its place", blocks(&|b| b[9] = 0xFF), 5),
        ("truncated", blocks(&|b| b[100..BLOCK_LEN].fill(ERASED)), 6),
        ("no such choice", blocks(&|b| with_checksum(b, 12, 200)), 7),
        ("out of range", product(&out_of_range), 8),
        ("another clock", product(&other_clock), 9),
    ];
    for (name, image, code) in cases {
        let mut session = start(&image);
        assert_eq!(configuration_code(&mut session), code, "{name}");
        let servo = session.servo().expect("it can be read");
        assert!(is_neutral(servo), "{name}: {servo:?}");
        let log = session.log().expect("it has a log").join("\n");
        assert!(log.contains("configuration refused"), "{name}: {log}");
    }
}

/// Ten bits over both blocks on the target; all of them in `shared-model`'s tests.
#[test]
fn sr17_a_flipped_bit_of_the_configuration_is_refused() {
    let good = product(&ecu());
    let flash = place(&good).expect("it has the place");
    for bit in [
        3,
        40,
        70,
        90,
        150,
        1000,
        8 * BLOCK_LEN + 130,
        8 * BLOCK_LEN + 700,
    ] {
        let mut image = good.clone();
        image.bytes[flash.start + bit / 8] ^= 1 << (bit % 8);
        let mut session = start(&image);
        assert_ne!(configuration_code(&mut session), 0, "bit {bit}");
        assert!(
            is_neutral(session.servo().expect("it can be read")),
            "bit {bit}"
        );
    }
}

#[test]
fn sr21_a_bus_that_is_silent_from_the_start_leaves_the_servo_neutral() {
    let mut run = Loop::start(&product(&ecu()));
    run.ticks(1000, without_frame);
    let actuation = run.actuation();
    assert_eq!((actuation.mode, actuation.faults), (Mode::Starting, 0));
    let servo = run.servo();
    assert_eq!(servo.duty, servo.neutral);
    // The vehicle wakes up late.
    run.ticks(100, |packet| packet);
    assert_eq!(run.actuation().mode, Mode::Active);
}

#[test]
fn a_bus_that_goes_silent_is_the_age_of_frames_and_a_host_that_returns_finds_the_safe_state() {
    let mut run = Loop::start(&product(&ecu()));
    run.ticks(1000, |packet| packet);
    assert_eq!(run.actuation().mode, Mode::Active);
    run.ticks(30, without_frame);
    let actuation = run.actuation();
    assert_eq!(actuation.mode, Mode::Safe);
    assert!(Faults::from_bits(actuation.faults).contains(Fault::FrameAge));
    run.ticks(200, without_frame);
    assert_eq!(run.actuation().dither_amplitude_v, 1.1, "kept");
    run.ticks(100, |packet| packet);
    assert_eq!(run.actuation().mode, Mode::Safe, "until restart");
}

#[test]
fn damaged_short_long_and_foreign_packets_are_lost_frames_and_no_more() {
    let mut run = Loop::start(&product(&ecu()));
    run.ticks(100, |packet| packet);
    let mut foreign = Vec::new();
    bus::pack(Message::Actuator, &[7; 24], |byte| foreign.push(byte));
    let bad: [&[u8]; 6] = [
        &[0xFF; 32],
        &[0; 32],
        &[1, 2, 3, 0],
        &[0x20; 32],
        &foreign,
        &[3, 0x11, 0x22, 0],
    ];
    for bytes in bad {
        // In place of a frame, and cut off from what follows.
        run.ticks(1, without_frame);
        run.ecu.session().send_bytes(bytes).expect("it takes them");
        run.ticks(1, without_frame);
        run.ecu.session().send_bytes(&[0]).expect("it takes it");
        run.ticks(20, |packet| packet);
        let actuation = run.actuation();
        assert_eq!(
            (actuation.mode, actuation.faults),
            (Mode::Active, 0),
            "{bytes:?}"
        );
    }
}

/// Foreign frames as fast as the emulator takes them, which is faster than any line: the UART's
/// interrupt, which is above the tasks, takes a bounded number of bytes per control tick.
#[test]
fn a_babbling_bus_neither_stops_the_ecu_nor_moves_the_servo() {
    let mut session = start(&product(&ecu()));
    session.tick().expect("it runs");
    let mut foreign = Vec::new();
    bus::pack(Message::Actuator, &[7; 24], |byte| foreign.push(byte));
    let frames = session.babble(&foreign.repeat(2000), Duration::from_millis(500));
    let frames: Vec<FrameBytes> = frames.expect("the ECU runs on");
    assert!(frames.len() > 50, "{} frames", frames.len());
    for frame in frames {
        let actuation = decode_actuation(&frame).expect("it is of this version");
        assert_eq!((actuation.mode, actuation.faults), (Mode::Starting, 0));
    }
    let servo = session.servo().expect("it can be read");
    assert_eq!(servo.duty, servo.neutral);
}

#[test]
fn a_brown_out_loop_leaves_the_servo_neutral_at_each_start_and_a_working_ecu_after_it() {
    let mut run = Loop::start(&product(&ecu()));
    for round in 0..12 {
        run.ticks(1 + round % 4, |packet| packet);
        run.ecu.session().reset().expect("it can be reset");
        let first: Tick = run.ecu.session().tick().expect("it starts");
        let neutral = run.servo().neutral;
        assert!(
            first
                .periods
                .iter()
                .all(|period| period.duty_code == neutral),
            "{first:?}"
        );
    }
    run.ticks(200, |packet| packet);
    assert_eq!(run.actuation().mode, Mode::Active);
}

#[test]
fn sr16_a_hard_fault_is_a_reset_whose_reason_is_on_the_bus_and_three_in_a_row_are_the_safe_state() {
    let mut session = start(&product(&ecu()));
    for round in 1..=FAULTS_IN_A_ROW {
        for _ in 0..20 {
            session.tick().expect("it runs");
        }
        session
            .jump_to(0xF000_0000)
            .expect("the register can be written");
        let (start, faults) = status(&mut session);
        let Diagnostic::Status {
            faults_in_a_row,
            starts,
            ..
        } = start
        else {
            panic!("{start:?}")
        };
        assert_eq!(u32::from(faults_in_a_row), round);
        assert_eq!(starts, round + 1);
        assert_eq!(faults, vec![HARD_FAULT; round as usize]);
    }
    let servo = session.servo().expect("it can be read");
    assert!(is_neutral(servo), "{servo:?}");
    assert!(session.tick().is_err(), "there are no tasks");
}

#[test]
fn sr16_a_control_task_that_stands_still_is_the_watchdog_s() {
    let mut session = start(&product(&ecu()));
    for _ in 0..20 {
        session.tick().expect("it runs");
    }
    let address = image("ecu")
        .address_of("PendSV")
        .expect("it has the interrupt");
    // `bx lr`: the control interrupt returns at once. A reset loads the code again.
    session
        .gdb()
        .write_memory(address, &[0x70, 0x47])
        .expect("it can be written");
    let (_, faults) = status(&mut session);
    assert_eq!(faults, [WATCHDOG]);
}

#[test]
fn a_log_that_nobody_reads_stops_nothing() {
    let mut run = Loop::start(&product(&ecu()));
    run.ticks(100, |packet| packet);
    run.ecu
        .session()
        .leave_log_full()
        .expect("the ring can be written");
    // The change of the mode would be logged.
    run.ticks(200, without_frame);
    assert_eq!(run.actuation().mode, Mode::Safe);
    run.ticks(100, without_frame);
}

#[test]
fn a_debugger_that_detaches_leaves_the_ecu_running() {
    let mut session = start(&product(&ecu()));
    for _ in 0..20 {
        session.tick().expect("it runs");
    }
    let received = session.run_detached(Duration::from_millis(300));
    let frames = received.expect("it runs on").frames;
    assert!(frames.len() > 50, "{} frames", frames.len());
}
