//! The paper's claims held against what was measured.

use super::material::Judgement;
use crate::paper::{CLAIMS, REGION_EDGES_RPM, Reproduced, chaos_begins_at};
use dynamics::attractor::Kind;
use dynamics::regions::{EdgeBifurcation, Regions, Sample};

/// A region's edge counts as the paper's within 1 % of it.
const EDGE_SHARE: f64 = 0.01;
/// Share of a claimed range in which the claimed kind must be found; periodic windows in chaos are
/// no contradiction.
const MOST: f64 = 0.8;
const SOME: f64 = 0.4;

/// Judges C1 to C4 by a sweep over the speed.
pub fn of_speeds(preset: &str, sweep: &Regions) -> Vec<Judgement> {
    let [first, second, third] = REGION_EDGES_RPM;
    let ends = (
        sweep.samples.first().map_or(first, |sample| sample.value),
        sweep.samples.last().map_or(third, |sample| sample.value),
    );
    let ranges = [
        ("C1", ends.0, first, Kind::Periodic(2)),
        ("C2", first, second, Kind::Chaos),
        ("C3", second, third, Kind::Periodic(3)),
        ("C4", third, ends.1, Kind::Chaos),
    ];
    let judge = |(claim, from, to, kind): (&str, f64, f64, Kind)| {
        let wanted = |k: Kind| k == kind || (kind == Kind::Chaos && k.is_chaotic());
        let share = share(sweep, from, to, wanted);
        let edges: Vec<_> = [from, to]
            .into_iter()
            .filter(|edge| REGION_EDGES_RPM.contains(edge))
            .map(|edge| (edge, nearest_edge_of_chaos(sweep, edge)))
            .collect();
        let near = |(claimed, found): &(f64, Option<(f64, f64)>)| {
            found.is_some_and(|(middle, _)| (middle - claimed).abs() <= EDGE_SHARE * claimed)
        };
        let edges_hold = edges.iter().all(near);
        let verdict = if share >= MOST && edges_hold {
            Reproduced::Yes
        } else if share >= SOME || (edges_hold && share > 0.0) {
            Reproduced::InPart
        } else {
            Reproduced::No
        };
        Judgement {
            claim: claim.into(),
            preset: preset.into(),
            measured: format!(
                "{} of {from:.0} to {to:.0} rpm{}",
                composition(sweep, from, to),
                exponents(sweep, from, to, kind)
            ),
            distance: edges
                .iter()
                .map(edge_distance)
                .chain(
                    edges
                        .iter()
                        .filter_map(|(claimed, _)| bifurcation_near(sweep, *claimed)),
                )
                .collect::<Vec<_>>()
                .join("; "),
            verdict,
        }
    };
    ranges.into_iter().map(judge).collect()
}

/// Judges C5 and C6 by a sweep over the amplitude of the square dither at 1750 rpm.
pub fn of_square_amplitudes(preset: &str, sweep: &Regions) -> Vec<Judgement> {
    let start = kind_at(sweep, 0.0);
    let end = kind_at(sweep, 0.14);
    let chaotic_at_first = start.is_some_and(Kind::is_chaotic);
    let tamed = end.is_some_and(|kind| matches!(kind, Kind::Periodic(_) | Kind::Equilibrium));
    let periodic = matches!(end, Some(Kind::Periodic(_)));
    let last_chaos = sweep
        .edges
        .iter()
        .rev()
        .find(|edge| edge.below.is_chaotic() && !edge.above.is_chaotic());
    let at = kind_at(sweep, 0.1);
    vec![
        Judgement {
            claim: "C5".into(),
            preset: preset.into(),
            measured: format!(
                "{} at 0 V, {} at 0.14 V; between them {}",
                name(start),
                name(end),
                composition(sweep, 0.0, 0.14)
            ),
            distance: last_chaos.map_or_else(String::new, |edge| {
                format!(
                    "chaos ends at {} V",
                    with_error(edge.value(), edge.error(), 4)
                )
            }),
            verdict: match (chaotic_at_first, tamed, periodic) {
                (true, true, true) => Reproduced::Yes,
                (true, true, false) => Reproduced::InPart,
                _ => Reproduced::No,
            },
        },
        Judgement {
            claim: "C6".into(),
            preset: preset.into(),
            measured: format!("{} at 0.1 V", name(at)),
            distance: String::new(),
            verdict: yes_if(at == Some(Kind::Periodic(1))),
        },
    ]
}

/// Judges C7 and C8 by a sweep over the amplitude of the sine dither at 1750 rpm.
pub fn of_sine_amplitudes(preset: &str, sweep: &Regions) -> Vec<Judgement> {
    let share = share(sweep, 0.8, 1.2, |kind| kind == Kind::Periodic(1));
    let ones = |edge: &&dynamics::regions::Edge| {
        edge.above == Kind::Periodic(1) || edge.below == Kind::Periodic(1)
    };
    let edges: Vec<String> = sweep
        .edges
        .iter()
        .filter(ones)
        .map(|edge| {
            let inflection = if edge.is_inflection {
                ", an inflection"
            } else {
                ""
            };
            format!(
                "{} V{inflection}",
                with_error(edge.value(), edge.error(), 4)
            )
        })
        .collect();
    let (before, after) = (kind_at(sweep, 0.0), kind_at(sweep, 1.0));
    let chaos = before.is_some_and(Kind::is_chaotic);
    let periodic = matches!(after, Some(Kind::Periodic(_)));
    vec![
        Judgement {
            claim: "C7".into(),
            preset: preset.into(),
            measured: format!("period-1 in {:.0} % of 0.8 to 1.2 V", 100.0 * share),
            distance: if edges.is_empty() {
                "no edge of period-1 in the sweep".into()
            } else {
                format!("period-1 begins or ends at {}", edges.join("; "))
            },
            verdict: match share {
                share if share > 0.999 => Reproduced::Yes,
                share if share >= SOME => Reproduced::InPart,
                _ => Reproduced::No,
            },
        },
        Judgement {
            claim: "C8".into(),
            preset: preset.into(),
            measured: format!("{} before, {} at 1.0 V", name(before), name(after)),
            distance: String::new(),
            verdict: match (chaos, periodic) {
                (true, true) => Reproduced::Yes,
                (false, true) | (true, false) => Reproduced::InPart,
                _ => Reproduced::No,
            },
        },
    ]
}

