//! Curves that need no motion: cornering force of the tyres (Figure 2), and what dither makes of
//! the nonlinearities (Figures 9 to 11 and 14 to 16).

use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use plot::number::four_digits;
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::{Application, Injection, Waveform};
use shared_model::friction::{FrictionLaw, Sign};
use shared_model::tire::{
    HIGH_FRICTION_ROAD, LOW_FRICTION_ROAD, MagicFormula, Road, Tire, TireModel,
};

/// Steps from one end of a curve to the other: the sign's jumps look vertical.
const STEPS: i32 = 1200;

/// Arguments from `-greatest` to `greatest` in equal steps.
fn arguments(greatest: f64) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |k| greatest * f64::from(2 * k - STEPS) / f64::from(STEPS))
}

fn line(label: &str, n: usize, points: impl Iterator<Item = (f64, f64)>) -> Series {
    Series {
        label: label.into(),
        points: points.collect(),
        look: Look::Line(n),
    }
}

/// One slip angle of one tyre's characteristic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TireRow {
    /// The road: `low_friction`, `high_friction`, or `configured` for one that is neither.
    pub road: &'static str,
    /// The axle: `front` or `rear`.
    pub axle: &'static str,
    /// Slip angle, rad.
    pub slip_angle_rad: f64,
    /// Cornering force by the Magic Formula, (6) and (7), N.
    pub magic_formula_n: f64,
    /// Cornering force by the cubic tyre, (8) and (9), N.
    pub cubic_n: f64,
}

/// The roads of Table 1, and that of the scenario if it is another: key, name for people,
/// coefficients.
fn roads(scenario: &Scenario<f64>) -> Vec<(&'static str, &'static str, Road)> {
    let configured = (scenario.tires.front, scenario.tires.rear);
    let mut roads = vec![
        (
            "low_friction",
            "low-friction road (set A of Table 1)",
            LOW_FRICTION_ROAD,
        ),
        (
            "high_friction",
            "high-friction road (set B of Table 1)",
            HIGH_FRICTION_ROAD,
        ),
    ];
    if roads.iter().all(|road| road.2 != configured) {
        roads.push(("configured", "configured road", configured));
    }
    roads
}

/// Cornering forces of both axles on every road up to a slip angle, rad: Figure 2.
pub fn tires(scenario: &Scenario<f64>, greatest_slip_rad: f64) -> Vec<TireRow> {
    let mut rows = Vec::new();
    for (road, _, (front, rear)) in roads(scenario) {
        for (axle, tire) in [("front", front), ("rear", rear)] {
            rows.extend(arguments(greatest_slip_rad).map(|slip_angle_rad| TireRow {
                road,
                axle,
                slip_angle_rad,
                magic_formula_n: tire.force(slip_angle_rad),
                cubic_n: tire.cubic().force(slip_angle_rad),
            }));
        }
    }
    rows
}

/// The figure of [`tires`]: a panel for each road, its axis a little beyond the greatest force of
/// the Magic Formula and the cubic tyre's local maximum.
pub fn tires_chart(scenario: &Scenario<f64>, rows: &[TireRow]) -> Chart {
    let greatest_slip = rows.last().map_or(1.0, |row| row.slip_angle_rad);
    let panels = roads(scenario)
        .into_iter()
        .map(|(road, name, (front, rear))| {
            let of = |axle: &'static str| {
                rows.iter()
                    .filter(move |row| row.road == road && row.axle == axle)
            };
            let magic = |axle| of(axle).map(|row| (row.slip_angle_rad, row.magic_formula_n));
            let cubic = |axle| of(axle).map(|row| (row.slip_angle_rad, row.cubic_n));
            let peak = [front, rear]
                .iter()
                .map(|tire| tire.peak_n.abs().max(cubic_peak_n(tire, greatest_slip)))
                .fold(0.0, f64::max);
            Panel {
                caption: name.into(),
                x: AxisSpec::linear("slip angle \u{3b1} (rad)")
                    .from_to(-greatest_slip, greatest_slip),
                y: AxisSpec::linear("force F (N)").from_to(-1.15 * peak, 1.15 * peak),
                series: vec![
                    line("front, Magic Formula", 0, magic("front")),
                    line("front, cubic", 2, cubic("front")),
                    line("rear, Magic Formula", 4, magic("rear")),
                    line("rear, cubic", 1, cubic("rear")),
                ],
                levels: vec![0.0],
                ..Panel::default()
            }
        });
    Chart {
        heading: "Cornering force against slip angle".into(),
        panels: panels.collect(),
    }
}

