//! Measurement files of `--mdf4` in asammdf, which shares no code with this project: groups, names,
//! units, comments, and the bits of every sample, against the CSV and the recording of the same run.

use mdf4::{Channel, File, Group, Samples};
use pil::recording::Recording;
use qemu::Machine;
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use shared_model::ecu::Warning;
use shared_model::frame::decode_actuation;
use shared_model::gate::Fault;
use shared_model::signal::Actuation;
use std::fs;
use std::path::Path;
use std::process::Command;
use tests::{TIME_OUT, image, python, run, scenario, sim_host};

/// Samples as the script prints them: big-endian, hexadecimal.
fn digits<const N: usize>(samples: impl IntoIterator<Item = [u8; N]>) -> String {
    let bytes = samples.into_iter().flatten();
    bytes.map(|byte| format!("{byte:02x}")).collect()
}

fn double(samples: impl IntoIterator<Item = f64>) -> (&'static str, String) {
    let samples = samples.into_iter().map(f64::to_be_bytes);
    ("float64", digits(samples))
}

fn single(samples: impl IntoIterator<Item = f32>) -> (&'static str, String) {
    let samples = samples.into_iter().map(f32::to_be_bytes);
    ("float32", digits(samples))
}

fn integer16(samples: impl IntoIterator<Item = u16>) -> (&'static str, String) {
    let samples = samples.into_iter().map(u16::to_be_bytes);
    ("uint16", digits(samples))
}

/// A CSV file.
struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).expect("the CSV is there");
        let row = |line: &str| line.split(',').map(str::to_owned).collect();
        Self {
            rows: text.lines().map(row).collect(),
        }
    }

    fn len(&self) -> usize {
        self.rows.len() - 1
    }

    fn texts(&self, name: &str) -> impl Iterator<Item = &str> {
        let column = self.rows[0].iter().position(|header| header == name);
        let column = column.unwrap_or_else(|| panic!("the CSV has no column {name}"));
        self.rows[1..].iter().map(move |row| row[column].as_str())
    }

    fn numbers(&self, name: &str) -> impl Iterator<Item = f64> {
        let texts = self.texts(name);
        texts.map(|text| text.parse().expect("a number"))
    }

    fn names(&self, name: &str) -> (&'static str, String) {
        let names: Vec<&str> = self.texts(name).collect();
        ("names of uint8", names.join(" "))
    }
}

/// What the script is expected to print of a file, without the file's own line.
#[derive(Default)]
struct Expected {
    lines: Vec<String>,
}

impl Expected {
    fn group(&mut self, name: &str, records: usize) {
        self.lines.push(format!("group\t{name}\t{records}"));
    }

    fn channel(&mut self, head: &str, (kind, samples): (&str, String)) {
        let [name, unit, comment] = head
            .split(" | ")
            .collect::<Vec<_>>()
            .try_into()
            .expect("name, unit and comment");
        self.lines.push(format!(
            "channel\t{name}\t{unit}\t{comment}\t{kind}\t{samples}"
        ));
    }
}

/// What asammdf reads: the file's description, and all lines after it.
fn read(path: &Path) -> (String, Vec<String>) {
    let mut script = python::script("check_mdf4.py");
    let output = script.arg(path).output().expect("Python starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {message}", path.display());
    let text = String::from_utf8(output.stdout).expect("the script prints text");
    let mut lines = text.lines().map(str::to_owned);
    let file = lines.next().expect("a line for the file");
    let description = file.strip_prefix("file\t4.10\t").expect("MDF 4.10");
    (description.replace("\\n", "\n"), lines.collect())
}

/// Expects the lines; a failure names the first that differs, with the beginning of its samples.
fn assert_same(read: &[String], expected: &Expected) {
    let short = |line: &String| line.chars().take(200).collect::<String>();
    for (read, expected) in read.iter().zip(&expected.lines) {
        assert!(read == expected, "{}\n{}", short(read), short(expected));
    }
    assert_eq!(read.len(), expected.lines.len(), "number of lines");
}

/// Runs the program in a folder.
fn succeed(folder: &Path, line: &str) {
    let mut command = Command::new(sim_host());
    let command = command.args(line.split_whitespace()).current_dir(folder);
    let output = command.output().expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {message}");
}

