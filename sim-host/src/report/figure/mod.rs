//! The figures, each an SVG document.

mod divergence;
mod instructions;
mod one_step_defect;
mod phase_portrait;
mod pwm_trace;
mod time_response;

use crate::report::input::ReportInput;

/// A figure of the report.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Name of its file, without `.svg`.
    pub name: String,
    /// Contents of the figure and how it was drawn.
    pub caption: String,
    /// The SVG document.
    pub svg: String,
}

/// All figures of a report, in the order in which they are shown. The pairs' indices must be valid.
pub fn all(input: &ReportInput) -> Vec<Figure> {
    let mut figures = Vec::new();
    for pair in input.pairs {
        let (before, after) = (&input.runs[pair.before], &input.runs[pair.after]);
        figures.push(Figure {
            name: format!("time-response-{}", after.id),
            caption: format!(
                "{}. Firmware telemetry with dither (solid) and without (dotted).",
                pair.title
            ),
            svg: time_response::draw(&pair.title, before, after),
        });
        figures.push(Figure {
            name: format!("phase-portrait-{}", after.id),
            caption: format!(
                "{}. Settled motion: the second half of each run, on the same axes.",
                pair.title
            ),
            svg: phase_portrait::draw(&pair.title, before, after),
        });
    }
    if input.runs.iter().any(|run| run.dither_start_s.is_some()) {
        figures.push(Figure {
            name: "pwm-trace".into(),
            caption: "Voltage of each PWM period from its duty code around the dither's start: \
                the dither at the motor's half bridge, quantised in time and in counts."
                .into(),
            svg: pwm_trace::draw(input.runs),
        });
    }
    figures.push(Figure {
        name: "divergence".into(),
        caption:
            "Distance of free f32 and f64 runs from the same start. Above: chaotic runs, each \
            with the time of separation predicted from the Lyapunov exponent (shaded: least to \
            greatest, line: expected). Below: runs that must stay below the limit. The curves show \
            the greatest value in each interval."
                .into(),
        svg: divergence::draw(input.runs),
    });
    figures.push(Figure {
        name: "one-step-defect".into(),
        caption: "Defect of each f32 step on the firmware against the host's f64 step from the \
            same state, over its rounding bound: at most 1 passes. The curves show the greatest value \
            in each interval. Values below the axis lie on its lower edge."
            .into(),
        svg: one_step_defect::draw(input.runs),
    });
    let runs = input.runs.iter();
    let runs = runs.map(|run| (run.title.as_str(), &run.instructions));
    let drives = input.drives.iter();
    let drives = drives.map(|driven| {
        let title = driven.title.trim_end_matches(" as scheduled");
        (title, &driven.instructions)
    });
    let rows: Vec<_> = runs.chain(drives).collect();
    figures.push(Figure {
        name: "instructions".into(),
        caption: "Histograms of the instructions of the control task, and of the slowest PWM task \
            of each step."
            .into(),
        svg: instructions::draw(&rows),
    });
    for driven in input.drives {
        figures.push(Figure {
            name: driven.id.clone(),
            caption: format!(
                "{}. The vehicle on the host, the ECU on the emulated target, one exchange per PWM period.",
                driven.title
            ),
            // The heading names the loop itself.
            svg: pil::figure::draw(driven.title.trim_start_matches("in the loop, "), &driven.run),
        });
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::input::{Pair, RunReport};
    use crate::report::sample;
    use nalgebra::Vector4;

    /// All figures of one run paired with itself.
    fn figures_of(run: RunReport) -> Vec<Figure> {
        let verdict = sample::verdict();
        let pairs = [Pair {
            title: "with itself".into(),
            before: 0,
            after: 0,
        }];
        let runs = [run];
        all(&sample::input(&verdict, &runs, &pairs))
    }

    #[test]
    fn an_empty_run_gives_figures_without_data() {
        let figures = figures_of(sample::empty_run());
        assert_eq!(figures.len(), 6);
        for figure in figures {
            assert!(figure.svg.contains("no data"), "{}", figure.name);
        }
    }

    #[test]
    fn not_a_number_everywhere_gives_figures_without_data() {
        let mut run = sample::runs().remove(1);
        for state in &mut run.trace.states {
            state.x = Vector4::repeat(f64::NAN);
        }
        for point in run.one_step_defect.iter_mut().chain(&mut run.divergence) {
            point.1 = f64::NAN;
        }
        for figure in figures_of(run) {
            assert!(!figure.svg.contains("NaN"), "{}", figure.name);
            let measured_elsewhere = ["pwm-trace", "instructions"].contains(&&*figure.name);
            assert!(
                measured_elsewhere || figure.svg.contains("no data"),
                "{}",
                figure.name
            );
        }
    }

    #[test]
    fn extreme_values_do_not_panic() {
        let mut run = sample::runs().remove(1);
        for (k, state) in run.trace.states.iter_mut().enumerate() {
            state.x = Vector4::repeat(if k % 2 == 0 { 1e300 } else { -1e300 });
        }
        run.one_step_defect = vec![(0.0, 0.0), (1.0, f64::INFINITY), (2.0, 1e-300)];
        run.divergence = vec![(0.0, 0.0); 3];
        run.horizon_s = Some([f64::NAN, 1.0, 1e9]);
        run.dither_start_s = Some(1e9);
        run.instructions.control = vec![(0, 0), (u32::MAX, u64::MAX)];
        assert_eq!(figures_of(run).len(), 6);
    }

    #[test]
    fn figures_have_an_accessible_title_and_escape_it() {
        let mut run = sample::runs().remove(1);
        run.title = "a < b & c".into();
        for figure in figures_of(run) {
            assert!(figure.svg.starts_with("<svg "), "{}", figure.name);
            assert!(figure.svg.contains("<title>"), "{}", figure.name);
            assert!(!figure.svg.contains("a < b"), "{}", figure.name);
        }
    }
}
