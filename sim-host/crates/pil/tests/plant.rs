//! The plant against the model that it is made of, and the manoeuvres' files.

use dynamics::period::{Period, RIPPLE_TOLERANCE, period};
use dynamics::simulate::{settle, simulate, started_at};
use dynamics::trace::Trace;
use pil::manoeuvre::{Manoeuvre, load};
use pil::plant::Plant;
use pil::sensor::{SensorSettings, Sensors};
use pil::servo_filter::{Separation, ServoFilter};
use shared_model::dither::{Application, Injection, Oscillator, Waveform};
use shared_model::servo::{Duty, Pwm};
use shared_model::vehicle::{Model, State, YAW_RATE};
use shared_model::{Preset, Scenario, integrate};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

const PERIOD_S: f64 = 1e-4;
const PERIODS_A_SECOND: usize = 10_000;
const WAVEFORMS: [Waveform; 3] = [Waveform::None, Waveform::Square, Waveform::Sine];

fn plant(scenario: &Scenario<f64>, rpm: f64, current_a: f64) -> Plant {
    Plant::new(scenario, &Manoeuvre::constant(rpm, current_a)).expect("valid")
}

/// The undithered model's states at the PWM rate under a current.
fn undithered(scenario: &Scenario<f64>, current_a: f64, periods: usize) -> Vec<State<f64>> {
    let mut scenario = *scenario;
    scenario.steering.motor_current_a = current_a;
    let model = Model::new(&scenario);
    let mut state = model.initial_state(&scenario);
    let mut step = || {
        integrate::step(&model, &mut state, PERIOD_S, Injection::Off);
        state
    };
    (0..periods).map(|_| step()).collect()
}

/// The plant's states under constant duty.
fn under(plant: &mut Plant, duty: Duty, periods: usize) -> Vec<State<f64>> {
    let mut step = || {
        plant.step(duty);
        *plant.state()
    };
    (0..periods).map(|_| step()).collect()
}

/// Greatest distance of two motions, each component in its unit.
fn distance(a: &[State<f64>], b: &[State<f64>]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a.x - b.x).amax());
    apart.fold(0.0, f64::max)
}

/// A current that the PWM meets in whole counts: nothing is left of the servo, in both friction
/// laws, with any waveform.
#[test]
fn constant_duty_is_the_undithered_model() {
    for preset in [Preset::Reconstruction, Preset::Printed] {
        for waveform in WAVEFORMS {
            let mut scenario = Scenario::preset(preset);
            scenario.dither.waveform = waveform;
            let servo = scenario.servo;
            let pwm = Pwm::new(&servo, scenario.run.pwm_rate_hz);
            let duty = pwm.duty(3.0);
            let current_a = pwm.volts(duty) / servo.winding_resistance_ohm;
            let mut plant = plant(&scenario, 1750.0, current_a);
            let own = under(&mut plant, duty, 5 * PERIODS_A_SECOND);
            let model = undithered(&scenario, current_a, own.len());
            let apart = distance(&own, &model);
            assert!(apart < 1e-9, "{preset:?}, {waveform:?}: {apart:e}");
        }
    }
}

/// The paper's 10 A lie between two counts: the motion differs from the model's no more than that
/// of a model with the duty's own current does. The plant's current comes from 10 A to that one
/// within the filter's settling time.
#[test]
fn the_paper_current_is_met_within_the_quantisation() {
    let scenario = Scenario::reconstruction();
    let mut plant = plant(&scenario, 1750.0, 10.0);
    let duty = plant.pwm().duty(3.0);
    let quantised_a = plant.pwm().volts(duty) / scenario.servo.winding_resistance_ohm;
    assert!((quantised_a - 10.0).abs() > 1e-3);
    let own = under(&mut plant, duty, 5 * PERIODS_A_SECOND);
    assert!((plant.motor_current_a() - quantised_a).abs() < 1e-9);
    let model = undithered(&scenario, 10.0, own.len());
    let quantised = undithered(&scenario, quantised_a, own.len());
    let (apart, bound) = (distance(&own, &model), distance(&quantised, &model));
    assert!(
        apart > 0.5 * bound && apart < 1.05 * bound,
        "{apart:e}, quantisation alone {bound:e}"
    );
}

