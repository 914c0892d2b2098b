//! Level 1 of the equivalence: the firmware's f32 run equals the host's, word for word, in every
//! form of the model.

use dynamics::simulate::simulate;
use dynamics::trace::Trace;
use pil::equivalence::bits;
use pil::equivalence::trace_of;
use qemu::Machine;
use qemu::telemetry::Recording;
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use shared_model::friction::FrictionLaw;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;
use tests::{record, record_with, scenario};

fn assert_same_bits(scenario: &Scenario<f32>, machine: Machine) {
    let recording = record(scenario, machine, 0);
    assert_same_at_host_pace(scenario, machine, &recording);
    let firmware = trace_of(&recording);
    let host = simulate(scenario).expect("the scenario is valid");
    let bits = bits(&firmware, &host);
    assert_eq!(bits.differing, 0, "{:?} in {scenario:?}", bits.first);
    let words = host.states.len() * 5 + host.duties.len();
    assert_eq!(bits.compared, words + 5, "everything was compared");
}

/// States and duty codes do not depend on the pace; nor does the end of a run.
fn assert_same_at_host_pace(scenario: &Scenario<f32>, machine: Machine, timed: &Recording) {
    let fast = record_with(scenario, machine, 0, &["pace=host"]);
    let bits = bits(&trace_of(&fast), &trace_of(timed));
    assert_eq!(bits.differing, 0, "{:?} in {scenario:?}", bits.first);
    let (end, timed_end) = (&fast.trailer, &timed.trailer);
    assert_eq!(
        (end.overruns, end.records, end.final_duty, end.neutral_duty),
        (
            0,
            timed_end.records,
            timed_end.final_duty,
            timed_end.neutral_duty
        )
    );
    // The control task is measured, the PWM interrupt is not.
    assert!(
        fast.records
            .iter()
            .all(|record| record.control_cost > 0 && record.pwm_cost == 0)
    );
    assert!(end.min_interval > end.max_interval);
}

#[test]
fn every_waveform_and_application() {
    for waveform in [Waveform::None, Waveform::Square, Waveform::Sine] {
        for application in [Application::Averaged, Application::Signal] {
            assert_same_bits(&scenario(waveform, application), Machine::Mps2An386);
        }
    }
}

#[test]
fn every_friction_law_dithered_and_not() {
    for law in [
        FrictionLaw::None,
        FrictionLaw::CoulombRate,
        FrictionLaw::PrintedAngle,
    ] {
        for dithered in [false, true] {
            for waveform in [Waveform::Square, Waveform::Sine] {
                let mut scenario = scenario(waveform, Application::Averaged);
                scenario.friction.law = law;
                scenario.friction.dithered = dithered;
                assert_same_bits(&scenario, Machine::Mps2An386);
            }
        }
    }
}

#[test]
fn magic_formula_and_exact_slip() {
    for waveform in [Waveform::None, Waveform::Square, Waveform::Sine] {
        let mut scenario = scenario(waveform, Application::Averaged);
        scenario.tires.model = TireModel::MagicFormula;
        scenario.vehicle.slip_form = SlipForm::Exact;
        // The mean of the Magic Formula over a sine takes half a million instructions per step.
        scenario.run.control_rate_hz = 20.0;
        assert_same_bits(&scenario, Machine::Mps2An386);
    }
}

#[test]
fn other_core_same_image_same_bits() {
    for waveform in [Waveform::None, Waveform::Sine] {
        assert_same_bits(&scenario(waveform, Application::Signal), Machine::Mps2An500);
    }
}

#[test]
fn other_rates() {
    let mut scenario = scenario(Waveform::Sine, Application::Averaged);
    scenario.run.control_rate_hz = 500.0;
    scenario.run.pwm_rate_hz = 20_000.0;
    assert_same_bits(&scenario, Machine::Mps2An386);
}

#[test]
fn the_same_run_twice_gives_the_same_telemetry() {
    let scenario = scenario(Waveform::Sine, Application::Signal);
    let (a, b) = (
        record(&scenario, Machine::Mps2An386, 0),
        record(&scenario, Machine::Mps2An386, 0),
    );
    assert_eq!(a.duties, b.duties);
    // Also the instructions of every task: virtual time is counted in them.
    assert_eq!(a.records, b.records);
}

/// The comparison must be able to fail: one flipped bit anywhere is seen, and named.
#[test]
fn one_flipped_bit_is_seen() {
    let scenario = scenario(Waveform::Square, Application::Averaged);
    let host = simulate(&scenario).expect("the scenario is valid");
    let firmware = trace_of(&record(&scenario, Machine::Mps2An386, 0));
    let differing = |change: &dyn Fn(&mut Trace)| {
        let mut changed = firmware.clone();
        change(&mut changed);
        bits(&changed, &host)
    };
    assert_eq!(differing(&|_| {}).differing, 0);
    for component in 0..4 {
        for bit in [0, 12, 22, 30] {
            let flipped = differing(&|trace| {
                let value = &mut trace.states[1234].x[component];
                *value = f32::from_bits((*value as f32).to_bits() ^ (1 << bit)).into();
            });
            assert_eq!(flipped.differing, 1, "bit {bit} of component {component}");
            let first = flipped.first.expect("the first difference is named");
            assert!(
                first.starts_with(&format!("component {component} after step 1235")),
                "{first}"
            );
        }
    }
    for bit in 0..16 {
        let flipped = differing(&|trace| trace.duties[777] ^= 1 << bit);
        assert_eq!(flipped.differing, 1, "bit {bit} of a duty code");
        assert!(flipped.first.expect("named").starts_with("duty code 777"));
    }
    let short = differing(&|trace| trace.states.truncate(1999));
    assert_eq!(short.differing, 1, "a missing state counts");
}
