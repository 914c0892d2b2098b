//! Sensitivity of the edges of the paper's regions to parameters that the paper does not give.

use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, Table};
use crate::paper::{REGION_EDGES_RPM, chaos_begins_at};
use dynamics::regions::{Edge, Regions, regions_of_trajectories};
use dynamics::sweep::{Parameter, RunControl, SweepError, Timing, Values};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::Scenario;
use shared_model::friction::FrictionLaw;
use shared_model::vehicle::SlipForm;

/// An edge further than this from the paper's is another one, rpm.
const NEAR_RPM: f64 = 60.0;

/// Edges over the coefficient of friction, the best fit of it, and the edges under other readings.
pub fn sensitivity(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let coefficients: &[f64] = match quality {
        Quality::Quick => &[0.24, 0.28, 0.32],
        Quality::Full => &[
            0.20, 0.22, 0.24, 0.26, 0.27, 0.28, 0.29, 0.30, 0.32, 0.34, 0.36,
        ],
    };
    let mut table = Table::new(&[
        "friction_coefficient",
        "edge_1_rpm",
        "edge_2_rpm",
        "edge_3_rpm",
    ]);
    let mut curves: [Vec<(f64, f64)>; 3] = Default::default();
    let mut residuals = Vec::new();
    for &coefficient in coefficients {
        let mut scenario = named.scenario;
        scenario.friction.coefficient = coefficient;
        let edges = edges(&scenario, quality, watch)?;
        let mut row = vec![coefficient.to_string()];
        for (curve, edge) in curves.iter_mut().zip(edges) {
            curve.extend(edge.map(|edge| (coefficient, edge)));
            row.push(edge.map_or_else(String::new, |edge| edge.to_string()));
        }
        table.rows.push(row);
        residuals.extend(residual_rpm(edges).map(|residual| (coefficient, residual)));
    }
    let mut findings = vec![(
        "Best fit of the coefficient of friction".into(),
        best_fit(&residuals),
    )];
    for (word, change) in READINGS {
        let mut scenario = named.scenario;
        change(&mut scenario);
        let edges = edges(&scenario, quality, watch)?;
        findings.push((format!("Edges with {word}"), words(edges)));
    }
    Ok(Material {
        drawings: vec![Drawing {
            name: format!("sensitivity-{}", named.name),
            caption: format!(
                "Sensitivity ({}): edges of chaos nearest to the paper's 1645, 1825 and 1855 rpm (levels) over the coefficient \
                 of friction.",
                named.name
            ),
            chart: chart(curves),
            csv: table.csv(),
        }],
        findings,
        ..Material::default()
    })
}

/// A reading in words, and what it changes.
type Reading = (&'static str, fn(&mut Scenario<f64>));

const READINGS: [Reading; 5] = [
    ("friction by the sign of the angle", |s| {
        s.friction.law = FrictionLaw::PrintedAngle;
    }),
    ("friction on the rate", |s| {
        s.friction.law = FrictionLaw::CoulombRate
    }),
    ("no friction", |s| s.friction.law = FrictionLaw::None),
    ("exact slip angles", |s| {
        s.vehicle.slip_form = SlipForm::Exact
    }),
    ("a start at half the steering angle", |s| {
        s.run.steering_angle_rad *= 0.5
    }),
];

/// Edges of chaos nearest to the paper's three, rpm.
fn edges(
    scenario: &Scenario<f64>,
    quality: Quality,
    watch: RunControl,
) -> Result<[Option<f64>; 3], SweepError> {
    let (step, width, timing) = match quality {
        Quality::Quick => (20.0, 5.0, Timing::new(40.0, 100.0)?),
        Quality::Full => (10.0, 1.0, Timing::new(100.0, 250.0)?),
    };
    let values = Values::new("wheel speed", 1580.0, 1920.0, step)?;
    let sweep = regions_of_trajectories(scenario, Parameter::Speed, &values, width, timing, watch)?;
    Ok(REGION_EDGES_RPM.map(|edge| nearest(&sweep, edge)))
}

fn nearest(sweep: &Regions, claimed: f64) -> Option<f64> {
    let begins = chaos_begins_at(claimed);
    let of_chaos = sweep.edges.iter().filter(|edge| edge.is_of_chaos(begins));
    let near = of_chaos
        .map(Edge::value)
        .filter(|middle| (middle - claimed).abs() <= NEAR_RPM);
    near.min_by(|a, b| (a - claimed).abs().total_cmp(&(b - claimed).abs()))
}

/// Root mean square distance of the three edges from the paper's, if all three are there.
fn residual_rpm(edges: [Option<f64>; 3]) -> Option<f64> {
    let squares = edges
        .into_iter()
        .zip(REGION_EDGES_RPM)
        .map(|(edge, claimed)| Some((edge? - claimed).powi(2)));
    let sum = squares.sum::<Option<f64>>()?;
    Some((sum / 3.0).sqrt())
}

fn best_fit(residuals: &[(f64, f64)]) -> String {
    let best = residuals.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or_else(
        || "untested: none of the sampled values has all three edges".into(),
        |(coefficient, residual)| {
            format!("{coefficient} among the sampled values, with a root mean square error of the edges of {residual:.1} rpm")
        },
    )
}

fn words(edges: [Option<f64>; 3]) -> String {
    let word = |(edge, claimed): (Option<f64>, f64)| match edge {
        Some(edge) => format!("{edge:.0} rpm for {claimed:.0}"),
        None => format!("none within {NEAR_RPM:.0} rpm of {claimed:.0}"),
    };
    let all: Vec<String> = edges.into_iter().zip(REGION_EDGES_RPM).map(word).collect();
    all.join(", ")
}

fn chart(curves: [Vec<(f64, f64)>; 3]) -> Chart {
    let labels = ["I to II", "II to III", "III to IV"];
    let series = labels.into_iter().zip(curves).enumerate();
    Chart {
        heading: "Edges of the regions over the coefficient of friction".into(),
        panels: vec![Panel {
            x: AxisSpec::linear("coefficient of friction"),
            y: AxisSpec::linear("wheel speed (rpm)"),
            series: series
                .map(|(n, (label, points))| Series {
                    label: label.into(),
                    points,
                    look: Look::Line(n),
                })
                .collect(),
            levels: REGION_EDGES_RPM.to_vec(),
            ..Panel::default()
        }],
    }
}