/// The plant under a dithered duty, settled, against the averaged model at the amplitude that the
/// duty codes have: the swing of the smoothed yaw rate, within what the signal at the PWM's rate
/// makes of it without servo (`docs/physics.md`: 0.4 % for the square wave, 0.06 % for the sine)
/// and 0.1 % for the servo's filter.
#[test]
fn dithered_duty_is_the_averaged_model() {
    for (waveform, amplitude_v, tolerance) in
        [(Waveform::Square, 0.1, 5e-3), (Waveform::Sine, 1.0, 1.6e-3)]
    {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = waveform;
        scenario.dither.start_time_s = 0.0;
        scenario.run.duration_s = 60.0;
        let start = settle(&scenario, 200.0).expect("valid");
        let mut scenario = started_at(&scenario, &start);

        let mut plant = plant(&scenario, 1750.0, 10.0);
        let mut oscillator = Oscillator::new(&scenario.dither, scenario.run.pwm_rate_hz);
        let (mut square_sum, mut sample_square_sum) = (0.0, 0.0);
        let motor_v = 3.0;
        let mut step = || {
            let sample: f64 = oscillator.sample();
            let duty = plant.pwm().duty(motor_v + amplitude_v * sample);
            square_sum += (plant.pwm().volts(duty) - motor_v).powi(2);
            sample_square_sum += sample * sample;
            plant.step(duty);
            *plant.state()
        };
        let states: Vec<_> = (0..60 * PERIODS_A_SECOND).map(|_| step()).collect();
        let own = Trace {
            step_s: PERIOD_S,
            initial: start,
            states,
            duties: Vec::new(),
            samples_per_step: 1,
            pwm_period: 0,
        };
        let own = own.smoothed(2.0 * TAU / scenario.dither.frequency_rad_per_s());

        scenario.dither.amplitude_v = (square_sum / sample_square_sum).sqrt();
        scenario.dither.application = Application::Averaged;
        let averaged = simulate(&scenario).expect("valid");
        let swing = |trace: &Trace| {
            let from = trace.index_after(30.0);
            let period = period(trace, from, RIPPLE_TOLERANCE);
            assert!(
                matches!(period, Period::Periodic { maxima: 1, .. }),
                "{period:?}"
            );
            let (low, high) = trace.range(YAW_RATE, from);
            high - low
        };
        let ratio = swing(&own) / swing(&averaged);
        assert!((ratio - 1.0).abs() < tolerance, "{waveform:?}: {ratio}");
    }
}

/// The figures in the documentation of `ServoFilter`.
#[test]
fn what_the_servo_filter_does() {
    let filter = ServoFilter::default();
    let settled = |voltage_v: &mut dyn FnMut() -> f64| {
        let mut separation = Separation::new(&filter, PERIOD_S, 0.0);
        let mut parts = || {
            let voltage_v = voltage_v();
            (voltage_v, separation.step(voltage_v))
        };
        for _ in 0..PERIODS_A_SECOND {
            parts();
        }
        (0..PERIODS_A_SECOND).map(|_| parts()).collect::<Vec<_>>()
    };
    let near = |value: f64, expected: f64| {
        assert!(
            (value / expected - 1.0).abs() < 5e-3,
            "{value}, expected {expected}"
        );
    };
    for (waveform, gain, leak) in [
        (Waveform::Square, 0.9990, 0.087),
        (Waveform::Sine, 0.9997, 0.0247),
    ] {
        let mut dither = Scenario::<f64>::reconstruction().dither;
        dither.waveform = waveform;
        let mut oscillator = Oscillator::new(&dither, 1.0 / PERIOD_S);
        let run = settled(&mut || oscillator.sample());
        let rms = |part: fn(&(f64, pil::servo_filter::Parts)) -> f64| {
            let sum: f64 = run.iter().map(|row| part(row).powi(2)).sum();
            sum.sqrt()
        };
        near(rms(|row| row.1.dither_v) / rms(|row| row.0), gain);
        let torque_v = run.iter().map(|row| row.1.torque_v.abs());
        near(torque_v.fold(0.0, f64::max), leak);
        assert!(
            run.iter().all(
                |(voltage_v, parts)| (parts.torque_v + parts.dither_v - voltage_v).abs() < 1e-15
            )
        );
    }
    // A ramp of 10 A/s through 0.3 ohm.
    let mut voltage_v = 0.0;
    let run = settled(&mut || {
        voltage_v += 3.0 * PERIOD_S;
        voltage_v
    });
    near(run.last().expect("some").1.dither_v, 0.030);
}