/// A trajectory as `simulate` and `decode` write it.
fn trajectory(csv: &Table, is_single: bool, step_s: f64, duties: &[u16]) -> Expected {
    let mut expected = Expected::default();
    expected.group("model step", csv.len());
    let time_s = csv.numbers("time_s");
    expected.channel("time_s | s | Time.", double(time_s));
    for head in [
        "sideslip_rad | rad | Sideslip angle beta.",
        "yaw_rate_rad_per_s | rad/s | Yaw rate gamma.",
        "steering_angle_rad | rad | Front steering angle delta_f.",
        "steering_rate_rad_per_s | rad/s | Steering rate.",
    ] {
        let (name, _) = head.split_once(" | ").expect("a name");
        let samples = csv.numbers(name);
        let samples = match is_single {
            // No digit is lost: the CSV's numbers are those of f32.
            true => single(samples.map(|number| {
                let single = number as f32;
                assert_eq!(f64::from(single), number, "{name}");
                single
            })),
            false => double(samples),
        };
        expected.channel(head, samples);
    }
    let modes = csv.names("friction_mode");
    expected.channel("friction_mode |  | Mode of the dry friction.", modes);

    let periods_per_step = duties.len() / csv.len();
    expected.group("PWM period", duties.len());
    let time_s = |n| n as f64 * step_s / periods_per_step as f64;
    let times_s = (0..duties.len()).map(time_s);
    expected.channel("time_s | s | Time.", double(times_s));
    let comment = "Duty of the period that begins, counts of the PWM timer; 2500 are full duty.";
    let duty = integer16(duties.iter().copied());
    expected.channel(&format!("duty_code |  | {comment}"), duty);
    // The CSV has the last of each step.
    let last = duties.chunks(periods_per_step).map(|step| step.last());
    let last = last.map(|duty| f64::from(*duty.expect("a step has periods")));
    assert!(last.eq(csv.numbers("duty_code")));
    expected
}

#[test]
fn a_simulated_trajectory_is_read_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut scenario = Scenario::<f64>::reconstruction();
    scenario.run.duration_s = 2.0;
    scenario.dither.waveform = Waveform::Square;
    scenario.dither.start_time_s = 0.5;
    let toml = dynamics::config::to_toml(&scenario);
    fs::write(folder.path().join("c.toml"), &toml).expect("it is written");
    for option in ["", "--f32"] {
        let line = format!(
            "simulate --config c.toml {option} --out trajectory.csv --mdf4 trajectory.mf4 --force"
        );
        succeed(folder.path(), &line);
        let csv = Table::read(&folder.path().join("trajectory.csv"));
        let (step_s, duties) = match option {
            "" => {
                let trace = dynamics::simulate::simulate(&scenario).expect("it is valid");
                (trace.step_s, trace.duties)
            }
            _ => {
                let single = scenario.map(&|value| value as f32);
                let trace = dynamics::simulate::simulate(&single).expect("it is valid");
                (trace.step_s, trace.duties)
            }
        };
        let (description, lines) = read(&folder.path().join("trajectory.mf4"));
        assert_eq!(description.trim(), toml.trim());
        let expected = trajectory(&csv, option == "--f32", step_s, &duties);
        assert_same(&lines, &expected);
        assert!(csv.len() == 2000 && duties.len() == 20_000);
    }
}

#[test]
fn telemetry_is_read_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut settings = qemu::settings::of(&scenario(Waveform::Sine, Application::Averaged));
    settings.push("telemetry=run.bin".into());
    let image = image("bench");
    run(
        &image,
        Machine::Mps2An386,
        &settings,
        folder.path(),
        TIME_OUT,
    )
    .expect("it ends");
    succeed(
        folder.path(),
        "firmware decode run.bin --out run.csv --mdf4 run.mf4",
    );
    let csv = Table::read(&folder.path().join("run.csv"));
    let telemetry = folder.path().join("run.bin");
    let recording = qemu::telemetry::Recording::open(&telemetry).expect("it is whole");
    let (description, lines) = read(&folder.path().join("run.mf4"));
    assert_eq!(description, "Telemetry of the ECU, run.bin.");
    assert_same(&lines, &trajectory(&csv, true, 1e-3, &recording.duties));
    assert_eq!(csv.len(), 2000);
}

#[test]
fn a_drive_is_read_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    // The speed leaves the sensor's range: warnings, then the safe state.
    let manoeuvre = "[run]
