//! Scenarios: every number's range, the checks across numbers, and settings by name.

use shared_model::dither::{Application, Waveform};
use shared_model::friction::FrictionLaw;
use shared_model::gate::Limits;
use shared_model::parameter::ParameterSet;
use shared_model::settings::{Choice, SettingError};
use shared_model::short::Short;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;
use shared_model::{InvalidScenario, Preset, Real, Scenario};
use std::str::FromStr;

const PRESETS: [Preset; 2] = [Preset::Reconstruction, Preset::Printed];

/// Calls the check with every section's name and place; adds up its counts.
macro_rules! each_section {
    ($check:ident::<$t:ty>) => {
        $check::<$t, _>("vehicle", |s| &mut s.vehicle)
            + $check::<$t, _>("tires.front", |s| &mut s.tires.front)
            + $check::<$t, _>("tires.rear", |s| &mut s.tires.rear)
            + $check::<$t, _>("steering", |s| &mut s.steering)
            + $check::<$t, _>("friction", |s| &mut s.friction)
            + $check::<$t, _>("dither", |s| &mut s.dither)
            + $check::<$t, _>("servo", |s| &mut s.servo)
            + $check::<$t, _>("controller", |s| &mut s.controller)
            + $check::<$t, _>("gate", |s| &mut s.gate)
            + $check::<$t, _>("run", |s| &mut s.run)
    };
}

/// Numbers of a scenario: chassis, two tyres, steering, friction, dither, servo, controller, gate and
/// run. The sections' lists and the map of a scenario are both held to it.
const NUMBERS: usize = 5 + 2 * 4 + 8 + 2 + 6 + 3 + 8 + 33 + 8;

/// The floats next to a bound.
trait Neighbours: Real + FromStr {
    fn down(self) -> Self;
    fn up(self) -> Self;
}

impl Neighbours for f32 {
    fn down(self) -> Self {
        self.next_down()
    }
    fn up(self) -> Self {
        self.next_up()
    }
}

impl Neighbours for f64 {
    fn down(self) -> Self {
        self.next_down()
    }
    fn up(self) -> Self {
        self.next_up()
    }
}

/// Every number of a section: a value that is not finite or not in its range is refused with a
/// message that names it; the bounds themselves are allowed. Returns how many there are.
fn ranges<T: Neighbours, P: ParameterSet<T>>(
    section: &'static str,
    of: fn(&mut Scenario<T>) -> &mut P,
) -> usize {
    for field in P::FIELDS {
        let (min, max) = (T::from_f64(field.min), T::from_f64(field.max));
        let [nan, infinity] = [f64::NAN, f64::INFINITY].map(T::from_f64);
        for bad in [nan, infinity, -infinity, min.down(), max.up()] {
            let mut scenario = Scenario::<T>::reconstruction();
            *(field.accessor)(of(&mut scenario)) = bad;
            let Err(InvalidScenario::OutOfRange(error)) = scenario.validate() else {
                panic!("{section}.{} = {bad:?} was taken", field.name);
            };
            assert_eq!((error.section, error.name), (section, field.name));
            assert_eq!((error.min, error.max), (field.min, field.max));
            // By bits, since NaN is not equal to itself.
            assert_eq!(error.value.to_bits(), bad.to_f64().to_bits());
            let message = format!(
                "{section}.{} = {}: must be a finite number from {} to {}",
                field.name,
                Short(error.value),
                Short(field.min),
                Short(field.max)
            );
            assert_eq!(error.to_string(), message);
        }
        for good in [min, max] {
            let mut scenario = Scenario::<T>::reconstruction();
            *(field.accessor)(of(&mut scenario)) = good;
            assert_eq!(
                of(&mut scenario).validate(),
                Ok(()),
                "{section}.{} = {good:?}",
                field.name
            );
        }
    }
    P::FIELDS.len()
}

