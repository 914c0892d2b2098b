//! Poincaré section: the states at which a motion crosses a hyperplane, one component at a given
//! value.
//!
//! Under the mean of the dither a crossing is a root of the engine's polynomial. Under the true
//! signal it is located within the ECU's step by the cubic Hermite polynomial through the states
//! and the right-hand sides at both ends: error of fourth order in the step where the motion is
//! smooth, as the integrator's own (J. R. Dormand, P. J. Prince, Comput. Math. Appl. 12A (1986)
//! 1007). In a step in which the friction mode changes it is of second order, as the integrator's
//! too. M. Hénon's alternative (Physica D 5 (1982) 412), the component as independent variable,
//! cannot cross the section of a steering rate that sticks at zero.

use crate::component::Component;
use crate::observe::observe;
use crate::section::{Crossing, Direction, Section, Step};
use crate::simulate::{self, Unsettled, started_at};
use crate::sweep::{RunControl, Timing};
use engine::taylor::{Observables, Trajectory};
use engine::{EarlyEnd, is_bounded};
use shared_model::dither::Application;
use shared_model::vehicle::Model;
use shared_model::{InvalidScenario, Scenario};

/// Why there is no section.
#[derive(Debug, thiserror::Error)]
pub enum SectionError {
    /// The scenario cannot be run.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
    /// The component does not pass the value in the run.
    #[error(
        "the section {section} is never crossed: in {duration_s} s the component ranges from {low} to {high} {}",
        section.component.unit
    )]
    NeverCrossed {
        /// The section.
        section: Box<Section>,
        /// Length of the run, s.
        duration_s: f64,
        /// The component's least value.
        low: f64,
        /// Its greatest value.
        high: f64,
    },
    /// The motion leaves all physical bounds, or could not be followed; the time counts from the
    /// start.
    #[error(transparent)]
    EndsEarly(#[from] EarlyEnd),
}

impl From<Unsettled> for SectionError {
    fn from(error: Unsettled) -> Self {
        match error {
            Unsettled::Invalid(error) => error.into(),
            Unsettled::EndsEarly(end) => end.into(),
        }
    }
}

/// Crossings of the section by the motion of a scenario, its dither on from the start, within its
/// length after a transient of `transient_s`.
///
/// # Errors
/// If the scenario is not valid, the motion diverges, or it never crosses the section.
///
/// ```
/// use dynamics::component::Component;
/// use dynamics::poincare::crossings;
/// use dynamics::section::{Direction, Section};
/// let scenario = shared_model::Scenario::reconstruction();
/// let section = Section { component: Component::ALL[1], value: 0.0, direction: Direction::Rising };
/// let crossings = crossings(&scenario, 5.0, &section).unwrap();
/// assert!(crossings.iter().all(|crossing| crossing.x[1].abs() < 1e-12));
/// ```
pub fn crossings(
    scenario: &Scenario<f64>,
    transient_s: f64,
    section: &Section,
) -> Result<Vec<Crossing>, SectionError> {
    let Passage {
        crossings,
        lowest: low,
        highest: high,
    } = passage(scenario, transient_s, section)?;
    if crossings.is_empty() {
        return Err(SectionError::NeverCrossed {
            section: Box::new(*section),
            duration_s: scenario.run.duration_s,
            low,
            high,
        });
    }
    Ok(crossings)
}

/// Least and greatest value of a component in the same motion as that of [`crossings`].
///
/// # Errors
/// If the scenario is not valid, or the motion diverges.
pub fn range(
    scenario: &Scenario<f64>,
    transient_s: f64,
    component: Component,
) -> Result<(f64, f64), SectionError> {
    let section = Section {
        component,
        value: 0.0,
        direction: Direction::Both,
    };
    let passage = passage(scenario, transient_s, &section)?;
    Ok((passage.lowest, passage.highest))
}

/// How a motion passes a section.
struct Passage {
    crossings: Vec<Crossing>,
    /// Extent of the section's component.
    lowest: f64,
    highest: f64,
}

fn passage(
    scenario: &Scenario<f64>,
    transient_s: f64,
    section: &Section,
) -> Result<Passage, SectionError> {
    match scenario.dither.application {
        Application::Signal => by_steps(scenario, transient_s, section),
        Application::Averaged => by_engine(scenario, transient_s, section),
    }
}

fn by_engine(
    scenario: &Scenario<f64>,
    transient_s: f64,
    section: &Section,
) -> Result<Passage, SectionError> {
    let timing = Timing {
        transient_s,
        observed_s: scenario.run.duration_s,
    };
    let index = section.component.index;
    let mut turns = [false; 4];
    turns[index] = true;
    let observables = Observables {
        turns,
        section: Some((index, section.value)),
    };
    let one = std::slice::from_ref(scenario);
    let see = |_: &_, found: &Trajectory<0>| found.clone();
    let mut found = observe(one, timing, observables, RunControl::none(), see)?;
    let found = found.pop().flatten().expect("nobody stops it");
    if let Some(end) = found.early_end {
        return Err(end.into());
    }
    let wanted = found
        .crossings
        .iter()
        .filter(|c| section.direction.has(c.rising));
    let crossings = wanted.map(|crossing| Crossing {
        time_s: crossing.time_s,
        x: crossing.x.into(),
        rising: crossing.rising,
    });
    Ok(Passage {
        crossings: crossings.collect(),
        lowest: found.lower[index],
        highest: found.upper[index],
    })
}

