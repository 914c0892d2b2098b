//! The figure of a bifurcation diagram.

use super::{Bifurcations, OrbitBranch};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series, large_dots};

/// Index of a line style by stability: solid and dashed.
fn style(stable: bool) -> usize {
    usize::from(!stable)
}

/// The branches over the parameter, with `simulated` dots of an orbit diagram below them (parameter, yaw
/// rate in rad/s), and the curves in both parameters. `names` are those of the parameters with units.
pub fn chart(
    found: &Bifurcations,
    simulated: Vec<(f64, f64)>,
    range: (f64, f64),
    names: [&str; 2],
) -> Chart {
    let x = || AxisSpec::linear(names[0]).from_to(range.0, range.1);
    let mut series = Vec::new();
    if !simulated.is_empty() {
        let (label, look) = ("maxima after a transient".into(), Look::Dots);
        series.push(Series {
            label,
            points: simulated,
            look,
        });
    }
    series.extend(lines(found));
    series.extend(dots(found));
    let multipliers = found.orbits.iter().flat_map(|branch| {
        [true, false].map(|stable| Series {
            label: String::new(),
            points: parts(branch, stable, |point| {
                point
                    .multipliers
                    .first()
                    .map_or(f64::NAN, |m| m.re.hypot(m.im))
            }),
            look: Look::Line(style(stable)),
        })
    });
    let mut panels = vec![
        Panel {
            caption: "maxima of the yaw rate".into(),
            x: x(),
            y: AxisSpec::linear("yaw rate (rad/s)"),
            series,
            ..Panel::default()
        },
        Panel {
            caption: "greatest magnitude of a multiplier".into(),
            x: x(),
            y: AxisSpec::logarithmic("magnitude"),
            series: multipliers.collect(),
            levels: vec![1.0],
            ..Panel::default()
        },
    ];
    if !found.curves.is_empty() {
        panels.push(Panel {
            caption: "bifurcations in both parameters".into(),
            x: x(),
            y: AxisSpec::linear(names[1]),
            series: curves(found),
            ..Panel::default()
        });
    }
    Chart {
        heading: "Periodic orbits by continuation".into(),
        panels,
    }
}

/// Every maximum of every branch, in the style of its stability.
fn lines(found: &Bifurcations) -> Vec<Series> {
    let mut series = Vec::new();
    for stable in [true, false] {
        let mut label = if stable { "stable" } else { "unstable" };
        for branch in &found.orbits {
            let most = branch
                .points
                .iter()
                .map(|point| point.maxima_rad_per_s.len())
                .max();
            for k in 0..most.unwrap_or(0) {
                let height = |point: &super::OrbitPoint| {
                    point.maxima_rad_per_s.get(k).copied().unwrap_or(f64::NAN)
                };
                let points = parts(branch, stable, height);
                if points.iter().any(|point| point.1.is_finite()) {
                    series.push(Series {
                        label: label.into(),
                        points,
                        look: Look::Line(style(stable)),
                    });
                    label = "";
                }
            }
        }
    }
    series
}

/// A branch's orbits of that stability; NaN interrupts the line elsewhere.
fn parts(
    branch: &OrbitBranch,
    stable: bool,
    of: impl Fn(&super::OrbitPoint) -> f64,
) -> Vec<(f64, f64)> {
    let all = &branch.points;
    let is_shown = |k: usize| {
        // The dashed line reaches to the orbits of the other stability beside it.
        let has_neighbour = || {
            let neighbours = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
            neighbours
                .filter_map(|k| all.get(k))
                .any(|point| !point.stable)
        };
        all[k].stable == stable || (!stable && has_neighbour())
    };
    let value = |k: usize| if is_shown(k) { of(&all[k]) } else { f64::NAN };
    (0..all.len())
        .map(|k| (all[k].parameter, value(k)))
        .collect()
}

/// The bifurcations at the greatest yaw rate of their orbits.
fn dots(found: &Bifurcations) -> Vec<Series> {
    let kinds = [
        ("period doubling", "period doubling"),
        ("fold", "fold"),
        ("grazing", "grazing: a mode appears or vanishes"),
    ];
    let mut series = Vec::new();
    for (n, (kind, label)) in kinds.into_iter().enumerate() {
        let of_kind = found.specials.iter().filter(|special| special.kind == kind);
        let points: Vec<_> = of_kind
            .map(|s| (s.parameter, s.orbit.yaw_rate_max_rad_per_s))
            .collect();
        if !points.is_empty() {
            series.extend(large_dots(label, n + 1, points));
        }
    }
    series
}

fn curves(found: &Bifurcations) -> Vec<Series> {
    let mut kinds: Vec<&str> = found.curves.iter().map(|curve| curve.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut series: Vec<Series> = Vec::new();
    for curve in &found.curves {
        let style = kinds
            .iter()
            .position(|kind| *kind == curve.kind)
            .unwrap_or(0);
        let is_named = series.iter().any(|other| other.label == curve.kind);
        series.push(Series {
            label: if is_named {
                String::new()
            } else {
                curve.kind.into()
            },
            points: curve
                .points
                .iter()
                .map(|p| (p.parameters[0], p.parameters[1]))
                .collect(),
            look: Look::Line(style),
        });
    }
    let named = found.curves.iter().flat_map(|curve| &curve.codimension_two);
    let named: Vec<_> = named.map(|(_, [x, y])| (*x, *y)).collect();
    if !named.is_empty() {
        series.extend(large_dots("codimension two", kinds.len(), named));
    }
    series
}
