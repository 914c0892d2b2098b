//! Errors and gaps of the print, each with the experiment that shows it.

use super::job::Quality;
use super::material::{Made, Material, Named};
use dynamics::attractor::{Attractor, attractor};
use dynamics::sweep::{RunControl, SweepError, Timing};
use engine::is_bounded;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::dither::{Injection, Waveform};
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::tire::{HIGH_FRICTION_ROAD, LOW_FRICTION_ROAD, Road};
use shared_model::vehicle::{Model, SIDESLIP, YAW_RATE};
use std::f64::consts::TAU;

const GRAVITY_M_PER_S2: f64 = 9.81;
/// Length of the run with (14)'s first line as printed, s.
const PRINTED_RUN_S: f64 = 200.0;
/// Speed at which the paper dithers, rpm.
const DITHERED_RPM: f64 = 1750.0;

/// An error or a gap of the print.
struct Erratum {
    /// Number in `docs/paper.md`.
    id: &'static str,
    title: &'static str,
    /// The print, in this project's words.
    claim: &'static str,
    /// The reading of this project.
    correction: &'static str,
    experiment: fn(&Experiment) -> Result<String, SweepError>,
}

const ERRATA: [Erratum; 8] = [
    Erratum {
        id: "E1",
        title: "Table 1's labels of the roads are swapped",
        claim: "set A of Table 1 is labelled high friction, set B low friction",
        correction: "set A is the low-friction road, on which the results are",
        experiment: road_labels,
    },
    Erratum {
        id: "E1",
        title: "Set B with the cubic tyre",
        claim: "the cubic tyre is given for both roads",
        correction: "only set A has a bounded cubic characteristic",
        experiment: cubic_set_b,
    },
    Erratum {
        id: "E2",
        title: "Sign of the cornering force",
        claim: "D > 0 for both axles",
        correction: "as printed",
        experiment: force_sign,
    },
    Erratum {
        id: "E3",
        title: "(14) misprints its first line",
        claim: "the first line of (14) multiplies by x2",
        correction: "subtract x2, as (1) and (20) do",
        experiment: first_line,
    },
    Erratum {
        id: "E5",
        title: "Friction by the sign of the angle, as (13) prints it, or of the rate",
        claim: "(13) has the sign of the steering angle",
        correction: "the sign of the steering rate",
        experiment: friction_laws,
    },
    Erratum {
        id: "E7",
        title: "Starts are not given, and there are several attractors",
        claim: "no initial state is given",
        correction: "the preset gives the initial state",
        experiment: starts,
    },
    Erratum {
        id: "E8",
        title: "The dither's volts enter an angle",
        claim: "a voltage is added to an angle",
        correction: "gains in rad/V: 1 for the square wave, 1/(2 pi) for the sine",
        experiment: volts,
    },
    Erratum {
        id: "E9",
        title: "Dither in the friction term",
        claim: "open: whether the dither acts on the friction term",
        correction: "none: the choice does not decide the result",
        experiment: dithered_friction,
    },
];

/// Runs all experiments.
pub fn errata(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let experiment = Experiment {
        base: &named.scenario,
        timing: match quality {
            Quality::Quick => Timing::new(60.0, 160.0),
            Quality::Full => Timing::new(200.0, 500.0),
        }?,
        watch,
    };
    let finding = |erratum: &Erratum| {
        let measured = (erratum.experiment)(&experiment)?;
        Ok((
            format!("{}: {}", erratum.id, erratum.title),
            format!(
                "print: {}; correction: {}; measured: {measured}",
                erratum.claim, erratum.correction
            ),
        ))
    };
    Ok(Material {
        findings: ERRATA
            .iter()
            .map(finding)
            .collect::<Result<_, SweepError>>()?,
        ..Material::default()
    })
}

/// The conditions that all experiments share.
struct Experiment<'a> {
    base: &'a Scenario<f64>,
    timing: Timing,
    watch: RunControl<'a>,
}

impl Experiment<'_> {
    /// The base scenario with a change.
    fn changed(&self, change: impl Fn(&mut Scenario<f64>)) -> Scenario<f64> {
        let mut scenario = *self.base;
        change(&mut scenario);
        scenario
    }

    fn attractor(&self, scenario: &Scenario<f64>) -> Result<Attractor, SweepError> {
        let attractor = attractor(scenario, self.timing, true)?;
        (self.watch.done)();
        Ok(attractor)
    }

    /// The regime of a scenario in words.
    fn regime(&self, scenario: &Scenario<f64>) -> Result<String, SweepError> {
        let attractor = self.attractor(scenario)?;
        Ok(match attractor.diverges_at_s {
            Some(time_s) => format!("diverges after {time_s:.1} s"),
            None => attractor.kind.to_string(),
        })
    }

    /// The regimes of several scenarios, separated by commas.
    fn regimes(&self, scenarios: &[Scenario<f64>]) -> Result<String, SweepError> {
        let regimes = scenarios.iter().map(|scenario| self.regime(scenario));
        Ok(regimes.collect::<Result<Vec<_>, _>>()?.join(", "))
    }
}

fn road_labels(experiment: &Experiment) -> Result<String, SweepError> {
    Ok(format!(
        "(D_f + D_r)/(m g) is {:.2} for set A, labelled high friction, and {:.2} for set B, labelled low",
        adhesion(experiment.base, &LOW_FRICTION_ROAD),
        adhesion(experiment.base, &HIGH_FRICTION_ROAD)
    ))
}

