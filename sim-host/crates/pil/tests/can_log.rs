//! Logs of the bus: what is written is read again, and feeds the ECU's program.

use pil::can_log::{Format, Reader, ReplayError, Row, Summary, replay, write};
use pil::closed_loop::{Exchange, run};
use pil::ecu::Software;
use pil::manoeuvre::Manoeuvre;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::path::Path;

const RATE_HZ: f64 = 10_000.0;

fn ecu() -> Scenario<f32> {
    ecu_scenario(&scenario(), &Manoeuvre::constant(1750.0, 10.0))
}

fn scenario() -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 1.0;
    scenario.dither.waveform = Waveform::Square;
    scenario
}

fn drive() -> Vec<Exchange> {
    let manoeuvre = Manoeuvre::constant(1750.0, 10.0);
    let vehicle = VehicleNode::new(&scenario(), &manoeuvre).expect("it can be driven");
    let mut ecu = Software::new(&ecu()).expect("the scenario is valid");
    let run = run(&mut ecu, vehicle, &mut || {});
    run.expect("a program on the host is reached").exchanges
}

fn log_of(exchanges: &[Exchange], format: Format) -> String {
    let mut bytes = Vec::new();
    write(exchanges, RATE_HZ, format, &mut bytes).expect("a buffer takes it");
    String::from_utf8(bytes).expect("a log is text")
}

fn replayed(log: &str) -> Result<(Summary, Vec<Row>), ReplayError> {
    let mut rows = Vec::new();
    let summary = replay(&ecu(), &mut Reader::new(log.as_bytes()), &mut |row| {
        rows.push(*row);
        true
    })?;
    Ok((summary, rows))
}

fn refusal(log: &str) -> String {
    replayed(log).expect_err("it is refused").to_string()
}

fn frames(exchanges: &[Exchange]) -> [usize; 2] {
    let count = |of: fn(&Exchange) -> bool| exchanges.iter().filter(|e| of(e)).count();
    [
        count(|e| e.from_ecu.frame.is_some()),
        count(|e| e.to_ecu.frame.is_some()),
    ]
}

#[test]
fn the_drive_of_a_log_gives_the_same_actuator_frames() {
    let drive = drive();
    let [actuator, sensor] = frames(&drive).map(|count| count as u64);
    for format in [Format::Candump, Format::Asc] {
        let (summary, rows) = replayed(&log_of(&drive, format)).expect("it is whole");
        let expected = Summary {
            ticks: sensor,
            sensor_frames: sensor,
            recorded: actuator,
            equal: actuator,
            ..Summary::default()
        };
        assert_eq!(summary, expected, "{format:?}");
        assert!(rows.len() as u64 == actuator && rows.iter().all(|row| row.frame));
        assert!(rows.last().is_some_and(|row| row.mode == "active"));
    }
}

/// The answers to another ECU's challenges are put right, from whatever frame on the log begins.
#[test]
fn a_log_may_begin_in_the_middle_at_any_time() {
    let log = log_of(&drive(), Format::Candump);
    let later: Vec<&str> = log.lines().skip(700).collect();
    let later = later.join("\n").replace("(000000000", "(178000000");
    let (summary, rows) = replayed(&later).expect("it is whole");
    assert_eq!((summary.damaged, summary.replaced), (0, 0));
    assert!(
        rows.last()
            .is_some_and(|row| row.mode == "active" && row.faults == 0)
    );
}

#[test]
fn damaged_foreign_and_missing_frames_are_counted_and_judged() {
    let log = log_of(&drive(), Format::Candump);
    let (whole, _) = replayed(&log).expect("it is whole");
    let mut lines: Vec<String> = log.lines().map(str::to_owned).collect();
    // One bit of one frame.
    let at = lines.len() / 2 - lines.len() / 2 % 2;
    assert!(lines[at].contains(" 100##1"));
    let last = lines[at].pop().expect("it has digits");
    lines[at].push(if last == '0' { '1' } else { '0' });
    // Another sender, a classic and a remote frame, and one of another length.
    let time = lines[at]
        .split(' ')
        .next()
        .expect("it has a time")
        .to_owned();
    for other in ["7DF#0201", "00000100##1AA", "100#R", "101#0011223344556677"] {
        lines.insert(at + 1, format!("{time} can0 {other}"));
    }
    let (summary, rows) = replayed(&lines.join("\n")).expect("it is read");
    assert_eq!((summary.damaged, summary.foreign), (1, 3));
    assert_eq!(summary.sensor_frames, whole.sensor_frames);
    assert!(
        rows.iter().any(|row| row.warnings & 0b10 != 0),
        "damaged is a warning"
    );
    // A fifth of a second without frames.
    let gap = [&lines[..at], &lines[at + 400..]].concat().join("\n");
    let (_, rows) = replayed(&gap).expect("it is read");
    let last = rows.last().expect("there are ticks");
    assert!(last.mode == "safe" && last.faults != 0, "{last:?}");
    assert!(
        rows.iter()
            .any(|row| !row.frame && row.yaw_rate_rad_per_s.is_none())
    );
}

