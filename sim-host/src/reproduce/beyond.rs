//! Beyond the paper: a suppression that the motor can produce, beside the dither that it cannot.

use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, csv_of};
use dynamics::component::Component;
use dynamics::delayed_feedback::{
    Cell, Conditions, Feedback, Plan, Point, chart, over_speed, region, region_chart,
};
use dynamics::realisability::{Amplitudes, demands};
use dynamics::sweep::{Parameter, RunControl, Values, scenarios};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// Amplitudes of the paper's dither, V.
const SQUARE_V: f64 = 0.1;
const SINE_V: f64 = 1.0;
/// Greatest torque of the feedback, N m: half of the motor's.
const LIMIT_NM: f64 = 8.0;
/// Greatest error of the delay in the region, s, and speeds of the regions, rpm.
const ERROR_S: f64 = 0.02;
const REGION_SPEEDS_RPM: (f64, f64, f64) = (1700.0, 1900.0, 100.0);

/// A row of the data.
#[derive(Serialize)]
struct Row {
    wheel_speed_rpm: f64,
    period_s: f64,
    free_multiplier: f64,
    gain: f64,
    multiplier: f64,
    torque_rms_nm: f64,
    capture_s: Option<f64>,
}

impl From<&Point> for Row {
    fn from(point: &Point) -> Self {
        Self {
            wheel_speed_rpm: point.wheel_speed_rpm,
            period_s: point.period_s,
            free_multiplier: point.free_multiplier,
            gain: point.best.gain,
            multiplier: point.best.multiplier,
            torque_rms_nm: point.held.torque_rms_nm,
            capture_s: point.held.capture_s,
        }
    }
}

/// A row of the data of the regions.
#[derive(Serialize)]
struct CellRow {
    wheel_speed_rpm: f64,
    gain: f64,
    delay_error_s: f64,
    multiplier: f64,
    maxima: Option<usize>,
    torque_rms_nm: f64,
}

impl From<&Cell> for CellRow {
    fn from(cell: &Cell) -> Self {
        Self {
            wheel_speed_rpm: cell.wheel_speed_rpm,
            gain: cell.gain,
            delay_error_s: cell.delay_error_s,
            multiplier: cell.multiplier,
            maxima: cell.held.maxima,
            torque_rms_nm: cell.held.torque_rms_nm,
        }
    }
}

/// Steps of speeds and gains, number of errors, and length of the simulations.
struct Grid {
    speed_step_rpm: f64,
    gain_step: f64,
    errors: usize,
    time_s: f64,
}

impl Grid {
    fn of(quality: Quality) -> Self {
        match quality {
            Quality::Quick => Self {
                speed_step_rpm: 60.0,
                gain_step: 4.0,
                errors: 5,
                time_s: 100.0,
            },
            Quality::Full => Self {
                speed_step_rpm: 20.0,
                gain_step: 1.0,
                errors: 11,
                time_s: 200.0,
            },
        }
    }
}

fn plan(gains: Values, time_s: f64) -> Plan {
    Plan {
        feedback: Feedback {
            component: Component::YAW_RATE,
            // Both are chosen at each speed.
            gain: 0.0,
            delay_s: 0.0,
            memory: 0.0,
            limit_nm: LIMIT_NM,
            adaptation: 0.0,
            latency_ticks: 0,
        },
        gains,
        delay_error_s: 0.0,
        conditions: Conditions {
            free_s: 50.0,
            time_s,
            noise: 0.0,
        },
    }
}