/// A setting cannot widen a limit of the gate beyond about twice its default, or half of it where the
/// limit is a least value.
#[test]
fn no_setting_widens_a_limit_of_the_gate_beyond_its_hard_bound() {
    const LEAST: [&str; 3] = [
        "square_least_amplitude_v",
        "sine_least_amplitude_v",
        "dither_frequency_min_rad_per_s",
    ];
    let mut limits = Scenario::<f64>::reconstruction().gate;
    for field in Limits::<f64>::FIELDS {
        let default = *(field.accessor)(&mut limits);
        // The amplitude of the safe state may be wrong in both directions.
        let is_safe_state = field.name.ends_with("safe_amplitude_v");
        if LEAST.contains(&field.name) || is_safe_state {
            assert!(2.0 * field.min >= default, "{}", field.name);
        }
        if !LEAST.contains(&field.name) {
            assert!(field.max <= 2.0 * default, "{}", field.name);
        }
        let mut scenario = Scenario::<f64>::reconstruction();
        let setting = format!("gate.{}=1e5", field.name);
        assert_eq!(scenario.apply(&setting), Ok(()));
        assert!(scenario.validate().is_err(), "{setting}");
    }
}

/// Every number can be set by its name, and setting it changes no other.
fn set_by_name<T: Neighbours, P: ParameterSet<T>>(
    section: &'static str,
    of: fn(&mut Scenario<T>) -> &mut P,
) -> usize {
    for field in P::FIELDS {
        let mut scenario = Scenario::<T>::reconstruction();
        let mut expected = scenario;
        *(field.accessor)(of(&mut expected)) = T::from_f64(-0.125);
        let setting = format!("{section}.{}=-0.125", field.name);
        assert_eq!(scenario.apply(&setting), Ok(()), "{setting}");
        assert_eq!(scenario, expected, "{setting}");

        let misspelt = format!("{section}.{}x=1", field.name);
        assert_eq!(
            scenario.apply(&misspelt),
            Err(SettingError::UnknownKey),
            "{misspelt}"
        );
        let no_number = format!("{section}.{}=fast", field.name);
        assert_eq!(
            scenario.apply(&no_number),
            Err(SettingError::NotANumber),
            "{no_number}"
        );
        assert_eq!(scenario, expected, "a refused setting changes nothing");
    }
    P::FIELDS.len()
}

#[test]
fn every_number_has_its_range() {
    assert_eq!(each_section!(ranges::<f64>), NUMBERS);
    assert_eq!(each_section!(ranges::<f32>), NUMBERS);
}

#[test]
fn every_number_is_set_by_name() {
    assert_eq!(each_section!(set_by_name::<f64>), NUMBERS);
    assert_eq!(each_section!(set_by_name::<f32>), NUMBERS);
}

/// The number of numbers, from the other side: `map` visits every one of them.
#[test]
fn map_visits_every_number() {
    let visits = std::cell::Cell::new(0);
    let same = Scenario::<f64>::printed().map(&|value| {
        visits.set(visits.get() + 1);
        value
    });
    assert_eq!(visits.get(), NUMBERS);
    assert_eq!(same, Scenario::printed());
}

#[test]
fn presets_are_valid() {
    for preset in PRESETS {
        assert_eq!(Scenario::<f64>::preset(preset).validate(), Ok(()));
        assert_eq!(Scenario::<f32>::preset(preset).validate(), Ok(()));
        let rounded = Scenario::<f64>::preset(preset).map(&|value| value as f32);
        assert_eq!(
            Scenario::<f32>::preset(preset),
            rounded,
            "one scenario in both arithmetics"
        );
    }
}

/// The message of a reconstruction with the given settings.
fn refusal(settings: &[&str]) -> String {
    let mut scenario = Scenario::<f64>::reconstruction();
    for setting in settings {
        scenario.apply(setting).unwrap();
    }
    let in_f32 = scenario.map(&|value| value as f32).validate();
    assert_eq!(
        scenario.validate().is_err(),
        in_f32.is_err(),
        "{settings:?}"
    );
    scenario
        .validate()
        .map_or_else(|error| error.to_string(), |()| "accepted".into())
}

#[test]
fn rates_must_fit_together() {
    let message = |control, pwm| {
        format!(
            "run.pwm_rate_hz = {pwm} and run.control_rate_hz = {control}: both must be whole numbers, the first a \
             multiple of the second, at most 1000 times it"
        )
    };
    for (control, pwm) in [
        ("3000", "10000"),
        ("1000.5", "10005"),
        ("1000", "10000.5"),
        ("20000", "10000"),
    ] {
        let settings = [
            format!("run.control_rate_hz={control}"),
            format!("run.pwm_rate_hz={pwm}"),
        ];
        assert_eq!(
            refusal(&[&settings[0], &settings[1]]),
            message(control, pwm)
        );
    }
    assert_eq!(refusal(&["run.control_rate_hz=2500"]), "accepted");
    assert_eq!(refusal(&["run.control_rate_hz=10000"]), "accepted");
}

