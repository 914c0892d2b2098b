//! Beyond the paper: a suppression that the motor can produce, beside the dither that it cannot.

use super::characteristics::{SINE_V, SQUARE_V};
use super::figures::name_of;
use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, csv_of};
use dynamics::component::Component;
use dynamics::delayed_feedback::{
    Cell, CellRow, Conditions, Feedback, Held, Plan, Point, PointRow, chart, over_speed, region,
    region_chart,
};
use dynamics::realisability::{Amplitudes, demands};
use dynamics::sweep::{Parameter, RunControl, SweepError, Values, scenarios};
use shared_model::Scenario;

/// Greatest torque of the feedback, N m: half of the motor's.
const LIMIT_NM: f64 = 8.0;
/// Greatest error of the delay in the region, s, and speeds of the regions, rpm.
const ERROR_S: f64 = 0.02;
const REGION_SPEEDS_RPM: (f64, f64, f64) = (1700.0, 1900.0, 100.0);

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
            mixed: None,
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
    let rows: Vec<PointRow> = points.iter().map(PointRow::from).collect();
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
) -> Result<Vec<Cell>, SweepError> {
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
        let (needed_nm, motor_nm) = (demand.inertia_torque_nm, demand.motor_torque_nm);
        let can = if needed_nm <= motor_nm { "yes" } else { "no" };
        (
            format!("The {} dither", name_of(demand.waveform)),
            format!("realisable by the actuator of Table 2: {can}; it needs {needed_nm:.2e} N m where the motor has {motor_nm:.1} N m"),
        )
    });
    let (held, longest_s, left_nm) = captures(points, |point| &point.held);
    let feedback = (
        "Delayed feedback".to_owned(),
        format!(
            "realisable by the actuator of Table 2: yes; it holds the orbit at {} of {} speeds from 1640 to 2000 rpm, captured after \
             up to {:.0} s with at most {LIMIT_NM} N m; {:.4} N m root mean square are left. The yaw rate stays as great as in \
             chaos, where the dither makes it smaller.",
            held,
            points.len(),
            longest_s,
            left_nm
        ),
    );
    dithers
        .into_iter()
        .chain([feedback, to_rest(points)])
        .collect()
}

fn to_rest(points: &[Point]) -> (String, String) {
    let (at_rest, longest_s, left_nm) = captures(points, |point| &point.to_rest);
    (
        "Feedback of the whole state".to_owned(),
        format!(
            "realisable by the actuator of Table 2: yes, but there is no sensor of the sideslip angle; the vehicle comes to rest at \
             {at_rest} of {} speeds from 1640 to 2000 rpm, after up to {longest_s:.0} s with at most {LIMIT_NM} N m; at most \
             {left_nm:.2} N m root mean square are left, which friction holds.",
            points.len()
        ),
    )
}

/// The number of captures, the longest time to one, s, and the greatest torque that is left, N m.
fn captures(points: &[Point], of: fn(&Point) -> &Held) -> (usize, f64, f64) {
    let captured = points
        .iter()
        .map(of)
        .filter_map(|held| Some((held.capture_s?, held)));
    captured.fold(
        (0, 0.0, 0.0),
        |(count, longest_s, left_nm), (capture_s, held)| {
            (
                count + 1,
                capture_s.max(longest_s),
                held.torque_rms_nm.max(left_nm),
            )
        },
    )
}
