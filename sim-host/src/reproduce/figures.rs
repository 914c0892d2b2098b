//! Figures 12 and 17, and the averaged system against the true signal.

use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, Table};
use dynamics::averaging;
use dynamics::period::{TOLERANCE, period};
use dynamics::simulate::{settle, simulate, started_at};
use dynamics::sweep::RunControl;
use dynamics::trace::Trace;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::vehicle::{SIDESLIP, YAW_RATE};

const DITHERED_RPM: f64 = 1750.0;
const TRANSIENT_S: f64 = 200.0;
/// Length of the motion shown, s, and of its transient under dither.
const SHOWN_S: f64 = 15.0;
const RUN_S: f64 = 60.0;
const SETTLED_S: f64 = 23.0;
/// Lowest frequency of dither that is compared with averaging, rad/s.
const LOWEST_RAD_PER_S: f64 = 200.0;
/// Every state of this number is shown: the curves are smooth.
const SHOWN_EVERY: usize = 5;

/// Waveform, amplitude (V) and number of the paper's two controlled motions.
const CONTROLLED: [(Waveform, f64, &str); 2] =
    [(Waveform::Square, 0.1, "12"), (Waveform::Sine, 1.0, "17")];

/// Figures 12 and 17: time response of the slip angle with the dither from 3 s on, and phase
/// portrait.
pub fn suppression(named: &Named, _quality: Quality, watch: RunControl) -> Made {
    let mut base = named.scenario;
    base.run.wheel_speed_rpm = DITHERED_RPM;
    base.run.duration_s = RUN_S;
    let start = settle(&base, TRANSIENT_S)?;
    let base = started_at(&base, &start);
    let before = simulate(&base)?;
    let mut material = Material::default();
    for (waveform, amplitude_v, number) in CONTROLLED {
        let mut scenario = base;
        scenario.dither.waveform = waveform;
        scenario.dither.amplitude_v = amplitude_v;
        let after = simulate(&scenario)?;
        let ends = period(&after, after.index_after(SETTLED_S), TOLERANCE);
        let word = name_of(waveform);
        let name = &named.name;
        material.drawings.push(Drawing {
            name: format!("figure-{number}-{name}"),
            caption: format!(
                "Figure {number} ({name}): {word} dither of {amplitude_v} V from 3 s on at {DITHERED_RPM} rpm; it leads to \
                 {ends}. Above: time response. Below: phase portrait of the last {:.0} s.",
                RUN_S - SETTLED_S
            ),
            chart: chart(number, &before, &after, scenario.dither.start_time_s),
            csv: table(&before, &after).csv(),
        });
        material.findings.push((
            format!("{word} dither of {amplitude_v} V"),
            format!("leads to {ends}"),
        ));
        (watch.done)();
    }
    Ok(material)
}

/// The waveform's name.
pub fn name_of(waveform: Waveform) -> &'static str {
    match waveform {
        Waveform::None => "no dither",
        Waveform::Square => "square",
        Waveform::Sine => "sine",
    }
}

fn points(trace: &Trace, until_s: f64) -> Vec<(f64, f64)> {
    let states = trace.states.iter().enumerate().step_by(SHOWN_EVERY);
    states
        .map(|(k, state)| (trace.time_s(k), state.x[SIDESLIP]))
        .take_while(|&(time_s, _)| time_s <= until_s)
        .collect()
}

fn chart(number: &str, before: &Trace, after: &Trace, start_s: f64) -> Chart {
    let series = |label: &str, line, points| Series {
        label: label.into(),
        points,
        look: Look::Line(line),
    };
    let orbit = |trace: &Trace| {
        let settled = &trace.states[trace.index_after(SETTLED_S)..];
        let shown = settled.iter().step_by(SHOWN_EVERY);
        shown
            .map(|state| (state.x[SIDESLIP], state.x[YAW_RATE]))
            .collect()
    };
    Chart {
        heading: format!("Figure {number}: chaos suppressed"),
        panels: vec![
            Panel {
                x: AxisSpec::linear("time (s)").from_to(0.0, SHOWN_S),
                y: AxisSpec::linear("sideslip angle (rad)"),
                series: vec![
                    series("without dither", 5, points(before, SHOWN_S)),
                    series("with dither", 0, points(after, SHOWN_S)),
                ],
                instants: vec![(start_s, "dither on".into())],
                ..Panel::default()
            },
            Panel {
                x: AxisSpec::linear("sideslip angle (rad)"),
                y: AxisSpec::linear("yaw rate (rad/s)"),
                series: vec![series("", 5, orbit(before)), series("", 0, orbit(after))],
                ..Panel::default()
            },
        ],
    }
}