/// The presets' 25 MHz timer: 16 bits hold no carrier below 381.5 Hz, and two counts are the least
/// duty resolution.
#[test]
fn carrier_must_fit_the_timer() {
    let counts = |counts| {
        format!(
            "servo.timer_clock_hz over run.pwm_rate_hz is {counts} counts: must be from 2 to 65535"
        )
    };
    assert_eq!(
        refusal(&["run.control_rate_hz=10", "run.pwm_rate_hz=380"]),
        counts(65789)
    );
    assert_eq!(refusal(&["servo.timer_clock_hz=14000"]), counts(1));
    assert_eq!(refusal(&["servo.timer_clock_hz=1000"]), counts(0));
    assert_eq!(
        refusal(&["run.control_rate_hz=10", "run.pwm_rate_hz=390"]),
        "accepted"
    );
    assert_eq!(refusal(&["servo.timer_clock_hz=655350000"]), "accepted");
    assert_eq!(refusal(&["servo.timer_clock_hz=655360000"]), counts(65536));
}

#[test]
fn duration_must_be_a_step_and_fit_the_counters() {
    assert_eq!(
        refusal(&["run.duration_s=0"]),
        "run.duration_s = 0: must be a finite number from 0.0001 to 1000000"
    );
    assert_eq!(
        refusal(&["run.duration_s=0.0004"]),
        "run.duration_s = 0.0004: must be from 0.001 (one step) to 400000"
    );
    assert_eq!(
        refusal(&["run.duration_s=400001"]),
        "run.duration_s = 400001: must be from 0.001 (one step) to 400000"
    );
    assert_eq!(refusal(&["run.duration_s=0.001"]), "accepted");
    assert_eq!(refusal(&["run.duration_s=400000"]), "accepted");
    // Ten times as many steps of the model, and a tenth of the least length.
    assert_eq!(
        refusal(&["run.duration_s=0.0004", "dither.application=signal"]),
        "accepted"
    );
}

/// The bus has 12 V; the motor takes 3 V of it in either direction.
#[test]
fn voltage_must_fit_the_bus() {
    let message = "dither.amplitude_v = 9.5: with 3 V for the motor current it exceeds servo.bus_voltage_v = 12; at most 9 \
                   V are left for the dither";
    let settings = ["dither.waveform=square", "dither.amplitude_v=9.5"];
    assert_eq!(refusal(&settings), message);
    let left = [
        "dither.waveform=sine",
        "dither.amplitude_v=9.5",
        "steering.motor_current_a=-10",
    ];
    assert_eq!(refusal(&left), message.replace("with 3", "with -3"));
    assert_eq!(
        refusal(&["dither.waveform=sine", "dither.amplitude_v=9"]),
        "accepted"
    );
    assert_eq!(
        refusal(&["dither.amplitude_v=9.5"]),
        "accepted",
        "no dither, no voltage"
    );
    assert_eq!(
        refusal(&["steering.motor_current_a=50"]),
        "dither.amplitude_v = 0: with 15 V for the motor current it exceeds servo.bus_voltage_v = 12; at most 0 V are left \
         for the dither"
    );
}

/// Damping over inertia is 4000 1/s; at 1 rpm the tyres are faster than that; and 9 rad of dither
/// make them as stiff.
#[test]
fn the_step_must_be_stable() {
    let stiff = "steering.inertia_kg_m2=0.05";
    assert_eq!(
        refusal(&[stiff]),
        "run.control_rate_hz = 1000: the step is too long; 0.001 s times the model's fastest rate, 4014 1/s, is 4.01, and must be \
         at most 2.6: at least 1544 Hz, a step of 6.48e-4 s"
    );
    let rates = ["run.control_rate_hz=2000", "run.pwm_rate_hz=10000"];
    assert_eq!(refusal(&[stiff, rates[0], rates[1]]), "accepted");
    assert_eq!(refusal(&[stiff, "dither.application=signal"]), "accepted");
    let far = ["steering.inertia_kg_m2=0.001", "dither.application=signal"];
    assert!(refusal(&far).starts_with("run.pwm_rate_hz = 10000: the step is too long"));
    for setting in [
        &["run.wheel_speed_rpm=1"][..],
        &["dither.waveform=square", "dither.amplitude_v=9"],
        &["tires.model=magic_formula", "run.wheel_speed_rpm=1"],
    ] {
        let message = refusal(setting);
        assert!(
            message.starts_with("run.control_rate_hz = 1000: the step is too long"),
            "{message}"
        );
    }
}