fn yes_if(holds: bool) -> Reproduced {
    if holds {
        Reproduced::Yes
    } else {
        Reproduced::No
    }
}

fn name(kind: Option<Kind>) -> String {
    kind.map_or_else(|| "not sampled".into(), |kind| kind.to_string())
}

/// The kind at the sample nearest to a value.
fn kind_at(sweep: &Regions, value: f64) -> Option<Kind> {
    let apart = |sample: &&Sample| (sample.value - value).abs();
    let nearest = sweep
        .samples
        .iter()
        .min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    Some(nearest.attractor.kind)
}

/// Share of a range that regions of the wanted kinds take.
fn share(sweep: &Regions, from: f64, to: f64, wanted: impl Fn(Kind) -> bool) -> f64 {
    let overlap =
        |region: &dynamics::regions::Region| (region.to.min(to) - region.from.max(from)).max(0.0);
    let held = sweep.regions.iter().filter(|region| wanted(region.kind));
    held.map(overlap).sum::<f64>() / (to - from)
}

/// The kinds in a range with their shares, the greatest first; shares under 1 % are left out.
fn composition(sweep: &Regions, from: f64, to: f64) -> String {
    let mut shares: Vec<(String, f64)> = Vec::new();
    for region in &sweep.regions {
        let share = (region.to.min(to) - region.from.max(from)).max(0.0) / (to - from);
        let name = region.kind.to_string();
        match shares.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += share,
            None => shares.push((name, share)),
        }
    }
    shares.retain(|&(_, share)| share >= 0.01);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let words = shares
        .iter()
        .map(|(name, share)| format!("{name} in {:.0} %", 100.0 * share));
    words.collect::<Vec<_>>().join(", ")
}

/// Middle and half width of the edge between chaos in one band and anything else that is nearest to
/// `claimed`. Chaos in three narrow bands looks much like period-3 in a diagram, so the paper's
/// edges are where the bands have merged.
fn nearest_edge_of_chaos(sweep: &Regions, claimed: f64) -> Option<(f64, f64)> {
    let begins = chaos_begins_at(claimed);
    let of_chaos = sweep.edges.iter().filter(|edge| edge.is_of_chaos(begins));
    let apart = |edge: &&dynamics::regions::Edge| (edge.value() - claimed).abs();
    let nearest = of_chaos.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    Some((nearest.value(), nearest.error()))
}

/// A value with its error, or with two more digits if the error is below them.
fn with_error(value: f64, error: f64, digits: usize) -> String {
    let exact = digits + 2;
    if error < 0.5 * 0.1_f64.powi(exact as i32) {
        return format!("{value:.exact$}");
    }
    format!("{value:.digits$} \u{b1} {error:.digits$}")
}

/// The bifurcation of an orbit that is nearest to `claimed`, if it is near.
fn bifurcation_near(sweep: &Regions, claimed: f64) -> Option<String> {
    let all = sweep.edges.iter().filter_map(|edge| edge.bifurcation);
    let apart = |at: &EdgeBifurcation| (at.value - claimed).abs();
    let nearest = all.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    let is_near = apart(&nearest) <= EDGE_SHARE * claimed;
    is_near.then(|| format!("{} at {:.4} rpm", nearest.kind, nearest.value))
}

fn edge_distance((claimed, found): &(f64, Option<(f64, f64)>)) -> String {
    match found {
        Some((middle, half)) => format!(
            "edge of chaos at {} rpm, {:+.1} from {claimed:.0}",
            with_error(*middle, *half, 1),
            middle - claimed
        ),
        None => format!("no edge of chaos near {claimed:.0}"),
    }
}

/// Range of the exponents in a chaotic range.
fn exponents(sweep: &Regions, from: f64, to: f64, kind: Kind) -> String {
    if kind != Kind::Chaos {
        return String::new();
    }
    let inside = sweep
        .samples
        .iter()
        .filter(|s| s.value >= from && s.value <= to && s.attractor.kind.is_chaotic());
    let rates = inside.filter_map(|sample| sample.attractor.exponent_per_s);
    let (low, high) = rates.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rate| {
        (low.min(rate), high.max(rate))
    });
    if low > high {
        return String::new();
    }
    format!(", exponent {low:.2} to {high:.2} 1/s there")
}

/// The claim's own words.
pub fn says(claim: &str) -> &'static str {
    let known = CLAIMS.iter().find(|known| known.id == claim);
    known.map_or("", |known| known.says)
}
