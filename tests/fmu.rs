//! The units of `sim-host fmu` in fmpy, a master that shares no code with this project: the standard,
//! bad calls, and the loop of both, whose bits are those of `pil`.

use fmu::model::Model;
use fmu::variable::Causality;
use pil::closed_loop::{Exchange, Run, run};
use pil::ecu::Software;
use pil::manoeuvre::{Manoeuvre, load};
use pil::mil_sil_pil::{Target, on_processor};
use pil::record::Record;
use pil::recording::Recording;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::Machine;
use qemu::session::LinkKind;
use rayon::prelude::*;
use shared_model::Scenario;
use shared_model::e2e::Sender;
use shared_model::exchange::Packet;
use shared_model::frame::{ACTUATOR_DATA_ID, SENSOR_DATA_ID, encode_actuation, encode_measurement};
use shared_model::signal::{Actuation, Measurement, Mode};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use tests::{image, python, root, sim_host};

/// A folder with both units of a configuration.
struct Units {
    folder: TempDir,
}

impl Units {
    fn new(scenario: &Scenario<f64>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let configuration = folder.path().join("configuration.toml");
        let text = dynamics::config::to_toml(scenario);
        fs::write(&configuration, text).expect("the file can be written");
        let units = Self { folder };
        for model in Model::ALL {
            let made = Command::new(sim_host())
                .args(["fmu", model.name(), "--config"])
                .arg(&configuration)
                .arg("--out")
                .arg(units.path(model))
                .output()
                .expect("it starts");
            let message = String::from_utf8_lossy(&made.stderr);
            assert!(made.status.success(), "{model:?}: {message}");
        }
        units
    }

