//! What the print gets wrong or leaves open, each with the experiment that shows it.

use super::job::Quality;
use super::material::{Made, Material, Named};
use dynamics::attractor::attractor;
use dynamics::sweep::{RunControl, SweepError, Timing};
use engine::is_bounded;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::dither::{Injection, Waveform};
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::tire::{HIGH_FRICTION_ROAD, LOW_FRICTION_ROAD, Road};
use shared_model::vehicle::{Model, SIDESLIP, YAW_RATE};

const GRAVITY_M_PER_S2: f64 = 9.81;
/// Length of the run with (14)'s first line as printed, s.
const PRINTED_RUN_S: f64 = 200.0;

/// The experiments.
pub fn errata(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let timing = match quality {
        Quality::Quick => Timing::new(60.0, 160.0),
        Quality::Full => Timing::new(200.0, 500.0),
    }?;
    let base = &named.scenario;
    let kind = |scenario: &Scenario<f64>| -> Result<String, SweepError> {
        let attractor = attractor(scenario, timing, true)?;
        (watch.done)();
        Ok(match attractor.diverges_at_s {
            Some(time_s) => format!("diverges after {time_s:.1} s"),
            None => attractor.kind.to_string(),
        })
    };
    let changed = |change: &dyn Fn(&mut Scenario<f64>)| {
        let mut scenario = *base;
        change(&mut scenario);
        scenario
    };
    let mut findings = vec![(
        "Table 1's labels of the roads are swapped".into(),
        format!(
            "(D_f + D_r)/(m g) is {:.2} for set A, labelled high friction, and {:.2} for set B, labelled low",
            adhesion(base, &LOW_FRICTION_ROAD),
            adhesion(base, &HIGH_FRICTION_ROAD)
        ),
    )];

    let set_b = changed(&|scenario| {
        (scenario.tires.front, scenario.tires.rear) = HIGH_FRICTION_ROAD;
    });
    findings.push((
        "Set B with the cubic tyre".into(),
        format!(
            "front cubic coefficient {:.0} N/rad^3, not positive, so nothing bounds the force; at {} rpm the motion {}",
            set_b.tires.front.cubic().cubic_n_per_rad3,
            set_b.run.wheel_speed_rpm,
            kind(&set_b)?
        ),
    ));

    let usual_sign = changed(&|scenario| {
        scenario.tires.front.peak_n *= -1.0;
        scenario.tires.rear.peak_n *= -1.0;
    });
    findings.push((
        "Sign of the cornering force".into(),
        format!(
            "as printed (D > 0) the motion at {} rpm is {}; with the usual vehicle sign (D < 0): {}",
            base.run.wheel_speed_rpm,
            kind(base)?,
            kind(&usual_sign)?
        ),
    ));

    let frictionless = changed(&|scenario| scenario.friction.law = FrictionLaw::None);
    let own = attractor(&frictionless, timing, true)?;
    (watch.done)();
    findings.push((
        "(14) misprints its first line".into(),
        format!(
            "(1) and (20) subtract x2 from the lateral term; with (14)'s product of the two, and without friction, the motion at \
             {} rpm {}; with the difference it is {}, beta from {:.3} to {:.3} rad",
            base.run.wheel_speed_rpm,
            printed_lateral(&frictionless)?,
            own.kind,
            own.lower[SIDESLIP],
            own.upper[SIDESLIP]
        ),
    ));

    let mut laws = Vec::new();
    for (law, word) in [
        (FrictionLaw::CoulombRate, "Coulomb on the rate"),
        (FrictionLaw::PrintedAngle, "sign of the angle"),
        (FrictionLaw::None, "none"),
    ] {
        let kinds = [1600.0, 1750.0, 1845.0, 1880.0].map(|rpm| {
            kind(&changed(&|scenario| {
                scenario.friction.law = law;
                scenario.friction.dithered = false;
                scenario.run.wheel_speed_rpm = rpm;
            }))
        });
        let kinds = kinds.into_iter().collect::<Result<Vec<_>, _>>()?;
        laws.push(format!("{word}: {}", kinds.join(", ")));
    }
    findings.push((
        "Friction by the sign of the angle, as (13) prints it, or of the rate".into(),
        format!("at 1600, 1750, 1845 and 1880 rpm: {}", laws.join("; ")),
    ));

    let other_lobe = changed(&|scenario| {
        scenario.run.wheel_speed_rpm = 1600.0;
        scenario.run.sideslip_rad *= -1.0;
        scenario.run.steering_angle_rad *= -1.0;
    });
    findings.push((
        "Starts are not given, and there are several attractors".into(),
        format!(
            "at 1600 rpm the start with delta_f = {} rad ends on {}, the mirrored one on {}",
            base.run.steering_angle_rad,
            kind(&changed(&|scenario| scenario.run.wheel_speed_rpm = 1600.0))?,
            kind(&other_lobe)?
        ),
    ));

    let sine = |rad_per_volt: f64| {
        changed(&|scenario| {
            scenario.run.wheel_speed_rpm = 1750.0;
            scenario.dither.waveform = Waveform::Sine;
            scenario.dither.amplitude_v = 1.0;
            scenario.dither.sine_rad_per_volt = rad_per_volt;
        })
    };
    findings.push((
        "The dither's volts enter an angle".into(),
        format!(
            "a sine of 1.0 V gives {} with 1/(2 pi) rad/V, and {} with 1 rad/V",
            kind(&sine(1.0 / std::f64::consts::TAU))?,
            kind(&sine(1.0))?
        ),
    ));

    let mut frictions = Vec::new();
    for (law, dithered, word) in [
        (FrictionLaw::CoulombRate, false, "not dithered"),
        (FrictionLaw::CoulombRate, true, "dithered"),
        (FrictionLaw::None, false, "absent"),
    ] {
        let kinds = [(Waveform::Square, 0.1), (Waveform::Sine, 1.0)].map(|(waveform, volts)| {
            kind(&changed(&|scenario| {
                scenario.run.wheel_speed_rpm = 1750.0;
                scenario.friction.law = law;
                scenario.friction.dithered = dithered;
                scenario.dither.waveform = waveform;
                scenario.dither.amplitude_v = volts;
            }))
        });
        let kinds = kinds.into_iter().collect::<Result<Vec<_>, _>>()?;
        frictions.push(format!("{word}: {}", kinds.join(", ")));
    }
    findings.push((
        "Dither in the friction term".into(),
        format!(
            "square of 0.1 V and sine of 1.0 V with Coulomb friction {}",
            frictions.join("; ")
        ),
    ));
    Ok(Material {
        findings,
        ..Material::default()
    })
}

