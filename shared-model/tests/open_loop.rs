//! The ECU's program in f32: its duty sequence, its rates, and when the dither sets in.

use shared_model::dither::{Application, Injection, Oscillator, Waveform};
use shared_model::open_loop::OpenLoop;
use shared_model::servo::{Duty, Pwm};
use shared_model::vehicle::State;
use shared_model::{InvalidScenario, Scenario, integrate};

const WAVEFORMS: [Waveform; 3] = [Waveform::None, Waveform::Square, Waveform::Sine];
const APPLICATIONS: [Application; 2] = [Application::Averaged, Application::Signal];

/// A run whose dither sets in at 20 ms: 20 steps of the averaged model, 200 of the one that sees
/// the signal.
fn scenario(waveform: Waveform, application: Application) -> Scenario<f32> {
    let mut scenario = Scenario::<f32>::reconstruction();
    let dither = &mut scenario.dither;
    (dither.waveform, dither.application) = (waveform, application);
    dither.amplitude_v = 0.5;
    dither.start_time_s = 0.02;
    scenario
}

fn all() -> impl Iterator<Item = Scenario<f32>> {
    WAVEFORMS
        .into_iter()
        .flat_map(|waveform| APPLICATIONS.map(|application| scenario(waveform, application)))
}

/// Duties of a number of PWM periods, and their number in each step.
fn duties(scenario: &Scenario<f32>, periods: usize) -> (Vec<Duty>, Vec<usize>) {
    let mut ecu = OpenLoop::new(scenario).unwrap();
    let (mut duties, mut counts) = (Vec::new(), Vec::new());
    while duties.len() < periods {
        let before = duties.len();
        ecu.step(|duty| duties.push(duty));
        counts.push(duties.len() - before);
    }
    (duties, counts)
}

/// Ten PWM periods of 10 kHz a step of the averaged model's 1 kHz; one where the model runs at the
/// PWM's rate.
#[test]
fn samples_per_step() {
    for scenario in all() {
        let expected = match scenario.dither.application {
            Application::Averaged => 10,
            Application::Signal => 1,
        };
        let (_, counts) = duties(&scenario, 100);
        assert!(counts.iter().all(|&count| count == expected), "{counts:?}");
        assert_eq!(scenario.samples_per_step() as usize, expected);
    }
}

/// The PWM carries the same voltage whichever way the model takes the dither: nothing but the
/// motor's before the start time, then one sample of the oscillator a period, its first at phase
/// zero in the very period of the start.
#[test]
fn duty_is_motor_plus_dither() {
    const START: usize = 200;
    for scenario in all() {
        let pwm = Pwm::new(&scenario.servo, 10e3);
        // 10 A through 0.3 ohm of a bus of 12 V, 2500 counts: 1250 + 3 V x 1250/12 V.
        let motor = pwm.duty(scenario.motor_voltage_v());
        assert_eq!(motor.code(), 1563, "312.5 counts above neutral, rounded up");
        let (duties, _) = duties(&scenario, 1000);
        assert!(
            duties[..START].iter().all(|&duty| duty == motor),
            "before the start"
        );

        let mut oscillator = Oscillator::new(&scenario.dither, 10e3_f32);
        for (k, &duty) in duties[START..].iter().enumerate() {
            let volts = 3.0 + 0.5 * oscillator.sample::<f32>();
            assert_eq!(
                duty,
                pwm.duty(volts),
                "sample {k} of {:?}",
                scenario.dither.waveform
            );
        }
        let seen: Vec<u16> = duties[START..].iter().map(|duty| duty.code()).collect();
        let (least, greatest) = (*seen.iter().min().unwrap(), *seen.iter().max().unwrap());
        match scenario.dither.waveform {
            Waveform::None => assert_eq!((least, greatest), (1563, 1563)),
            // 0.5 V are 52.08 counts. The sine's samples, 15.7 a turn, come within 1 % of its
            // peaks.
            Waveform::Square => assert_eq!((least, greatest), (1510, 1615)),
            Waveform::Sine => assert!(least.abs_diff(1510) <= 1 && greatest.abs_diff(1615) <= 1),
        }
        let first = match scenario.dither.waveform {
            Waveform::Square => 1615,
            Waveform::None | Waveform::Sine => 1563,
        };
        assert_eq!(
            duties[START].code(),
            first,
            "the dither starts at phase zero"
        );
    }
}

