//! Frames against implementations that share no code with this project: the Python packages
//! autosar-e2e (in C) and cantools, the latter with the DBC file; and for the statuses, which the
//! Python package does not give, a Rust crate.

use autosar_e2e::profile5::{Profile5, Profile5Config};
use autosar_e2e::{E2EProfile, E2EStatus};
use fastrand::Rng;
use pil::can_log::{Format, write};
use pil::closed_loop::run;
use pil::ecu::Software;
use pil::manoeuvre::Manoeuvre;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use shared_model::bus::Message;
use shared_model::diagnostic::{
    DIAGNOSTIC_DATA_ID, Diagnostic, Record, ResetCause, encode_diagnostic,
};
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::ecu::Warning;
use shared_model::exchange::{FRAME_LEN, FrameBytes};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, SENSOR_STATE_MACHINE, encode_actuation,
    encode_measurement,
};
use shared_model::gate::Fault;
use shared_model::segments::first_identifier;
use shared_model::signal::{Actuation, Measurement, Mode};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use tests::python;

/// Frames of each kind: the counter wraps around.
const FRAMES: usize = 400;

/// A kind of frame: its name in the DBC file, and its data ID.
type Kind = (&'static str, u16);
const SENSOR: Kind = ("SensorFrame", SENSOR_DATA_ID);
const ACTUATOR: Kind = ("ActuatorFrame", ACTUATOR_DATA_ID);
const DIAGNOSTIC: Kind = ("DiagnosticFrame", DIAGNOSTIC_DATA_ID);

/// Queries tests/python/check_frames.py; an answer, as its words, for every question.
fn query(questions: &[String]) -> Vec<Vec<String>> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut child = python::script("check_frames.py")
        .arg(tests.with_file_name("docs").join("dithersteer.dbc"))
        .arg(tests.with_file_name("docs").join("dithersteer-classic.dbc"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Python starts");
    let mut input = child.stdin.take().expect("stdin is piped");
    // A script that ended early prints the reason itself; its exit code is the answer.
    let _ = input.write_all(questions.join("\n").as_bytes());
    drop(input);
    let output = child.wait_with_output().expect("Python ends");
    assert!(
        output.status.success(),
        "check_frames.py: {}",
        output.status
    );
    let answers: Vec<Vec<String>> = String::from_utf8(output.stdout)
        .expect("the answers are text")
        .lines()
        .map(|line| line.split(' ').map(str::to_owned).collect())
        .collect();
    assert_eq!(answers.len(), questions.len());
    answers
}

fn hex(frame: &FrameBytes) -> String {
    frame.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn question((name, _): Kind, frame: &FrameBytes) -> String {
    format!("{name} {}", hex(frame))
}

/// A plain number, any bits, or one of the ends of what an f32 can be.
fn number(rng: &mut Rng) -> f32 {
    let bits = match rng.u8(..4) {
        0 | 1 => (4e3 * rng.f32() - 2e3).to_bits(),
        2 => rng.u32(..),
        _ => {
            let ends = [
                0,
                1,
                0x7f_ffff,
                0x80_0000,
                0x7f7f_ffff,
                0x7f80_0000,
                0x7fc0_0000,
                0x7f80_0001,
            ];
            rng.choice(ends).expect("there are ends") | u32::from(rng.bool()) << 31
        }
    };
    f32::from_bits(bits)
}

fn measurement(rng: &mut Rng) -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm: number(rng),
        yaw_rate_rad_per_s: number(rng),
        steering_angle_rad: number(rng),
        steering_rate_rad_per_s: number(rng),
        current_request_a: number(rng),
    }
}

fn actuation(rng: &mut Rng) -> Actuation<f32> {
    Actuation {
        mode: Mode::from_code(rng.u8(..3)).expect("there are three modes"),
        faults: rng.u32(..),
        motor_voltage_v: number(rng),
        dither_amplitude_v: number(rng),
        wheel_speed_limit_rpm: number(rng),
        warnings: rng.u16(..),
        sensor_counter: rng.u8(..),
        bridge_on: rng.bool(),
        challenge: rng.u8(..),
    }
}

/// A signal's value as the other side should read it.
#[derive(Debug)]
enum Value {
    Number(f32),
    Text(String),
}

impl Value {
    fn text(value: impl ToString) -> Self {
        Self::Text(value.to_string())
    }

    /// Whether `other` is the same: numbers to the bit, NaN as a class.
    fn is(&self, other: &str) -> bool {
        match self {
            Self::Text(text) => text == other,
            Self::Number(number) => {
                // The other side prints f64; none of its digits may be lost on the way to f32 and
                // back.
                let read: f64 = other.parse().expect("a number");
                let same = read.to_bits() == f64::from(*number).to_bits();
                same || (read.is_nan() && number.is_nan())
            }
        }
    }
}

type Signals = Vec<(&'static str, Value)>;

fn sensor_signals(m: &Measurement<f32>, challenge_echo: u8) -> Signals {
    vec![
        ("challenge_echo", Value::text(challenge_echo)),
        ("wheel_speed_rpm", Value::Number(m.wheel_speed_rpm)),
        ("yaw_rate_rad_per_s", Value::Number(m.yaw_rate_rad_per_s)),
        ("steering_angle_rad", Value::Number(m.steering_angle_rad)),
        (
            "steering_rate_rad_per_s",
            Value::Number(m.steering_rate_rad_per_s),
        ),
        ("current_request_a", Value::Number(m.current_request_a)),
    ]
}

fn actuator_signals(a: &Actuation<f32>) -> Signals {
    vec![
        ("mode", Value::text(format!("{:?}", a.mode))),
        (
            "bridge_on",
            Value::text(if a.bridge_on { "On" } else { "Off" }),
        ),
        ("faults", Value::text(a.faults)),
        ("motor_voltage_v", Value::Number(a.motor_voltage_v)),
        ("dither_amplitude_v", Value::Number(a.dither_amplitude_v)),
        (
            "wheel_speed_limit_rpm",
            Value::Number(a.wheel_speed_limit_rpm),
        ),
        ("warnings", Value::text(a.warnings)),
        ("sensor_counter", Value::text(a.sensor_counter)),
        ("challenge", Value::text(a.challenge)),
    ]
}

fn diagnostic(rng: &mut Rng) -> Diagnostic {
    if rng.bool() {
        Diagnostic::Status {
            reset_cause: rng.choice(ResetCause::ALL).expect("there are some"),
            configuration: rng.u8(..),
            faults_in_a_row: rng.u16(..),
            starts: rng.u32(..),
            ticks: rng.u32(..),
        }
    } else {
        Diagnostic::Fault {
            index: rng.u8(..4),
            record: Record {
                // Beyond the numbers that the DBC file names.
                fault: rng.u8(6..),
                start: rng.u16(..),
                gate_faults: rng.u32(..),
                ticks: rng.u32(..),
            },
        }
    }
}

fn diagnostic_signals(diagnostic: &Diagnostic) -> Signals {
    match *diagnostic {
        Diagnostic::Status {
            reset_cause,
            configuration,
            faults_in_a_row,
            starts,
            ticks,
        } => vec![
            ("kind", Value::text("Status")),
            ("reset_cause", Value::text(format!("{reset_cause:?}"))),
            ("configuration", Value::text(configuration)),
            ("faults_in_a_row", Value::text(faults_in_a_row)),
            ("starts", Value::text(starts)),
            ("ticks_since_start", Value::text(ticks)),
        ],
        Diagnostic::Fault { index, record } => vec![
            ("kind", Value::text("FaultRecord")),
            ("record", Value::text(index)),
            ("program_fault", Value::text(record.fault)),
            ("start_of_fault", Value::text(record.start)),
            ("gate_faults", Value::text(record.gate_faults)),
            ("ticks_to_fault", Value::text(record.ticks)),
        ],
    }
}

/// The frames of one sender of each kind, with their content.
fn frames() -> Vec<(Kind, FrameBytes, Signals)> {
    let mut rng = Rng::with_seed(4);
    let mut sender = Sender::new(SENSOR_DATA_ID);
    let sensors: Vec<_> = (0..FRAMES)
        .map(|_| (measurement(&mut rng), rng.u8(..)))
        .map(|(m, challenge_echo)| {
            (
                SENSOR,
                encode_measurement(&m, challenge_echo, &mut sender),
                sensor_signals(&m, challenge_echo),
            )
        })
        .collect();
    let mut sender = Sender::new(ACTUATOR_DATA_ID);
    let actuators = (0..FRAMES).map(|_| actuation(&mut rng)).map(|a| {
        (
            ACTUATOR,
            encode_actuation(&a, &mut sender),
            actuator_signals(&a),
        )
    });
    let actuators: Vec<_> = actuators.collect();
    let mut sender = Sender::new(DIAGNOSTIC_DATA_ID);
    let diagnostics = (0..FRAMES).map(|_| diagnostic(&mut rng)).map(|d| {
        (
            DIAGNOSTIC,
            encode_diagnostic(&d, &mut sender),
            diagnostic_signals(&d),
        )
    });
    let mut frames = sensors;
    frames.extend(actuators);
    frames.extend(diagnostics);
    frames
}

#[test]
fn bytes_checks_and_signals_are_those_of_python() {
    let frames = frames();
    let questions: Vec<String> = frames
        .iter()
        .map(|(kind, frame, _)| question(*kind, frame))
        .collect();
    for (index, ((kind, frame, signals), answer)) in
        frames.iter().zip(query(&questions)).enumerate()
    {
        let context = format!("{} {index}: {answer:?}", kind.0);
        let [protected, verdict, decoded @ ..] = &answer[..] else {
            panic!("{context}");
        };
        assert_eq!(*protected, hex(frame), "{context}");
        assert_eq!(verdict, "whole", "{context}");

        let crc = u16::from_le_bytes([frame[0], frame[1]]);
        let counter = (index % FRAMES) as u8;
        let header = [("crc", Value::text(crc)), ("counter", Value::text(counter))];
        assert_eq!(decoded.len(), header.len() + signals.len(), "{context}");
        for ((name, value), pair) in header.iter().chain(signals).zip(decoded) {
            let (decoded_name, decoded_value) = pair.split_once('=').expect("name=value");
            assert_eq!(decoded_name, *name, "{context}");
            assert!(value.is(decoded_value), "{name} is {value:?}; {context}");
        }
    }
}

/// The name of a signal on classic CAN: the kind is in another frame than these.
fn classic_name(name: &str) -> &str {
    match name {
        "starts" | "gate_faults" => "starts_or_gate_faults",
        "ticks_since_start" | "ticks_to_fault" => "ticks",
        name => name,
    }
}

#[test]
fn signals_on_classic_can_are_those_of_python() {
    let frames = frames();
    let questions: Vec<String> = frames
        .iter()
        .map(|(kind, frame, _)| format!("classic {}", question(*kind, frame)))
        .collect();
    for ((kind, _, signals), decoded) in frames.iter().zip(query(&questions)) {
        let [_, _, decoded @ ..] = &decoded[..] else {
            panic!("{}: {decoded:?}", kind.0);
        };
        assert_eq!(decoded.len(), signals.len(), "{}: {decoded:?}", kind.0);
        for ((name, value), pair) in signals.iter().zip(decoded) {
            let (decoded_name, decoded_value) = pair.split_once('=').expect("name=value");
            assert_eq!(decoded_name, classic_name(name), "{}", kind.0);
            assert!(value.is(decoded_value), "{name} is {value:?}: {pair}");
        }
    }
}

/// The identifiers of both files are those of the program.
#[test]
fn the_dbc_files_have_the_identifiers() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("docs");
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("the DBC file is there");
    let (fd, classic) = (read("dithersteer.dbc"), read("dithersteer-classic.dbc"));
    for (message, name) in [
        (Message::Sensor, SENSOR.0),
        (Message::Actuator, ACTUATOR.0),
        (Message::Diagnostic, DIAGNOSTIC.0),
    ] {
        let line = format!("BO_ {} {name}: 24 ", message.can_identifier());
        assert!(fd.contains(&line), "{line}");
        for segment in 0..3 {
            let identifier = first_identifier(message) + segment;
            let line = format!("BO_ {identifier} {name}{}: 8 ", segment + 1);
            assert!(classic.contains(&line), "{line}");
        }
    }
}

/// Every flipped bit, random damage, and frames of the other kind: both sides find them, and the
/// same ones.
#[test]
fn damaged_and_foreign_frames_are_bad_for_both() {
    let mut rng = Rng::with_seed(5);
    let mut received: Vec<(Kind, FrameBytes)> = Vec::new();
    for (index, (kind, frame, _)) in frames().into_iter().enumerate() {
        let other = if kind == SENSOR { ACTUATOR } else { SENSOR };
        received.push((other, frame));
        let mut damaged = frame;
        damaged[rng.usize(..FRAME_LEN)] = rng.u8(..);
        damaged[rng.usize(..FRAME_LEN)] = rng.u8(..);
        received.push((kind, damaged));
        let bit = index % (8 * FRAME_LEN);
        let mut flipped = frame;
        flipped[bit / 8] ^= 1 << (bit % 8);
        received.push((kind, flipped));
    }
    let questions: Vec<String> = received
        .iter()
        .map(|(kind, frame)| question(*kind, frame))
        .collect();
    let mut errors = 0;
    for ((kind, frame), answer) in received.iter().zip(query(&questions)) {
        let status = Receiver::new(kind.1, MAX_DELTA_COUNTER).check(Some(frame));
        let verdict = if status == Status::Error {
            "error"
        } else {
            "whole"
        };
        assert_eq!(answer[1], verdict, "{} {}: {status:?}", kind.0, hex(frame));
        errors += usize::from(status == Status::Error);
    }
    // Random damage may by chance write the bytes that were there.
    assert!(
        errors > received.len() - 10,
        "{errors} of {}",
        received.len()
    );
}

/// Window and thresholds of the ECU's state machine, as the script lists them.
fn state_machine() -> String {
    let c = SENSOR_STATE_MACHINE;
    let numbers = [
        c.window_size,
        c.min_ok_init,
        c.max_error_init,
        c.min_ok_valid,
        c.max_error_valid,
        c.min_ok_invalid,
        c.max_error_invalid,
    ];
    numbers.map(|number| number.to_string()).join(",")
}

#[test]
fn dbc_file_has_the_constants() {
    let kinds = [SENSOR, ACTUATOR, DIAGNOSTIC];
    for ((_, data_id), answer) in kinds
        .iter()
        .zip(query(&kinds.map(|(name, _)| name.to_owned())))
    {
        let expected = format!(
            "can_fd=True length={FRAME_LEN} profile=PROFILE_05 data_id={data_id} max_delta_counter={MAX_DELTA_COUNTER} \
             state_machine={}",
            if *data_id == SENSOR_DATA_ID {
                state_machine()
            } else {
                "none".into()
            }
        );
        assert_eq!(answer.join(" "), expected);
    }
}

/// A link that loses, repeats, reorders, damages and confuses frames; both receivers agree on each.
#[test]
fn statuses_are_those_of_another_crate() {
    let mut rng = Rng::with_seed(6);
    let mut frames = Vec::new();
    let mut sender = Sender::new(SENSOR_DATA_ID);
    for _ in 0..20_000 {
        frames.push(encode_measurement(
            &measurement(&mut rng),
            rng.u8(..),
            &mut sender,
        ));
    }
    let foreign = encode_actuation(&actuation(&mut rng), &mut Sender::new(ACTUATOR_DATA_ID));
    let mut receiver = Receiver::new(SENSOR_DATA_ID, MAX_DELTA_COUNTER);
    let mut other = Profile5::new(Profile5Config {
        data_length: 8 * FRAME_LEN as u16,
        data_id: SENSOR_DATA_ID,
        max_delta_counter: MAX_DELTA_COUNTER,
        offset: 0,
    })
    .expect("the configuration is valid");

    let mut seen = Vec::new();
    // The first frame as it is: that crate starts with another counter than the profile has, 0 for
    // 255.
    let mut number = 0;
    let mut received = frames[0];
    while number + 7 < frames.len() {
        let status = receiver.check(Some(&received));
        let expected = match other.check(&received).expect("the length is right") {
            E2EStatus::Ok => Status::Ok,
            E2EStatus::OkSomeLost => Status::OkSomeLost,
            E2EStatus::CrcError => Status::Error,
            E2EStatus::Repeated => Status::Repeated,
            E2EStatus::WrongSequence => Status::WrongSequence,
            status => panic!("{status:?} is none of profile 5"),
        };
        assert_eq!(status, expected, "frame {number}");
        seen.push(status);

        received = match rng.u8(..10) {
            // Repeated, or from before.
            0 => frames[number.saturating_sub(rng.usize(..4))],
            1 => foreign,
            event => {
                // The next one, or after a loss.
                number += if event < 5 { rng.usize(1..7) } else { 1 };
                frames[number]
            }
        };
        if rng.u8(..10) == 0 {
            received[rng.usize(..FRAME_LEN)] ^= 1 << rng.u8(..8);
        }
    }
    use Status::{Error, Ok, OkSomeLost, Repeated, WrongSequence};
    for status in [Ok, OkSomeLost, Error, Repeated, WrongSequence] {
        let count = seen.iter().filter(|&&seen| seen == status).count();
        assert!(count > 100, "{status:?} was compared {count} times");
    }
}

#[test]
fn the_dbc_names_every_bit_of_faults_and_warnings() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/dithersteer.dbc");
    let text = std::fs::read_to_string(file).expect("the DBC file is there");
    let faults = Fault::ALL.map(|fault| format!("{} {}", fault as u8, fault.name()));
    let warnings = Warning::ALL.map(|warning| format!("{} {}", warning as u8, warning.name()));
    for bits in [faults.join(", "), warnings.join(", ")] {
        assert!(text.contains(&format!("one bit each: {bits}.\"")), "{bits}");
    }
}