duration_s = 1.5
[dither]
waveform = \"square\"
start_time_s = 0.2
[manoeuvre]
name = \"m & <n>\"
wheel_speed_rpm = [[0.0, 1750.0], [1.0, 4200.0]]
current_request_a = [[0.0, 10.0]]
";
    fs::write(folder.path().join("m.toml"), manoeuvre).expect("it is written");
    let bench = image("bench");
    let line = format!(
        "pil --scenario m.toml --firmware {} --record d.loop --out d.csv --mdf4 d.mf4",
        bench.path.display()
    );
    succeed(folder.path(), &line);
    let csv = Table::read(&folder.path().join("d.csv"));
    let recorded = fs::read(folder.path().join("d.loop")).expect("it is there");
    let exchanges = Recording::read(&recorded).expect("it is whole").exchanges;
    let lead_in = exchanges.len() - 10 * csv.len();

    let mut expected = Expected::default();
    expected.group("control tick", csv.len());
    for head in [
        "time_s | s | Time.",
        "wheel_speed_rpm | rpm | Wheel speed N.",
        "sideslip_rad | rad | Sideslip angle beta.",
        "yaw_rate_rad_per_s | rad/s | Yaw rate gamma.",
        "steering_angle_rad | rad | Front steering angle delta_f.",
        "steering_rate_rad_per_s | rad/s | Steering rate.",
        "friction_mode |  | Mode of the dry friction.",
        "current_request_a | A | Motor current that the driver requests.",
        "motor_current_a | A | Motor current of the last PWM period.",
        "dither_rad | rad | Dither ahead of the nonlinearities in the last PWM period.",
    ] {
        let (name, _) = head.split_once(" | ").expect("a name");
        expected.channel(
            head,
            match name {
                "friction_mode" => csv.names(name),
                _ => double(csv.numbers(name)),
            },
        );
    }
    let last_frame = |tick: usize| -> Actuation<f32> {
        let until = &exchanges[..lead_in + 10 * (tick + 1)];
        let frame = until
            .iter()
            .rev()
            .find_map(|exchange| exchange.from_ecu.frame);
        decode_actuation(&frame.expect("a frame")).expect("it is whole")
    };
    let frames: Vec<_> = (0..csv.len()).map(last_frame).collect();
    let modes: Vec<String> = frames
        .iter()
        .map(|frame| format!("{:?}", frame.mode).to_lowercase())
        .collect();
    assert!(modes.contains(&"active".into()) && modes.contains(&"safe".into()));
    expected.channel(
        "mode |  | Operating mode of the ECU.",
        ("names of uint8", modes.join(" ")),
    );
    let faults = Fault::ALL.map(|fault| fault.name()).join(", ");
    expected.channel(
        &format!(
            "faults |  | Faults that put the ECU into its safe state, one bit each, from bit 0 on: {faults}."
        ),
        (
            "uint32",
            digits(frames.iter().map(|frame| frame.faults.to_be_bytes())),
        ),
    );
    let warnings = Warning::ALL.map(|warning| warning.name()).join(", ");
    expected.channel(
        &format!(
            "warnings |  | Events since the last frame that are tolerated, one bit each, from bit 0 on: {warnings}."
        ),
        integer16(frames.iter().map(|frame| frame.warnings)),
    );
    expected.channel(
        "motor_voltage_v | V | Motor's share of the servo voltage.",
        single(frames.iter().map(|frame| frame.motor_voltage_v)),
    );
    expected.channel(
        "dither_amplitude_v | V | Amplitude of the dither on the servo voltage.",
        single(frames.iter().map(|frame| frame.dither_amplitude_v)),
    );
    expected.channel(
        "wheel_speed_limit_rpm | rpm | Wheel speed that the vehicle must not exceed.",
        single(frames.iter().map(|frame| frame.wheel_speed_limit_rpm)),
    );

    let drive = &exchanges[lead_in..];
    expected.group("PWM period", drive.len());
    let times_s = (0..drive.len()).map(|n| n as f64 / 10_000.0);
    expected.channel("time_s | s | Time.", double(times_s));
    expected.channel(
        "duty_code |  | Duty that the ECU commands, counts of the PWM timer.",
        integer16(drive.iter().map(|exchange| exchange.from_ecu.duty_code)),
    );
    expected.channel(
        "captured_duty_code |  | Duty that is measured on the pin of the servo, counts of the PWM timer.",
        integer16(drive.iter().map(|exchange| exchange.to_ecu.duty_code)),
    );
    let on = drive
        .iter()
        .map(|exchange| [exchange.from_ecu.bridge_on.into()]);
    expected.channel(
        "bridge_on |  | 1 while the bridge of the servo is on.",
        ("uint8", digits(on)),
    );
    let (description, lines) = read(&folder.path().join("d.mf4"));
    assert!(
        description.starts_with("m & <n>\n\n[controller]\n"),
        "{description}"
    );
    assert_same(&lines, &expected);
    // The CSV has the duty on the pin at each tick.
    let at_ticks = drive
        .chunks(10)
        .map(|tick| f64::from(tick[9].to_ecu.duty_code));
    assert!(at_ticks.eq(csv.numbers("duty_code")));
}