/// Half turns of the square wave: 2000 rad/s at 10 kHz are 31.4 samples a turn, so the halves have
/// 15 or 16.
#[test]
fn square_has_its_frequency() {
    let (duties, _) = duties(&scenario(Waveform::Square, Application::Averaged), 10_200);
    let edges: Vec<usize> = (201..10_200)
        .filter(|&k| duties[k] != duties[k - 1])
        .collect();
    assert!(
        edges
            .windows(2)
            .all(|pair| (15..=16).contains(&(pair[1] - pair[0])))
    );
    // A second holds 2000/(2 pi) = 318.3 turns.
    assert!(
        (edges.len() as f64 / 2.0 - 318.3).abs() <= 1.0,
        "{} edges",
        edges.len()
    );
}

/// The states up to the given time, by the integrator alone.
fn integrated(scenario: &Scenario<f32>, steps: u32) -> Vec<State<f32>> {
    let ecu = OpenLoop::new(scenario).unwrap();
    let model = shared_model::vehicle::Model::new(scenario);
    let mut state = *ecu.control.state();
    let mut oscillator = Oscillator::new(&scenario.dither, 10e3_f32);
    let start = scenario.dither_start_step();
    let step = |k| {
        // Before the start the model sees no dither. Then: its mean, or the sample of this very
        // step.
        let injection = if k < start {
            Injection::Off
        } else {
            scenario.dither.injection(oscillator.sample())
        };
        integrate::step(&model, &mut state, scenario.step_s(), injection);
        state
    };
    (0..steps).map(step).collect()
}

#[test]
fn model_sees_the_dither_from_its_start() {
    for scenario in all() {
        let mut ecu = OpenLoop::new(&scenario).unwrap();
        let start = scenario.dither_start_step();
        let expected = match scenario.dither.application {
            Application::Averaged => 20,
            Application::Signal => 200,
        };
        assert_eq!(start, expected, "20 ms");
        let mut silent = scenario;
        silent.dither.amplitude_v = 0.0;
        let mut without = OpenLoop::new(&silent).unwrap();
        for (k, state) in (1..).zip(integrated(&scenario, 3 * start)) {
            assert_eq!(*ecu.step(|_| {}), state, "step {k}");
            let same = *without.step(|_| {}) == state;
            let dithered = scenario.dither.waveform != Waveform::None;
            // One step later at most, because a sine's first sample is zero.
            assert!(k > start || same, "dither before its start, step {k}");
            assert!(k <= start + 1 || same != dithered, "no dither at step {k}");
        }
    }
}

/// The firmware's two interrupts and the host's one loop are equal.
#[test]
fn step_equals_the_two_tasks_by_hand() {
    for scenario in all() {
        let mut whole = OpenLoop::new(&scenario).unwrap();
        let OpenLoop {
            mut pwm,
            mut control,
        } = OpenLoop::new(&scenario).unwrap();
        for _ in 0..500 {
            let mut duties = Vec::new();
            let state = *whole.step(|duty| duties.push(duty));
            let mut sample = pwm.run();
            let mut by_hand = vec![sample.duty];
            while !sample.control_due {
                sample = pwm.run();
                by_hand.push(sample.duty);
            }
            let other = *control.run(sample.dither);
            assert_eq!(duties, by_hand);
            assert_eq!(state.x.map(f32::to_bits), other.x.map(f32::to_bits));
            assert_eq!(state.friction, other.friction);
            assert_eq!(control.state(), &other);
        }
    }
}

/// Zero start time: the first sample and the first step are dithered.
#[test]
fn dither_may_start_at_once() {
    let mut scenario = scenario(Waveform::Square, Application::Signal);
    scenario.dither.start_time_s = 0.0;
    let mut ecu = OpenLoop::new(&scenario).unwrap();
    let mut first = None;
    ecu.step(|duty| first = Some(duty.code()));
    assert_eq!(first, Some(1615));
}

/// The duty of the safe state is that of no voltage, whatever the motor's is.
#[test]
fn neutral_is_no_voltage() {
    let ecu = OpenLoop::new(&scenario(Waveform::Square, Application::Averaged)).unwrap();
    assert_eq!(ecu.pwm.neutral().code(), 1250);
}

#[test]
fn bad_scenario_makes_no_ecu() {
    let mut scenario = scenario(Waveform::Square, Application::Averaged);
    scenario.dither.amplitude_v = 9.5;
    let error = OpenLoop::new(&scenario).err();
    assert!(
        matches!(error, Some(InvalidScenario::OverVoltage { .. })),
        "{error:?}"
    );
}