#[test]
fn steps_and_samples_follow_the_rates() {
    let mut scenario = Scenario::<f32>::reconstruction();
    assert_eq!(
        (
            scenario.steps(),
            scenario.dither_start_step(),
            scenario.samples_per_step()
        ),
        (20_000, 3000, 10)
    );
    scenario.dither.application = Application::Signal;
    assert_eq!(
        (
            scenario.steps(),
            scenario.dither_start_step(),
            scenario.samples_per_step()
        ),
        (200_000, 30_000, 1)
    );
}

/// f32 holds the length of a long run to no better than its 24 bits, but the count of its steps is
/// the nearest one.
#[test]
fn long_runs_have_the_nearest_count() {
    let mut scenario = Scenario::<f32>::reconstruction();
    for steps in [4_194_305_u32, 8_388_609, 12_582_913, 16_777_215] {
        scenario.run.duration_s = steps as f32 / 1000.0;
        let exact = f64::from(scenario.run.duration_s) * 1000.0;
        let error = (f64::from(scenario.steps()) - exact).abs();
        assert!(error <= 0.5, "{} steps for {exact}", scenario.steps());
    }
}

/// Names of a choice are read back as that choice, and only they.
fn names<C: Choice + std::fmt::Debug>(names: &[&str]) {
    let known: Vec<&str> = C::ALL.iter().map(|choice| choice.name()).collect();
    assert_eq!(known, names, "the configuration file's names");
    for (index, &choice) in C::ALL.iter().enumerate() {
        let name = choice.name();
        assert_eq!(C::from_name(name), Some(choice));
        assert!(
            C::ALL[..index].iter().all(|&other| other != choice),
            "{choice:?} has one name"
        );
        assert_eq!(C::from_name(&name.to_uppercase()), None);
    }
    assert_eq!(C::from_name(""), None);
}

#[test]
fn choices_have_their_names() {
    names::<Preset>(&["reconstruction", "printed"]);
    names::<SlipForm>(&["small_angle", "exact"]);
    names::<TireModel>(&["cubic", "magic_formula"]);
    names::<FrictionLaw>(&["none", "coulomb_rate", "printed_angle"]);
    names::<Waveform>(&["none", "square", "sine"]);
    names::<Application>(&["averaged", "signal"]);
    names::<bool>(&["true", "false"]);
}

/// Every choice arrives at its place, and an unknown name is refused.
fn chosen<C: Choice + std::fmt::Debug>(key: &str, of: fn(&mut Scenario<f64>) -> &mut C) {
    for &choice in C::ALL {
        let name = choice.name();
        let mut scenario = Scenario::reconstruction();
        let mut expected = scenario;
        *of(&mut expected) = choice;
        assert_eq!(scenario.apply(&format!("{key}={name}")), Ok(()));
        assert_eq!(scenario, expected, "{key}={name}");
        assert_eq!(
            scenario.apply(&format!("{key}=other")),
            Err(SettingError::UnknownChoice)
        );
        assert_eq!(
            scenario.apply(&format!("{key}x={name}")),
            Err(SettingError::UnknownKey),
            "misspelt"
        );
        assert_eq!(scenario, expected, "a refused setting changes nothing");
    }
}

#[test]
fn choices_are_set_by_name() {
    chosen("vehicle.slip_form", |s| &mut s.vehicle.slip_form);
    chosen("tires.model", |s| &mut s.tires.model);
    chosen("friction.law", |s| &mut s.friction.law);
    chosen("friction.dithered", |s| &mut s.friction.dithered);
    chosen("dither.waveform", |s| &mut s.dither.waveform);
    chosen("dither.application", |s| &mut s.dither.application);
}