const SPECIAL_F64: [f64; 9] = [
    f64::NAN,
    -f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    -0.0,
    5e-324,
    f64::MAX,
    f64::MIN,
    0.1,
];
const SPECIAL_F32: [f32; 9] = [
    f32::NAN,
    -f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    -0.0,
    1e-45,
    f32::MAX,
    f32::MIN,
    0.1,
];

/// A file with every type, special numbers, text that XML would change, and a group without records.
fn special() -> (Vec<u8>, Expected) {
    let channel = |name: &str, samples| Channel {
        name: name.into(),
        unit: "µm/°",
        comment: format!("<{name}> & \"more\""),
        samples,
    };
    let names = vec![(0, "none".to_owned()), (200, "größer".to_owned())];
    let of = |k: usize| if k.is_multiple_of(2) { 200 } else { 0 };
    let group = |name: &str, records| Group {
        name: name.into(),
        records,
        time_s: Box::new(|k| k as f64),
        channels: vec![
            channel("a", Samples::F64(Box::new(|k| SPECIAL_F64[k]))),
            channel("b", Samples::F32(Box::new(|k| SPECIAL_F32[k]))),
            channel("c", Samples::U32(Box::new(|k| u32::MAX - k as u32))),
            channel("d", Samples::U16(Box::new(|k| u16::MAX - k as u16))),
            channel("e", Samples::U8(Box::new(|k| u8::MAX - k as u8))),
            channel("f", Samples::Name(Box::new(of), names.clone())),
        ],
    };
    let file = File {
        program: "test",
        version: "<&>",
        comment: "A \0 in <it> & more".into(),
        groups: vec![group("one", SPECIAL_F64.len()), group("none", 0)],
    };
    let mut bytes = Vec::new();
    file.write(&mut bytes).expect("a buffer takes it");

    let mut expected = Expected::default();
    for (name, records) in [("one", SPECIAL_F64.len()), ("none", 0)] {
        let head = |name| format!("{name} | µm/° | <{name}> & \"more\"");
        expected.group(name, records);
        let times_s = (0..records).map(|k| k as f64);
        expected.channel("time_s | s | Time.", double(times_s));
        expected.channel(&head("a"), double(SPECIAL_F64[..records].to_vec()));
        expected.channel(&head("b"), single(SPECIAL_F32[..records].to_vec()));
        let counted = (0..records as u32).map(|k| (u32::MAX - k).to_be_bytes());
        expected.channel(&head("c"), ("uint32", digits(counted)));
        let counted = (0..records as u16).map(|k| u16::MAX - k);
        expected.channel(&head("d"), integer16(counted));
        let counted = (0..records as u8).map(|k| [u8::MAX - k]);
        expected.channel(&head("e"), ("uint8", digits(counted)));
        let names = (0..records).map(|k| ["größer", "none"][k % 2]);
        let names: Vec<&str> = names.collect();
        expected.channel(&head("f"), ("names of uint8", names.join(" ")));
    }
    (bytes, expected)
}

fn differing(bytes: &[u8], expected: &Expected) -> usize {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("special.mf4");
    fs::write(&path, bytes).expect("it is written");
    let (description, lines) = read(&path);
    assert_eq!(description, "A   in <it> & more");
    assert_eq!(lines.len(), expected.lines.len());
    let pairs = lines.iter().zip(&expected.lines);
    pairs.filter(|(read, expected)| read != expected).count()
}

/// Every type and special number is read; one bit of a sample or one letter of a unit is noticed.
#[test]
fn special_numbers_and_texts_are_read_and_damage_is_noticed() {
    let (whole, expected) = special();
    assert_eq!(differing(&whole, &expected), 0);
    let mut sample = whole.clone();
    let at = find(&sample, &f64::MAX.to_le_bytes());
    sample[at] ^= 1;
    assert_eq!(differing(&sample, &expected), 1);
    let mut unit = whole;
    let at = find(&unit, "µm/°".as_bytes());
    unit[at + 2] = b'k';
    assert_eq!(differing(&unit, &expected), 1);
}

fn find(bytes: &[u8], part: &[u8]) -> usize {
    let mut windows = bytes.windows(part.len());
    windows
        .position(|window| window == part)
        .expect("it is in the file")
}