fn table(before: &Trace, after: &Trace) -> Table {
    let mut table = Table::new(&[
        "time_s",
        "sideslip_without_rad",
        "yaw_rate_without_rad_per_s",
        "sideslip_with_rad",
        "yaw_rate_with_rad_per_s",
    ]);
    let pairs = before.states.iter().zip(&after.states).enumerate();
    for (k, (without, with)) in pairs.step_by(SHOWN_EVERY) {
        table.push(&[
            before.time_s(k),
            without.x[SIDESLIP],
            without.x[YAW_RATE],
            with.x[SIDESLIP],
            with.x[YAW_RATE],
        ]);
    }
    table
}

/// The true signal against the averaged system from 200 to 20,000 rad/s.
pub fn averaging(named: &Named, quality: Quality, watch: RunControl) -> Made {
    let (count, decades) = match quality {
        Quality::Quick => (3, 1.3),
        Quality::Full => (17, 2.0),
    };
    let share = |k: i32| f64::from(k) / f64::from(count - 1);
    let frequencies: Vec<f64> = (0..count)
        .map(|k| LOWEST_RAD_PER_S * 10_f64.powf(decades * share(k)))
        .collect();
    let mut material = Material::default();
    let mut panels = Vec::new();
    let mut table = Table::new(&[
        "amplitude_v",
        "frequency_rad_per_s",
        "cycle_difference_percent",
        "swing_difference_percent",
    ]);
    for (waveform, amplitude_v, _) in CONTROLLED {
        let scenario = dithered(&named.scenario, waveform, amplitude_v);
        let compared = averaging::compare(&scenario, &frequencies)?;
        (watch.done)();
        let mut curves = [Vec::new(), Vec::new()];
        for one in &compared {
            if let (Some(cycle), Some(swing)) =
                (one.cycle_difference_percent, one.swing_difference_percent)
            {
                table.push(&[amplitude_v, one.frequency_rad_per_s, cycle, swing]);
                curves[0].push((one.frequency_rad_per_s, cycle.abs()));
                curves[1].push((one.frequency_rad_per_s, swing.abs()));
            }
        }
        let apart = compared
            .iter()
            .filter(|one| one.period != one.averaged_period);
        let apart: Vec<String> = apart
            .map(|one| format!("{:.0}", one.frequency_rad_per_s))
            .collect();
        let word = format!("{} of {amplitude_v} V", name_of(waveform));
        material.findings.push((
            format!("Averaging, {word}"),
            match (&apart[..], curves[1].first()) {
                ([], Some((frequency, swing))) => format!(
                    "same period at all frequencies from {frequency:.0} rad/s on, where the swing differs by {swing:.2} %"
                ),
                _ => format!("another period than the averaged system at {} rad/s", apart.join(", ")),
            },
        ));
        let [cycle, swing] = curves;
        let series = |label: &str, line, points| Series {
            label: label.into(),
            points,
            look: Look::Line(line),
        };
        panels.push(Panel {
            caption: word,
            x: AxisSpec::logarithmic("dither frequency (rad/s)"),
            y: AxisSpec::logarithmic("difference (%)"),
            series: vec![
                series("cycle time", 0, cycle),
                series("swing of the yaw rate", 1, swing),
            ],
            ..Panel::default()
        });
    }
    material.drawings.push(Drawing {
        name: format!("averaging-{}", named.name),
        caption: format!(
            "Averaging ({}): difference of the true signal's motion from the averaged system's, over the dither's frequency.",
            named.name
        ),
        chart: Chart {
            heading: "The true dither signal against the averaged system".into(),
            panels,
        },
        csv: table.csv(),
    });
    Ok(material)
}

fn dithered(scenario: &Scenario<f64>, waveform: Waveform, amplitude_v: f64) -> Scenario<f64> {
    let mut scenario = *scenario;
    scenario.run.wheel_speed_rpm = DITHERED_RPM;
    scenario.dither.waveform = waveform;
    scenario.dither.amplitude_v = amplitude_v;
    scenario
}