/// The cubic tyre's local maximum 2 k1/3 sqrt(k1/(3 k2)) if it has one up to the slip angle, N;
/// else 0.
fn cubic_peak_n(tire: &MagicFormula<f64>, greatest_slip_rad: f64) -> f64 {
    let cubic = tire.cubic();
    let slip_rad = (cubic.linear_n_per_rad / (3.0 * cubic.cubic_n_per_rad3)).sqrt();
    if slip_rad <= greatest_slip_rad {
        cubic.force(slip_rad).abs()
    } else {
        0.0
    }
}

/// One argument of the nonlinearities, each as it is and as its mean under the dither.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NonlinearityRow {
    /// Slip angle of the tyres, and steering angle as the argument of the friction's sign, rad.
    pub argument_rad: f64,
    /// Front cornering force f, N.
    pub front_original_n: f64,
    /// The front's mean n under the dither, N.
    pub front_effective_n: f64,
    /// Rear cornering force f, N.
    pub rear_original_n: f64,
    /// The rear's mean n under the dither, N.
    pub rear_effective_n: f64,
    /// Friction torque f = tau_c sgn(delta_f) as printed in (13), N m.
    pub friction_original_nm: f64,
    /// Its mean n under the dither, N m.
    pub friction_effective_nm: f64,
}

/// The scenario's tyres and the printed friction law (13), and their means under the scenario's
/// dither, up to an argument: (21) for the square wave, Figures 9 to 11; (25) to (27) for the sine,
/// Figures 14 to 16.
pub fn nonlinearities(scenario: &Scenario<f64>, greatest_rad: f64) -> Vec<NonlinearityRow> {
    let tire = |coefficients| Tire::new(scenario.tires.model, coefficients);
    let (front, rear) = (tire(&scenario.tires.front), tire(&scenario.tires.rear));
    let mut friction = scenario.friction;
    friction.law = FrictionLaw::PrintedAngle;
    let limit_nm = friction.limit_nm(scenario.steering.pneumatic_trail_m);
    let mut averaged = scenario.dither;
    averaged.application = Application::Averaged;
    let dither = averaged.injection(0.0);
    let sign = |injection, argument| Sign::new(injection).at(argument);
    let row = |argument_rad| NonlinearityRow {
        argument_rad,
        front_original_n: front.force(argument_rad, Injection::Off),
        front_effective_n: front.force(argument_rad, dither),
        rear_original_n: rear.force(argument_rad, Injection::Off),
        rear_effective_n: rear.force(argument_rad, dither),
        friction_original_nm: limit_nm * sign(Injection::Off, argument_rad),
        friction_effective_nm: limit_nm * sign(dither, argument_rad),
    };
    arguments(greatest_rad).map(row).collect()
}