/// python-can reads both formats of a log, with every frame of a drive, its time and its bits.
#[test]
fn logs_are_read_by_python_can() {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 0.5;
    let manoeuvre = Manoeuvre::constant(1750.0, 10.0);
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it can be driven");
    let mut ecu = Software::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
    let run = run(&mut ecu, vehicle, &mut || {}).expect("a program on the host is reached");
    let mut expected = Vec::new();
    for (period, exchange) in run.exchanges.iter().enumerate() {
        let frames = [
            (period, ACTUATOR.0, 11, exchange.from_ecu.frame),
            (period + 1, SENSOR.0, 8, exchange.to_ecu.frame),
        ];
        for (period, name, signals, frame) in frames {
            let line =
                |frame| format!("{} {name} fd whole {signals} {}", 100 * period, hex(&frame));
            expected.extend(frame.map(line));
        }
    }
    assert!(expected.len() > 2000);

    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    for name in ["drive.log", "drive.asc"] {
        let path = folder.path().join(name);
        let mut file = fs::File::create(&path).expect("a file can be made");
        let format = Format::of(&path);
        write(&run.exchanges, scenario.run.pwm_rate_hz, format, &mut file).expect("it is written");
        let output = python::script("check_log.py")
            .arg(tests.with_file_name("docs").join("dithersteer.dbc"))
            .arg(&path)
            .output()
            .expect("Python starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {message}");
        let read = String::from_utf8_lossy(&output.stdout);
        let read: Vec<&str> = read.lines().collect();
        assert_eq!(read, expected, "{name}");
    }
}