/// A step of the motor's voltage is an angle up to the limit, and then fades.
#[test]
fn a_step_of_the_motor_voltage_shakes_the_servo_up_to_its_limit() {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = Waveform::Square;
    let mut plant = plant(&scenario, 1750.0, 10.0);
    let neutral = plant.pwm().neutral();
    plant.step(neutral);
    assert_eq!(plant.dither_rad(), -ServoFilter::default().dither_limit_rad);
    under(&mut plant, neutral, PERIODS_A_SECOND);
    assert!(plant.dither_rad().abs() < 1e-12 && plant.motor_current_a().abs() < 1e-12);
}

#[test]
fn the_speed_follows_its_profile_and_the_limit() {
    let mut manoeuvre: Manoeuvre = toml::from_str(
        "name = 'ramp'
         wheel_speed_rpm = [[0, 1500], [1, 1600]]
         current_request_a = [[0, 10]]",
    )
    .expect("a manoeuvre");
    let speed_after = |manoeuvre: &Manoeuvre, limit_rpm: f64, time_s: f64| {
        let mut plant = Plant::new(&Scenario::reconstruction(), manoeuvre).expect("valid");
        plant.set_wheel_speed_limit_rpm(limit_rpm);
        let duty = plant.pwm().duty(3.0);
        under(&mut plant, duty, (time_s / PERIOD_S).round() as usize);
        plant.truth().wheel_speed_rpm
    };
    let near = |speed: f64, expected: f64| assert!((speed - expected).abs() < 1e-6, "{speed}");
    near(speed_after(&manoeuvre, 1200.0, 0.5), 1550.0);
    near(speed_after(&manoeuvre, f64::INFINITY, 2.0), 1600.0);
    manoeuvre.obey_speed_limit_rpm_per_s = 200.0;
    near(speed_after(&manoeuvre, f64::INFINITY, 0.5), 1550.0);
    near(speed_after(&manoeuvre, 1200.0, 0.5), 1400.0);
    near(speed_after(&manoeuvre, 1200.0, 3.0), 1200.0);
}

/// The sensors' settings, seen over ten thousand ticks of one truth.
fn told(settings: &SensorSettings) -> Vec<f32> {
    let truth = plant(&Scenario::reconstruction(), 1750.0, 10.0).truth();
    let mut sensors = Sensors::new(settings);
    let mut sample = || {
        let told = sensors.sample(&truth);
        assert_eq!(told.current_request_a, 10.0);
        told.steering_angle_rad
    };
    (0..10_000).map(|_| sample()).collect()
}

#[test]
fn noise_has_its_deviation_and_its_seed() {
    let mut settings = SensorSettings::default();
    assert!(told(&settings).iter().all(|&angle| angle == 0.46));
    settings.noise.steering_angle_rad = 0.01;
    let first = told(&settings);
    assert_eq!(first, told(&settings));
    let errors = || first.iter().map(|&angle| f64::from(angle) - 0.46);
    let mean = errors().sum::<f64>() / 1e4;
    let deviation = (errors().map(|error| error * error).sum::<f64>() / 1e4).sqrt();
    // Four standard errors.
    assert!(mean.abs() < 4e-4, "{mean}");
    assert!((deviation / 0.01 - 1.0).abs() < 0.03, "{deviation}");
    settings.seed = 2;
    assert_ne!(first, told(&settings));
    settings.resolution.steering_angle_rad = 0.25;
    assert!(told(&settings).iter().all(|&angle| angle == 0.5));
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/manoeuvres")
}

#[test]
fn every_example_is_a_manoeuvre_that_drives() {
    let mut names = Vec::new();
    for entry in folder().read_dir().expect("the folder is there") {
        let path = entry.expect("readable").path();
        let (scenario, manoeuvre) =
            load(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut plant = Plant::new(&scenario, &manoeuvre).expect("valid");
        let duty = plant.pwm().duty(scenario.motor_voltage_v());
        under(&mut plant, duty, PERIODS_A_SECOND);
        assert!(plant.record().time_s == 1.0);
        names.push(manoeuvre.name);
    }
    names.sort();
    let count = names.len();
    names.dedup();
    assert_eq!((names.len(), count), (10, 10), "{names:?}");
}

/// What `load` says of a manoeuvre's file with one thing changed.
fn refusal(change: impl Fn(&str) -> String) -> String {
    let text = std::fs::read_to_string(folder().join("sine-steer.toml")).expect("readable");
    let changed = change(&text);
    assert_ne!(text, changed);
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), changed).expect("written");
    load(file.path()).expect_err("must be refused").to_string()
}