    fn path(&self, model: Model) -> PathBuf {
        self.file(&format!("{}.fmu", model.name()))
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a check of the script, which ends well if it passes.
    fn check(&self, name: &str, arguments: &[&Path]) {
        let mut script = python::script("check_fmu.py");
        script
            .arg(name)
            .args(Model::ALL.map(|model| self.path(model)));
        let output = script.args(arguments).output().expect("Python starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {message}");
    }
}

fn check(name: &str) {
    Units::new(&Scenario::reconstruction()).check(name, &[]);
}

#[test]
fn the_descriptions_are_valid() {
    check("valid");
}

#[test]
fn each_is_simulated_alone() {
    check("alone");
}

#[test]
fn every_step_size_gives_the_same() {
    check("step_sizes");
}

#[test]
fn a_stored_state_gives_the_same_again() {
    check("states");
}

#[test]
fn a_reset_instance_gives_the_same_again() {
    check("reset");
}

#[test]
fn instances_do_not_influence_one_another() {
    check("instances");
}

#[test]
fn bad_parameters_are_refused_with_name_value_and_range() {
    check("bad_parameters");
}

#[test]
fn bad_inputs_reach_the_gate_or_are_refused() {
    check("bad_inputs");
}

#[test]
fn bad_calls_are_refused() {
    check("bad_calls");
}

#[test]
fn bad_pointers_do_no_harm() {
    check("bad_pointers");
}

#[test]
fn bad_instances_are_refused() {
    check("bad_instances");
}

#[test]
fn the_archives_have_the_same_bytes_again() {
    let scenario = Scenario::reconstruction();
    let [one, other] = [Units::new(&scenario), Units::new(&scenario)];
    for model in Model::ALL {
        let read = |units: &Units| fs::read(units.path(model)).expect("it is there");
        assert!(read(&one) == read(&other), "{model:?}");
    }
}

/// Every number whose name carries a unit has one, and no other.
#[test]
fn numbers_without_a_unit_are_ratios() {
    let mut without: Vec<String> = Vec::new();
    for variable in Model::Vehicle.variables(&Scenario::reconstruction()) {
        let is_real = matches!(variable.start, fmu::variable::Value::Real(_));
        if is_real && variable.unit().is_none() {
            without.push(variable.name);
        }
    }
    let tire = |axle| ["curvature", "shape"].map(|name| format!("tires.{axle}.{name}"));
    let mut expected: Vec<String> = ["friction.coefficient", "gate.tick_tolerance"]
        .into_iter()
        .chain(["steering.efficiency", "steering.ratio"])
        .map(str::to_owned)
        .chain(tire("front"))
        .chain(tire("rear"))
        .collect();
    expected.sort();
    assert_eq!(without, expected);
}

/// A manoeuvre's first `duration_s`, s.
fn manoeuvre(file: &str, duration_s: f64) -> (Scenario<f64>, Manoeuvre) {
    let file = root().join("examples/manoeuvres").join(file);
    let (mut scenario, manoeuvre) = load(&file).expect("the example is valid");
    scenario.run.duration_s = duration_s;
    (scenario, manoeuvre)
}

fn vehicle(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> VehicleNode {
    VehicleNode::new(scenario, manoeuvre).expect("the example is valid")
}

/// The parameters of the vehicle that are not in a configuration.
fn parameters(manoeuvre: &Manoeuvre) -> BTreeMap<String, f64> {
    let Manoeuvre {
        sensors,
        servo_filter,
        ..
    } = manoeuvre;
    let mut parameters: BTreeMap<String, f64> = [
        (
            "manoeuvre.obey_speed_limit_rpm_per_s",
            manoeuvre.obey_speed_limit_rpm_per_s,
        ),
        ("manoeuvre.sensors.delay_ticks", sensors.delay_ticks as f64),
        ("manoeuvre.sensors.seed", sensors.seed as f64),
        (
            "manoeuvre.servo_filter.corner_rad_per_s",
            servo_filter.corner_rad_per_s,
        ),
        (
            "manoeuvre.servo_filter.dither_limit_rad",
            servo_filter.dither_limit_rad,
        ),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into();
    for (set, of) in [("resolution", sensors.resolution), ("noise", sensors.noise)] {
        for (name, value) in [
            ("wheel_speed_rpm", of.wheel_speed_rpm),
            ("yaw_rate_rad_per_s", of.yaw_rate_rad_per_s),
            ("steering_angle_rad", of.steering_angle_rad),
            ("steering_rate_rad_per_s", of.steering_rate_rad_per_s),
        ] {
            parameters.insert(format!("manoeuvre.sensors.{set}.{name}"), value);
        }
    }
    parameters
}

/// Wheel speed and current request at the end of each PWM period.
fn driver(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Vec<[f64; 2]> {
    let rate_hz = scenario.run.pwm_rate_hz;
    let own = (scenario.run.duration_s * rate_hz).round() as u32;
    let total = vehicle(scenario, manoeuvre).total_periods();
    let at_end_of = |period: u32| {
        let time_s = f64::from((period + 1).saturating_sub(total - own)) / rate_hz;
        let sine_a = manoeuvre
            .current_request_sine
            .map_or(0.0, |sine| sine.at(time_s));
        [
            manoeuvre.wheel_speed_rpm.at(time_s),
            manoeuvre.current_request_a.at(time_s) + sine_a,
        ]
    };
    (0..total).map(at_end_of).collect()
}

/// Outputs of both units, in the order of a row of the trace.
const OUTPUTS: [&str; 26] = [
    "duty_code",
    "duty",
    "bridge_on",
    "servo_v",
    "mode",
    "faults",
    "motor_voltage_v",
    "dither_amplitude_v",
    "wheel_speed_limit_rpm",
    "warnings",
    "sensor_counter",
    "challenge",
    "wheel_speed_rpm",
    "yaw_rate_rad_per_s",
    "steering_angle_rad",
    "steering_rate_rad_per_s",
    "current_request_a",
    "state.wheel_speed_rpm",
    "state.sideslip_rad",
    "state.yaw_rate_rad_per_s",
    "state.steering_angle_rad",
    "state.steering_rate_rad_per_s",
    "state.friction_mode",
    "motor_current_a",
    "dither_rad",
    "has_begun",
];

/// The outputs of both units in a PWM period of their loop: the ECU's at its start, the vehicle's at
/// its end.
struct Row {
    duty_code: u16,
    bridge_on: bool,
    actuation: Actuation<f32>,
    measurement: Measurement<f32>,
    /// Wheel speed, state, friction mode, motor current and dither.
    state: [f64; 8],
    has_begun: bool,
}

impl Row {
    #[rustfmt::skip]
    fn of(numbers: &[f64; 26]) -> Self {
        let [duty_code, duty, bridge_on, servo_v,
            mode, faults, motor_v, dither_v, limit_rpm, warnings, counter, challenge,
            speed, yaw_rate, angle, rate, request, state @ .., has_begun] = *numbers;
        assert_eq!(duty, duty_code / 2500.0);
        assert!((servo_v - (duty_code - 1250.0) * 24.0 / 2500.0).abs() < 1e-12);
        Self {
            duty_code: duty_code as u16,
            bridge_on: bridge_on != 0.0,
            actuation: Actuation {
                mode: Mode::from_code(mode as u8).expect("a mode"),
                faults: faults as u32,
                motor_voltage_v: motor_v as f32,
                dither_amplitude_v: dither_v as f32,
                wheel_speed_limit_rpm: limit_rpm as f32,
                warnings: warnings as u16,
                sensor_counter: counter as u8,
                bridge_on: bridge_on != 0.0,
                challenge: challenge as u8,
            },
            measurement: Measurement {
                wheel_speed_rpm: speed as f32,
                yaw_rate_rad_per_s: yaw_rate as f32,
                steering_angle_rad: angle as f32,
                steering_rate_rad_per_s: rate as f32,
                current_request_a: request as f32,
            },
            state,
            has_begun: has_begun != 0.0,
        }
    }

    fn assert_is(&self, record: &Record) {
        let expected = [
            record.wheel_speed_rpm,
            record.sideslip_rad,
            record.yaw_rate_rad_per_s,
            record.steering_angle_rad,
            record.steering_rate_rad_per_s,
            f64::from(record.friction_mode as u8),
            record.motor_current_a,
            record.dither_rad,
        ];
        let own = self.state.map(f64::to_bits);
        assert_eq!(
            own,
            expected.map(f64::to_bits),
            "{:?}, {record:?}",
            self.state
        );
    }
}

/// The loop of both units, coupled by fmpy.
fn coupled(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Vec<Row> {
    let units = Units::new(scenario);
    let [job, drive, trace] = ["job.json", "driver.f64", "trace.f64"].map(|name| units.file(name));
    let numbers = driver(scenario, manoeuvre);
    let bytes = numbers
        .as_flattened()
        .iter()
        .flat_map(|number| number.to_le_bytes());
    fs::write(&drive, bytes.collect::<Vec<u8>>()).expect("the file can be written");
    let parameters = parameters(manoeuvre);
    let parameters: Vec<String> = parameters
        .iter()
        .map(|(name, value)| match name.as_str() {
            "manoeuvre.sensors.delay_ticks" | "manoeuvre.sensors.seed" => {
                format!("{name:?}: {value}")
            }
            _ => format!("{name:?}: {value:?}"),
        })
        .collect();
    let text = format!(
        "{{\"driver\": {drive:?}, \"trace\": {trace:?}, \"parameters\": {{{}}}}}",
        parameters.join(", ")
    );
    fs::write(&job, text).expect("the file can be written");
    units.check("coupled", &[&job]);
    let variables = Model::ALL.map(|model| model.variables(scenario));
    let outputs = variables.iter().flatten();
    let outputs = outputs.filter(|one| one.causality == Causality::Output);
    assert!(outputs.map(|output| output.name.as_str()).eq(OUTPUTS));
    let trace = fs::read(&trace).expect("the trace is there");
    let (numbers, _) = trace.as_chunks();
    let numbers: Vec<f64> = numbers
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect();
    let (rows, rest) = numbers.as_chunks();
    assert!(rest.is_empty());
    rows.iter().map(Row::of).collect()
}

/// The exchange of `pil` with the signals of the units.
fn exchanges(rows: &[Row], periods_per_tick: usize) -> Vec<Exchange> {
    let mut actuator = Sender::new(ACTUATOR_DATA_ID);
    let mut sensor = Sender::new(SENSOR_DATA_ID);
    let mut challenge = 0;
    let exchange = |(period, row): (usize, &Row)| {
        let is_tick = (period + 1) % periods_per_tick == 0;
        // The first tick has no frame: its control task has not run yet.
        let sent = (is_tick && period >= periods_per_tick).then(|| {
            let actuation = row.actuation;
            challenge = actuation.challenge;
            encode_actuation(&actuation, &mut actuator)
        });
        let from_ecu = Packet {
            duty_code: row.duty_code,
            bridge_on: row.bridge_on,
            frame: sent,
        };
        let answer = is_tick.then(|| encode_measurement(&row.measurement, challenge, &mut sensor));
        let to_ecu = Packet {
            frame: answer,
            ..from_ecu
        };
        Exchange { from_ecu, to_ecu }
    };
    rows.iter().enumerate().map(exchange).collect()
}

fn assert_same(file: &str, rows: &[Row], expected: &Run) {
    let own = exchanges(rows, 10);
    assert_eq!(own.len(), expected.exchanges.len(), "{file}");
    for (period, (own, expected)) in own.iter().zip(&expected.exchanges).enumerate() {
        assert_eq!(own, expected, "{file}, period {period}");
    }
    let ticks = rows.chunks_exact(10).filter_map(|tick| tick.last());
    let ticks: Vec<&Row> = ticks.filter(|row| row.has_begun).collect();
    assert_eq!(ticks.len(), expected.records.len(), "{file}");
    for (row, record) in ticks.into_iter().zip(&expected.records) {
        row.assert_is(record);
    }
}

/// Every manoeuvre of the examples: duties, frames and the vehicle's state have the bits of the loop
/// in one program.
#[test]
fn the_loop_has_the_bits_of_pil() {
    let files = fs::read_dir(root().join("examples/manoeuvres")).expect("the examples are there");
    let files: Vec<String> = files
        .flatten()
        .map(|file| file.file_name().to_string_lossy().into_owned())
        .collect();
    assert_eq!(files.len(), 10);
    files.par_iter().for_each(|file| {
        let duration_s = if file == "speed-ramp.toml" { 12.0 } else { 5.0 };
        let (scenario, manoeuvre) = manoeuvre(file, duration_s);
        let mut ecu = Software::new(&ecu_scenario(&scenario, &manoeuvre)).expect("it is valid");
        let expected = run(&mut ecu, vehicle(&scenario, &manoeuvre), &mut || {});
        let expected = expected.expect("a program on the host is always reached");
        let rows = coupled(&manoeuvre.begin(&scenario), &manoeuvre);
        assert_same(file, &rows, &expected);
    });
}

/// The recording of the firmware in QEMU, as `sim-host pil --record` writes it, byte for byte.
#[test]
fn the_loop_has_the_bytes_of_the_firmware() {
    let (scenario, manoeuvre) = manoeuvre("constant-speed.toml", 4.0);
    let own = ecu_scenario(&scenario, &manoeuvre);
    let target = Target {
        image: image("bench"),
        machine: Machine::Mps2An386,
        link: LinkKind::Ticks,
        time_out: tests::TIME_OUT,
    };
    let node = vehicle(&scenario, &manoeuvre);
    let firmware = on_processor(&own, node, &target, &mut || {}).expect("it runs");
    let rows = coupled(&manoeuvre.begin(&scenario), &manoeuvre);
    let bytes = |exchanges: Vec<Exchange>| {
        let mut bytes = Vec::new();
        let scenario = own;
        let recording = Recording {
            scenario,
            exchanges,
        };
        recording
            .write(&mut bytes)
            .expect("memory takes every byte");
        bytes
    };
    assert!(bytes(exchanges(&rows, 10)) == bytes(firmware.run.exchanges));
}