#[test]
fn preset_replaces_what_was_set_before() {
    let mut scenario = Scenario::<f64>::reconstruction();
    scenario.apply("run.wheel_speed_rpm=1600").unwrap();
    scenario.apply("preset=printed").unwrap();
    assert_eq!(scenario, Scenario::printed());
    assert_eq!(
        scenario.apply("preset=paper"),
        Err(SettingError::UnknownChoice)
    );
}

#[test]
fn malformed_settings_are_refused() {
    use SettingError::{NoEqualsSign, NotANumber, UnknownKey};
    let mut scenario = Scenario::<f32>::reconstruction();
    for (setting, error) in [
        ("", NoEqualsSign),
        ("run.duration_s", NoEqualsSign),
        ("run.duration_s:20", NoEqualsSign),
        ("=20", UnknownKey),
        ("duration_s=20", UnknownKey),
        ("tires.duration_s=20", UnknownKey),
        ("tire.front.shape=1", UnknownKey),
        ("Run.duration_s=20", UnknownKey),
        ("run.duration_s =20", UnknownKey),
        ("run.duration_s=", NotANumber),
        ("run.duration_s=20 s", NotANumber),
        ("run.duration_s=20=20", NotANumber),
        ("run.duration_s=1,5", NotANumber),
        // A misspelt key is that, whatever its value is.
        ("dither.wavform=square", UnknownKey),
    ] {
        assert_eq!(scenario.apply(setting), Err(error), "{setting:?}");
    }
    assert_eq!(scenario, Scenario::reconstruction(), "nothing was changed");
    let reasons = [
        NoEqualsSign,
        UnknownKey,
        NotANumber,
        SettingError::UnknownChoice,
    ]
    .map(SettingError::reason);
    assert_eq!(
        reasons,
        [
            "must be key=value",
            "no parameter of that name",
            "the value is not a number",
            "the value is none of the parameter's names"
        ]
    );
}

/// A number that is none, but parses, gets in by name and is stopped by the check of the ranges.
#[test]
fn infinite_settings_are_stopped_by_validate() {
    for value in ["nan", "inf", "-inf", "1e999"] {
        let mut scenario = Scenario::<f32>::reconstruction();
        scenario.apply(&format!("vehicle.mass_kg={value}")).unwrap();
        assert!(
            matches!(scenario.validate(), Err(InvalidScenario::OutOfRange(_))),
            "{value}"
        );
    }
}

/// The configuration file's names are those of the settings.
#[cfg(feature = "serde")]
mod file {
    use super::*;
    use serde::de::value::{Error, MapDeserializer, StrDeserializer};
    use serde::de::{DeserializeOwned, IntoDeserializer};
    use shared_model::policy::Suppression;

    fn choice<C: Choice + DeserializeOwned + std::fmt::Debug>() {
        for &choice in C::ALL {
            let name = choice.name();
            let text: StrDeserializer<'_, Error> = name.into_deserializer();
            assert_eq!(C::deserialize(text).unwrap(), choice, "{name}");
        }
    }

    #[test]
    fn choices_have_the_settings_names() {
        choice::<SlipForm>();
        choice::<TireModel>();
        choice::<FrictionLaw>();
        choice::<Waveform>();
        choice::<Application>();
        choice::<Suppression>();
    }

    /// A set of numbers only is read from its `FIELDS` names, all of them, and from no other.
    fn numbers<P: ParameterSet<f64> + DeserializeOwned + PartialEq + std::fmt::Debug>(set: P) {
        let mut copy = set;
        let mut entries: Vec<(&str, f64)> = P::FIELDS
            .iter()
            .map(|field| (field.name, *(field.accessor)(&mut copy)))
            .collect();
        let read = |entries: &[(&'static str, f64)]| {
            P::deserialize(MapDeserializer::<_, Error>::new(entries.iter().copied()))
        };
        assert_eq!(read(&entries).unwrap(), set);
        entries.push(("wheel_sped_rpm", 1.0));
        assert!(read(&entries).is_err(), "a misspelt name is an error");
    }

    #[test]
    fn numbers_have_the_settings_names() {
        let scenario = Scenario::<f64>::reconstruction();
        numbers(scenario.tires.front);
        numbers(scenario.steering);
        numbers(scenario.servo);
        numbers(scenario.gate);
        numbers(scenario.run);
    }
}