#[test]
fn refusals_name_field_value_and_bounds() {
    let replace = |from: &'static str, to: &'static str| refusal(|text| text.replace(from, to));
    for (message, parts) in [
        (
            replace("[[0.0, 1750.0]]", "[[0.0, 0.5]]"),
            vec!["manoeuvre.wheel_speed_rpm", "0.5", "from 1 to 100000"],
        ),
        (
            replace("amplitude_a = 2.0", "amplitude_a = -2.0"),
            vec![
                "manoeuvre.current_request_sine.amplitude_a = -2",
                "from 0 to 1000",
            ],
        ),
        (
            replace("duration_s = 20.0", "duration_s = nan"),
            vec!["run.duration_s = NaN"],
        ),
        (
            replace("[run]", "[run]\nwheel_speed_rpm = 1600.0"),
            vec!["run.wheel_speed_rpm", "omitted"],
        ),
        (
            replace("waveform", "wave_form"),
            vec!["unknown key dither.wave_form", "dither.waveform"],
        ),
        (
            replace("name =", "sensor = 1\nname ="),
            vec!["[manoeuvre]", "unknown field `sensor`"],
        ),
        (
            replace(
                "name =",
                "sensors = { noise = { wheel_speed_rpm = -1.0 } }\nname =",
            ),
            vec!["manoeuvre.sensors.noise.wheel_speed_rpm = -1", "from 0"],
        ),
        (
            replace("name =", "sensors = { delay_ticks = 101 }\nname ="),
            vec!["manoeuvre.sensors.delay_ticks = 101", "from 0 to 100"],
        ),
        (
            replace("name =", "obey_speed_limit_rpm_per_s = -1\nname ="),
            vec!["manoeuvre.obey_speed_limit_rpm_per_s = -1", "from 0 to"],
        ),
        (
            replace("name =", "servo_filter = { corner_rad_per_s = 0 }\nname ="),
            vec!["manoeuvre.servo_filter.corner_rad_per_s = 0", "from 0.001"],
        ),
        (
            refusal(|text| text.split("[manoeuvre]").next().expect("a part").into()),
            vec!["no table [manoeuvre]"],
        ),
    ] {
        for part in parts {
            assert!(message.contains(part), "{message:?} lacks {part:?}");
        }
    }
}

#[test]
fn a_winding_without_resistance_is_refused() {
    let mut scenario = Scenario::reconstruction();
    scenario.servo.winding_resistance_ohm = 0.0;
    let plant = Plant::new(&scenario, &Manoeuvre::constant(1750.0, 10.0));
    let error = plant.expect_err("must be refused").to_string();
    assert_eq!(
        error,
        "servo.winding_resistance_ohm = 0: must be a finite number from 0.001 to 100"
    );
}

#[test]
fn records_are_columns() {
    let mut plant = plant(&Scenario::reconstruction(), 1750.0, 10.0);
    let neutral = plant.pwm().neutral();
    let start = plant.record();
    plant.step(neutral);
    let mut csv = csv::Writer::from_writer(Vec::new());
    for record in [start, plant.record()] {
        csv.serialize(record).expect("a buffer takes it");
    }
    let lines: Vec<String> = String::from_utf8(csv.into_inner().expect("a buffer takes it"))
        .expect("text")
        .lines()
        .map(String::from)
        .collect();
    assert_eq!(lines.len(), 3);
    assert!(lines[0].starts_with("time_s,wheel_speed_rpm,sideslip_rad,yaw_rate_rad_per_s"));
    assert_eq!(
        lines[1],
        "0.0,1750.0,0.15,0.0,0.46,0.0,positive,10.0,10.0,0.0,1563"
    );
    assert!(lines[2].starts_with("0.0001,1750.0,") && lines[2].ends_with(",1250"));
}