#[test]
fn what_is_no_log_is_refused_with_its_line() {
    let frame = "0102030405060708091011121314151617181920212223";
    let line = |time: &str| format!("({time}) can0 100##1{frame}00\n");
    let good = line("1.0");
    assert!(refusal("").contains("no sensor frame"));
    assert!(refusal("(1.0) can0 7DF#02\n").contains("no sensor frame"));
    let back = refusal(&format!("{good}{}", line("0.5")));
    assert!(
        back.contains("line 2") && back.contains("from 1 to 0.5 s"),
        "{back}"
    );
    let gap = refusal(&format!("{good}{}", line("61.5")));
    assert!(
        gap.contains("line 2: 60.5 s") && gap.contains("at most 60 s"),
        "{gap}"
    );
    for (bad, reason) in [
        ("(nan) can0 100##100", "the time is not a number"),
        ("(1.0 can0 100##100", "the time is not in brackets"),
        ("(1.0) can0", "no frame"),
        ("(1.0) can0 100", "no #"),
        ("(1.0) can0 XYZ#00", "the identifier is not a number"),
        ("(1.0) can0 100##", "no flags"),
        ("(1.0) can0 100##1ABC", "two digits"),
        ("(1.0) can0 100##1+1", "not hexadecimal"),
    ] {
        let text = refusal(&format!("{good}{bad}\n"));
        assert!(
            text.contains("line 2") && text.contains(reason),
            "{bad}: {text}"
        );
    }
    let head = "date x\nbase hex  timestamps absolute\n";
    for (bad, reason) in [
        ("0.1 CANFD 1 Rx", "no identifier"),
        ("0.1 CANFD 1 Rx 100 1 0 c", "length"),
        ("0.1 CANFD 1 Rx 100 1 0 c 24 00", "as many bytes"),
        ("0.1 CANFD 1 Rx 100 1 0 1 1 xy", "from 0 to 255"),
        ("0.1 CANFD 1 Rx 100 name", "no flags"),
        ("0.1 1 100 Rx d nine 00", "length"),
        ("base hex timestamps relative", "absolute"),
        ("text", "the time is not a number"),
    ] {
        let text = refusal(&format!("{head}{bad}\n"));
        assert!(
            text.contains("line 3") && text.contains(reason),
            "{bad}: {text}"
        );
    }
    let long = format!("{good}{}\n", "(".repeat(5000));
    assert!(refusal(&long).contains("longer than 4096"));
}

#[test]
fn a_name_and_decimal_numbers_are_read_too() {
    let bytes = "0 ".repeat(24);
    let log = format!(
        "base dec timestamps absolute\n0.5 Start of measurement\n1.0 CANFD 1 Rx 256 SensorFrame 1 0 12 24 {bytes}\n"
    );
    let frame = Reader::new(log.as_bytes())
        .next_frame()
        .expect("it is read");
    let frame = frame.expect("there is one");
    assert_eq!((frame.identifier, frame.data.len()), (256, 24));
    assert_eq!(Format::of(Path::new("a.ASC")), Format::Asc);
    assert_eq!(Format::of(Path::new("a.log")), Format::Candump);
}

/// The log is read line by line: its memory does not grow with its length.
#[test]
fn a_long_log_is_read_as_it_comes() {
    struct Endless {
        line: u64,
    }
    impl std::io::Read for Endless {
        fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
            let line = format!("({}.0) can0 7DF#00\n", self.line);
            self.line += 1;
            to[..line.len()].copy_from_slice(line.as_bytes());
            Ok(line.len())
        }
    }
    let source = std::io::BufReader::new(Endless { line: 0 });
    let mut reader = Reader::new(source);
    for k in 0..100_000 {
        let frame = reader
            .next_frame()
            .expect("it is whole")
            .expect("it continues");
        assert_eq!(frame.time_s, f64::from(k));
    }
    assert_eq!(reader.line(), 100_000);
}