/// The figure of [`nonlinearities`]: front tyre, rear tyre, friction.
pub fn nonlinearities_chart(scenario: &Scenario<f64>, rows: &[NonlinearityRow]) -> Chart {
    let dither = &scenario.dither;
    let waveform = match dither.waveform {
        Waveform::None => "no",
        Waveform::Square => "square",
        Waveform::Sine => "sine",
    };
    let formula = match scenario.tires.model {
        TireModel::Cubic => "cubic tyre",
        TireModel::MagicFormula => "Magic Formula",
    };
    let panel = |caption: String,
                 (x, y): (&str, &str),
                 original: fn(&NonlinearityRow) -> f64,
                 effective: fn(&NonlinearityRow) -> f64| {
        let curve = |value: fn(&NonlinearityRow) -> f64| {
            rows.iter().map(move |row| (row.argument_rad, value(row)))
        };
        let greatest = rows.last().map_or(1.0, |row| row.argument_rad);
        Panel {
            caption,
            x: AxisSpec::linear(x).from_to(-greatest, greatest),
            y: AxisSpec::linear(y),
            series: vec![
                line("original nonlinearity f", 5, curve(original)),
                line("effective nonlinearity n", 0, curve(effective)),
            ],
            levels: vec![0.0],
            ..Panel::default()
        }
    };
    Chart {
        heading: format!(
            "Effective and original nonlinearity \u{2013} {waveform} dither of {} V ({} rad)",
            four_digits(dither.amplitude_v),
            four_digits(dither.amplitude_rad())
        ),
        panels: vec![
            panel(
                format!("front, {formula}"),
                ("slip angle \u{3b1} (rad)", "force (N)"),
                |row| row.front_original_n,
                |row| row.front_effective_n,
            ),
            panel(
                format!("rear, {formula}"),
                ("slip angle \u{3b1} (rad)", "force (N)"),
                |row| row.rear_original_n,
                |row| row.rear_effective_n,
            ),
            panel(
                "friction torque as printed, \u{3c4} = \u{3c4}c sgn(\u{3b4}f)".into(),
                ("steering angle \u{3b4}f (rad)", "torque (N m)"),
                |row| row.friction_original_nm,
                |row| row.friction_effective_nm,
            ),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dithered(waveform: Waveform, amplitude_v: f64) -> Scenario<f64> {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = waveform;
        scenario.dither.amplitude_v = amplitude_v;
        scenario
    }

    #[test]
    fn the_cubic_tyre_follows_the_magic_formula_at_small_slip() {
        let rows = tires(&Scenario::reconstruction(), 0.01);
        assert_eq!(rows.len(), 2 * 2 * (STEPS as usize + 1));
        for row in &rows {
            // The next term is of fifth order.
            let error = (row.magic_formula_n - row.cubic_n).abs();
            assert!(error < 1e-2 * row.magic_formula_n.abs() + 1e-9, "{row:?}");
        }
        let mut other = Scenario::reconstruction();
        other.tires.front.peak_n = 3000.0;
        let rows = tires(&other, 0.3);
        assert_eq!(rows.len(), 3 * 2 * (STEPS as usize + 1));
        assert_eq!(tires_chart(&other, &rows).panels.len(), 3);
    }

    /// (21) and (27) by hand: the mean of the shifted functions, and the arcsine within the
    /// amplitude.
    #[test]
    fn effective_nonlinearities_are_the_means_of_the_original_ones() {
        let scenario = dithered(Waveform::Square, 0.1);
        let cubic = scenario.tires.front.cubic();
        for row in nonlinearities(&scenario, 0.3) {
            let alpha = row.argument_rad;
            let mean = 0.5 * (cubic.force(alpha + 0.1) + cubic.force(alpha - 0.1));
            assert!((row.front_effective_n - mean).abs() < 1e-9);
            if alpha.abs() < 0.0999 {
                assert_eq!(row.friction_effective_nm, 0.0);
            }
        }
        let scenario = dithered(Waveform::Sine, 1.0);
        let amplitude = scenario.dither.amplitude_rad();
        for row in nonlinearities(&scenario, 0.3) {
            let ratio = (row.argument_rad / amplitude).clamp(-1.0, 1.0);
            let mean = 6.5856 * ratio.asin() / std::f64::consts::FRAC_PI_2;
            assert!((row.friction_effective_nm - mean).abs() < 1e-9, "{row:?}");
        }
    }

    #[test]
    fn the_true_signal_has_the_same_means() {
        let averaged = dithered(Waveform::Sine, 1.0);
        let mut signal = averaged;
        signal.dither.application = Application::Signal;
        assert_eq!(nonlinearities(&signal, 0.3), nonlinearities(&averaged, 0.3));
    }
}