/// Delayed feedback over the speed, its region of gain and delay, and its comparison with the dither.
pub fn beyond(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let grid = Grid::of(quality);
    let scenario = &named.scenario;
    let speeds = Values::new(Parameter::Speed.name(), 1640.0, 2000.0, grid.speed_step_rpm)?;
    let tried = plan(Values::new("gain", 0.5, 12.0, 0.5)?, 300.0);
    let points = over_speed(scenario, &speeds, &tried, scenario, watch)?;
    let points: Vec<Point> = points.into_iter().flatten().collect();
    let mut material = Material::default();
    if points.is_empty() {
        let says = "no unstable orbit of one cycle is found from 1640 to 2000 rpm".to_owned();
        material.findings.push(("Delayed feedback".into(), says));
        return Ok(material);
    }
    let rows: Vec<Row> = points.iter().map(Row::from).collect();
    material.drawings.push(Drawing {
        name: format!("feedback-{}", named.name),
        caption: format!(
            "Delayed feedback of the yaw rate through the motor, at most {LIMIT_NM} N m: multipliers of the orbit of one cycle, \
             and the torque that is left."
        ),
        chart: chart(&points),
        csv: csv_of(&rows),
    });
    let cells = regions(scenario, &grid, watch)?;
    if !cells.is_empty() {
        let rows: Vec<CellRow> = cells.iter().map(CellRow::from).collect();
        material.drawings.push(Drawing {
            name: format!("feedback-region-{}", named.name),
            caption: "Gains and delays that hold the orbit, by simulation from chaos.".into(),
            chart: region_chart(&cells, &tried.feedback),
            csv: csv_of(&rows),
        });
    }
    material.findings = comparison(scenario, &points);
    Ok(material)
}

fn regions(
    scenario: &Scenario<f64>,
    grid: &Grid,
    watch: RunControl,
) -> Result<Vec<Cell>, dynamics::sweep::SweepError> {
    let (from, to, step) = REGION_SPEEDS_RPM;
    let speeds = Values::new(Parameter::Speed.name(), from, to, step)?;
    let errors = Values::between("error of the delay (s)", -ERROR_S, ERROR_S, grid.errors)?;
    let plan = plan(Values::new("gain", 1.0, 12.0, grid.gain_step)?, grid.time_s);
    let of_speed = |scenario: &Scenario<f64>| region(scenario, &plan, &errors, scenario, watch);
    let all = scenarios(scenario, Parameter::Speed, &speeds)?;
    Ok(all.iter().filter_map(of_speed).flatten().collect())
}

/// Feedback and dither, a line each.
fn comparison(scenario: &Scenario<f64>, points: &[Point]) -> Vec<(String, String)> {
    let amplitudes = Amplitudes::from_volts(scenario, SQUARE_V, SINE_V);
    let dithers = demands(scenario, &amplitudes).map(|demand| {
        let name = match demand.waveform {
            Waveform::Sine => "sine, 1.0 V",
            Waveform::Square | Waveform::None => "square wave, 0.1 V",
        };
        let (needed_nm, motor_nm) = (demand.inertia_torque_nm, demand.motor_torque_nm);
        let can = if needed_nm <= motor_nm { "yes" } else { "no" };
        (
            format!("Dither ({name})"),
            format!("realisable by the actuator of Table 2: {can}; it needs {needed_nm:.2e} N m where the motor has {motor_nm:.1} N m"),
        )
    });
    let held: Vec<&Point> = points
        .iter()
        .filter(|point| point.held.capture_s.is_some())
        .collect();
    let greatest =
        |value: fn(&Point) -> f64| held.iter().map(|point| value(point)).fold(0.0, f64::max);
    let feedback = (
        "Delayed feedback".to_owned(),
        format!(
            "realisable by the actuator of Table 2: yes; it holds the orbit at {} of {} speeds from 1640 to 2000 rpm, captured after \
             up to {:.0} s with at most {LIMIT_NM} N m; {:.4} N m root mean square are left. The yaw rate stays as great as in \
             chaos, where the dither makes it smaller.",
            held.len(),
            points.len(),
            greatest(|point| point.held.capture_s.unwrap_or(0.0)),
            greatest(|point| point.held.torque_rms_nm)
        ),
    );
    dithers.into_iter().chain([feedback]).collect()
}
