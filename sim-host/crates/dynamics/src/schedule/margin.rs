//! Distance of a schedule's amplitudes from bifurcations, by the multipliers of the orbits that they give.

use super::choose::{Entry, Range};
use super::plan::Plan;
use crate::attractor::{Kind, attractors};
use crate::settled::{Decay, decay};
use crate::sweep::{Parameter, RunControl, SweepError, mirrored};
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// How perturbations decay under the amplitude of an entry, from both starts.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Margin {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Amplitude W, V.
    pub amplitude_v: f64,
    /// Share of a perturbation that is left after a period, of the attractor where it is greater: the
    /// greatest modulus of a multiplier beside 1. None where a trajectory approaches neither a stable orbit
    /// nor an equilibrium.
    pub greatest_multiplier: Option<f64>,
    /// Amplitudes around it at which both attractors keep the plan's bound of the multipliers.
    pub kept: Option<Range>,
}

impl Margin {
    /// The bound is kept at an amplitude.
    fn keeps(&self, amplitude_v: f64) -> bool {
        let holds = |range: Range| (range.from_v..=range.to_v).contains(&amplitude_v);
        self.kept.is_some_and(holds)
    }
}

/// Greatest amplitude that the gate lets pass, V.
fn gate_limit_v(scenario: &Scenario<f64>) -> f64 {
    match scenario.dither.waveform {
        Waveform::Sine => scenario.gate.sine_amplitude_v,
        Waveform::Square | Waveform::None => scenario.gate.square_amplitude_v,
    }
}

/// The margins of all entries with dither; `None` if it was stopped.
pub(super) fn margins(
    scenario: &Scenario<f64>,
    plan: &Plan,
    entries: &[Entry],
    control: RunControl,
) -> Result<Option<Vec<Margin>>, SweepError> {
    let with_dither = entries.iter().filter(|entry| entry.amplitude_v > 0.0);
    let at = |entry: &Entry| {
        let scenario = Parameter::Speed.set(scenario, entry.wheel_speed_rpm);
        Parameter::Amplitude.set(&scenario, entry.amplitude_v)
    };
    let starts: Vec<Scenario<f64>> = with_dither
        .map(at)
        .flat_map(|scenario| [scenario, mirrored(&scenario)])
        .collect();
    let ends = attractors(&starts, plan.timing, false, control)?;
    let Some(ends) = ends.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let range = (0.0, plan.greatest_amplitude_v().min(gate_limit_v(scenario)));
    let pairs: Vec<_> = starts.iter().zip(&ends).collect();
    let decays = control.points(&pairs, |(scenario, attractor)| {
        let bound = plan.greatest_multiplier;
        let end = (&attractor.end, attractor.kind == Kind::Equilibrium);
        decay(scenario, Parameter::Amplitude, end, range, bound)
    });
    let Some(decays) = decays.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let scenarios = starts.iter().step_by(2);
    let margins = scenarios
        .zip(decays.chunks(2))
        .map(|(scenario, both)| margin(scenario, both, plan.greatest_multiplier));
    Ok(Some(margins.collect()))
}

fn margin(scenario: &Scenario<f64>, both: &[Option<Decay>], bound: f64) -> Margin {
    let both: Option<Vec<Decay>> = both.iter().copied().collect();
    let greatest_multiplier = both.as_ref().map(|both| {
        both.iter()
            .map(|decay| decay.multiplier)
            .fold(0.0, f64::max)
    });
    let common = |both: &Vec<Decay>| Range {
        from_v: both.iter().map(|decay| decay.from).fold(0.0, f64::max),
        to_v: both
            .iter()
            .map(|decay| decay.to)
            .fold(f64::INFINITY, f64::min),
    };
    let keeps = greatest_multiplier.is_some_and(|multiplier| multiplier <= bound);
    Margin {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        amplitude_v: scenario.dither.amplitude_v,
        greatest_multiplier,
        kept: both.as_ref().filter(|_| keeps).map(common),
    }
}

/// Margins that are not kept: at their own amplitude, or at that of a neighbour in the table, which also acts up
/// to their speed.
pub(super) fn lost(margins: &[Margin]) -> impl Iterator<Item = &Margin> {
    (0..margins.len()).filter_map(|k| {
        let near = &margins[k.saturating_sub(1)..margins.len().min(k + 2)];
        let kept = near.iter().all(|other| margins[k].keeps(other.amplitude_v));
        (!kept).then_some(&margins[k])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::attractor;
    use crate::sweep::Timing;

    fn at(amplitude_v: f64, from_v: f64, to_v: f64) -> Margin {
        Margin {
            wheel_speed_rpm: 1750.0,
            amplitude_v,
            greatest_multiplier: Some(0.5),
            kept: Some(Range { from_v, to_v }),
        }
    }

    #[test]
    fn a_margin_is_also_kept_at_the_neighbours_amplitudes() {
        let good = [
            at(0.10, 0.09, 0.13),
            at(0.11, 0.095, 0.13),
            at(0.12, 0.10, 0.13),
        ];
        assert_eq!(lost(&good).count(), 0);
        let mut bad = good;
        bad[1].kept = Some(Range {
            from_v: 0.105,
            to_v: 0.13,
        });
        assert_eq!(lost(&bad).collect::<Vec<_>>(), [&bad[1]]);
        bad[1].kept = None;
        assert_eq!(lost(&bad).count(), 1);
    }

    /// What is left of a perturbation under an amplitude of square wave at 1750 rpm. Chaos has no decay, though there
    /// are equilibria near it.
    #[test]
    fn chaos_has_no_decay_and_orbits_and_rest_have() {
        let found = |amplitude_v: f64| {
            let mut scenario = Scenario::reconstruction();
            scenario.dither.waveform = Waveform::Square;
            scenario.dither.amplitude_v = amplitude_v;
            let timing = Timing::new(200.0, 400.0).unwrap();
            let attractor = attractor(&scenario, timing, true).unwrap();
            let end = (&attractor.end, attractor.kind == Kind::Equilibrium);
            let decay = decay(&scenario, Parameter::Amplitude, end, (0.0, 0.2), 0.8);
            (attractor.kind, decay.map(|decay| decay.multiplier))
        };
        let (kind, multiplier) = found(0.0);
        assert!(kind.is_chaotic() && multiplier.is_none(), "{multiplier:?}");
        let (kind, multiplier) = found(0.11);
        assert_eq!(kind, Kind::Periodic(1));
        assert!(multiplier.is_some_and(|left| left < 0.8), "{multiplier:?}");
        let (kind, multiplier) = found(0.15);
        assert_eq!(kind, Kind::Equilibrium);
        assert!(multiplier.is_some_and(|left| left < 1.0), "{multiplier:?}");
    }
}