/// What becomes of the frictionless motion if the first line of (14) is taken as printed, beta' = (F_f + F_r)/(m v) times gamma
/// instead of less gamma.
fn printed_lateral(scenario: &Scenario<f64>) -> Result<String, SweepError> {
    scenario.validate()?;
    let model = Model::new(scenario);
    let slope = |x: &Vector4<f64>| {
        let mut slope = model.derivative(x, Injection::Off, FrictionMode::Neutral);
        let lateral = slope[SIDESLIP] + x[YAW_RATE];
        slope[SIDESLIP] = lateral * x[YAW_RATE];
        slope
    };
    let step_s = scenario.step_s();
    let mut x = model.initial_state(scenario).x;
    let steps = (PRINTED_RUN_S / step_s) as u32;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for step in 1..=steps {
        // The midpoint rule: how large the motion is does not hang on the last digits.
        x += slope(&(x + slope(&x) * (0.5 * step_s))) * step_s;
        if !is_bounded(&x) {
            return Ok(format!("diverges after {:.1} s", f64::from(step) * step_s));
        }
        if step > steps / 2 {
            (low, high) = (low.min(x[SIDESLIP]), high.max(x[SIDESLIP]));
        }
    }
    Ok(format!("keeps beta from {low:.3} to {high:.3} rad"))
}

/// Greatest lateral force of a road's tyres over the vehicle's weight.
fn adhesion(scenario: &Scenario<f64>, road: &Road) -> f64 {
    (road.0.peak_n + road.1.peak_n) / (scenario.vehicle.mass_kg * GRAVITY_M_PER_S2)
}