fn cubic_set_b(experiment: &Experiment) -> Result<String, SweepError> {
    let set_b = experiment.changed(|scenario| {
        (scenario.tires.front, scenario.tires.rear) = HIGH_FRICTION_ROAD;
    });
    Ok(format!(
        "front cubic coefficient {:.0} N/rad^3, not positive, so nothing bounds the force; at {} rpm the motion {}",
        set_b.tires.front.cubic().cubic_n_per_rad3,
        set_b.run.wheel_speed_rpm,
        experiment.regime(&set_b)?
    ))
}

fn force_sign(experiment: &Experiment) -> Result<String, SweepError> {
    let usual = experiment.changed(|scenario| {
        scenario.tires.front.peak_n *= -1.0;
        scenario.tires.rear.peak_n *= -1.0;
    });
    Ok(format!(
        "as printed (D > 0) the motion at {} rpm is {}; with the usual vehicle sign (D < 0): {}",
        experiment.base.run.wheel_speed_rpm,
        experiment.regime(experiment.base)?,
        experiment.regime(&usual)?
    ))
}

fn first_line(experiment: &Experiment) -> Result<String, SweepError> {
    let frictionless = experiment.changed(|scenario| scenario.friction.law = FrictionLaw::None);
    let difference = experiment.attractor(&frictionless)?;
    Ok(format!(
        "(1) and (20) subtract x2 from the lateral term; with (14)'s product of the two, and without friction, the motion at \
         {} rpm {}; with the difference it is {}, beta from {:.3} to {:.3} rad",
        experiment.base.run.wheel_speed_rpm,
        printed_lateral(&frictionless)?,
        difference.kind,
        difference.lower[SIDESLIP],
        difference.upper[SIDESLIP]
    ))
}

fn friction_laws(experiment: &Experiment) -> Result<String, SweepError> {
    let laws = [
        (FrictionLaw::CoulombRate, "Coulomb on the rate"),
        (FrictionLaw::PrintedAngle, "sign of the angle"),
        (FrictionLaw::None, "none"),
    ];
    let of_law = |(law, word)| {
        let scenarios = [1600.0, 1750.0, 1845.0, 1880.0].map(|rpm| {
            experiment.changed(|scenario| {
                scenario.friction.law = law;
                scenario.friction.dithered = false;
                scenario.run.wheel_speed_rpm = rpm;
            })
        });
        Ok(format!("{word}: {}", experiment.regimes(&scenarios)?))
    };
    let laws: Vec<String> = laws
        .into_iter()
        .map(of_law)
        .collect::<Result<_, SweepError>>()?;
    Ok(format!(
        "at 1600, 1750, 1845 and 1880 rpm: {}",
        laws.join("; ")
    ))
}

fn starts(experiment: &Experiment) -> Result<String, SweepError> {
    let start = experiment.changed(|scenario| scenario.run.wheel_speed_rpm = 1600.0);
    let mut mirrored = start;
    mirrored.run.sideslip_rad *= -1.0;
    mirrored.run.steering_angle_rad *= -1.0;
    Ok(format!(
        "at 1600 rpm the start with delta_f = {} rad ends on {}, the mirrored one on {}",
        start.run.steering_angle_rad,
        experiment.regime(&start)?,
        experiment.regime(&mirrored)?
    ))
}

fn volts(experiment: &Experiment) -> Result<String, SweepError> {
    let sine = |rad_per_volt: f64| {
        experiment.changed(|scenario| {
            scenario.run.wheel_speed_rpm = DITHERED_RPM;
            scenario.dither.waveform = Waveform::Sine;
            scenario.dither.amplitude_v = 1.0;
            scenario.dither.sine_rad_per_volt = rad_per_volt;
        })
    };
    Ok(format!(
        "a sine of 1.0 V gives {} with 1/(2 pi) rad/V, and {} with 1 rad/V",
        experiment.regime(&sine(1.0 / TAU))?,
        experiment.regime(&sine(1.0))?
    ))
}

fn dithered_friction(experiment: &Experiment) -> Result<String, SweepError> {
    let frictions = [
        (FrictionLaw::CoulombRate, false, "not dithered"),
        (FrictionLaw::CoulombRate, true, "dithered"),
        (FrictionLaw::None, false, "absent"),
    ];
    let of_friction = |(law, dithered, word)| {
        let scenarios =
            [(Waveform::Square, 0.1), (Waveform::Sine, 1.0)].map(|(waveform, volts)| {
                experiment.changed(|scenario| {
                    scenario.run.wheel_speed_rpm = DITHERED_RPM;
                    scenario.friction.law = law;
                    scenario.friction.dithered = dithered;
                    scenario.dither.waveform = waveform;
                    scenario.dither.amplitude_v = volts;
                })
            });
        Ok(format!("{word}: {}", experiment.regimes(&scenarios)?))
    };
    let frictions: Vec<String> = frictions
        .into_iter()
        .map(of_friction)
        .collect::<Result<_, SweepError>>()?;
    Ok(format!(
        "square of 0.1 V and sine of 1.0 V with Coulomb friction {}",
        frictions.join("; ")
    ))
}

/// The frictionless motion with the first line of (14) as printed: beta' = (F_f + F_r)/(m v) times
/// gamma, not minus gamma.
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
        // The midpoint rule is accurate enough for the range of the motion.
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