fn by_steps(
    scenario: &Scenario<f64>,
    transient_s: f64,
    section: &Section,
) -> Result<Passage, SectionError> {
    let model = Model::new(scenario);
    let index = section.component.index;
    let mut passage = Passage {
        crossings: Vec::new(),
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
    };
    for_each_step(scenario, transient_s, |time_s, step| {
        let crossing = step.crossing(&model, section);
        passage.crossings.extend(crossing.map(|crossing| Crossing {
            time_s: time_s + crossing.time_s,
            ..crossing
        }));
        let value = step.end.x[index];
        passage.lowest = passage.lowest.min(value);
        passage.highest = passage.highest.max(value);
    })?;
    Ok(passage)
}

/// Hands the steps after the transient to `visit`, each with the time of its start (s). Nothing is
/// kept, so that a run may be long.
fn for_each_step(
    scenario: &Scenario<f64>,
    transient_s: f64,
    mut visit: impl FnMut(f64, &Step),
) -> Result<(), SectionError> {
    let mut ecu = simulate::after_transient(scenario, transient_s)?;
    let step_s = scenario.step_s();
    let first = *ecu.control.state();
    let mut start = first;
    for k in 0..scenario.steps() {
        interrupt::check();
        let dither = loop {
            let sample = ecu.pwm.run();
            if sample.control_due {
                break sample.dither;
            }
        };
        let end = *ecu.control.run(dither);
        let time_s = f64::from(k) * step_s;
        if !is_bounded(&end.x) {
            let reason = simulate::why_unbounded(&started_at(scenario, &first), time_s);
            return Err(EarlyEnd { time_s, reason }.later_by(transient_s).into());
        }
        let step = Step {
            start,
            end,
            step_s,
            injection: scenario.dither.injection(dither),
        };
        visit(time_s, &step);
        start = end;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_model::dither::{Application, Waveform};
    use shared_model::friction::FrictionLaw;

    fn section(name: &str, value: f64, direction: Direction) -> Section {
        Section {
            component: name.parse().unwrap(),
            value,
            direction,
        }
    }

    /// A smooth motion at the given step.
    fn smooth(control_rate_hz: f64) -> Scenario<f64> {
        let mut scenario = Scenario::reconstruction();
        scenario.friction.law = FrictionLaw::None;
        scenario.run.control_rate_hz = control_rate_hz;
        scenario.run.duration_s = 2.0;
        scenario
    }

    #[test]
    fn crossings_converge_in_fourth_order() {
        let rising = section("gamma", 0.0, Direction::Rising);
        let first = |rate_hz| by_steps(&smooth(rate_hz), 0.0, &rising).unwrap().crossings[0];
        let exact = crossings(&smooth(1000.0), 0.0, &rising).unwrap()[0];
        let error = |rate_hz| {
            let crossing = first(rate_hz);
            let off = crossing.x - exact.x;
            let state = off.dot(&off).sqrt();
            state.max((crossing.time_s - exact.time_s).abs())
        };
        let (coarse, fine) = (error(50.0), error(200.0));
        let order = (coarse / fine).ln() / 4.0_f64.ln();
        assert!(order > 3.5, "order {order}: {coarse:e}, {fine:e}");
        assert!(fine < 1e-6, "{fine:e}");
    }

    #[test]
    fn directions_part_the_crossings() {
        let scenario = smooth(1000.0);
        let all = |direction| crossings(&scenario, 0.0, &section("gamma", 0.0, direction)).unwrap();
        let (rising, falling) = (all(Direction::Rising), all(Direction::Falling));
        let both = all(Direction::Both);
        assert_eq!(both.len(), rising.len() + falling.len());
        assert!(rising.iter().all(|crossing| crossing.rising));
        assert!(both.windows(2).all(|pair| pair[0].rising != pair[1].rising));
        assert!(both.is_sorted_by(|a, b| a.time_s < b.time_s));
    }

    /// Under the signal the slope jumps from step to step; each step has its own.
    #[test]
    fn a_signal_is_followed_step_by_step() {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = Waveform::Square;
        scenario.dither.application = Application::Signal;
        scenario.dither.amplitude_v = 0.1;
        scenario.run.duration_s = 3.0;
        let falling = section("yaw_rate", 0.0, Direction::Falling);
        for crossing in crossings(&scenario, 1.0, &falling).unwrap() {
            assert!(crossing.x[1].abs() < 1e-12 && !crossing.rising);
        }
    }

    #[test]
    fn the_range_holds_all_crossings() {
        let scenario = smooth(1000.0);
        let component: Component = "sideslip".parse().unwrap();
        let (low, high) = range(&scenario, 0.0, component).unwrap();
        assert!(low < high);
        let middle = section("sideslip", 0.5 * (low + high), Direction::Both);
        assert!(!crossings(&scenario, 0.0, &middle).unwrap().is_empty());
        assert_eq!(format!("{middle:.1}").matches('.').count(), 1);
    }

    #[test]
    fn a_section_out_of_reach_names_itself_and_the_range() {
        let above = section("gamma", 5.0, Direction::Rising);
        let error = crossings(&smooth(1000.0), 0.0, &above)
            .unwrap_err()
            .to_string();
        assert!(error.contains("yaw_rate = 5 rad/s, rising"), "{error}");
        assert!(
            error.contains("never crossed") && error.contains("ranges from"),
            "{error}"
        );
    }

    #[test]
    fn a_diverging_motion_is_said() {
        let mut scenario = smooth(1000.0);
        let (front, rear) = shared_model::tire::HIGH_FRICTION_ROAD;
        (scenario.tires.front, scenario.tires.rear) = (front, rear);
        scenario.run.duration_s = 20.0;
        let far = section("gamma", 1e3, Direction::Rising);
        let error = crossings(&scenario, 0.0, &far).unwrap_err();
        assert!(matches!(error, SectionError::EndsEarly(_)), "{error}");
    }
}
