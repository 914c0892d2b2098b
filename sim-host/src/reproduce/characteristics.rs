//! Figures 2, 9 to 11 and 14 to 16, and the dither that an actuator can produce.

use super::figures::name_of;
use super::job::Quality;
use super::material::{Drawing, Made, Material, Named, csv_of};
use dynamics::characteristics::{nonlinearities, nonlinearities_chart, tires, tires_chart};
use dynamics::realisability::{Amplitudes, bode_chart, demands, responses};
use dynamics::sweep::RunControl;
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// Greatest slip angle of the figures, rad.
const GREATEST_RAD: f64 = 0.3;
/// The paper's amplitudes, V.
pub const SQUARE_V: f64 = 0.1;
pub const SINE_V: f64 = 1.0;

/// The figures, drawn from closed forms.
pub fn characteristics(named: &Named, _quality: Quality, watch: RunControl) -> Made {
    let (name, scenario) = (&named.name, &named.scenario);
    let forces = tires(scenario, GREATEST_RAD);
    let mut material = Material::default();
    material.drawings.push(Drawing {
        name: format!("figure-02-{name}"),
        caption: format!(
            "Figure 2 ({name}): cornering force against slip angle, both roads of Table 1."
        ),
        chart: tires_chart(scenario, &forces),
        csv: csv_of(&forces),
    });
    for (waveform, amplitude_v, numbers) in [
        (Waveform::Square, SQUARE_V, "09 to 11"),
        (Waveform::Sine, SINE_V, "14 to 16"),
    ] {
        let mut dithered: Scenario<f64> = *scenario;
        dithered.dither.waveform = waveform;
        dithered.dither.amplitude_v = amplitude_v;
        let rows = nonlinearities(&dithered, GREATEST_RAD);
        material.drawings.push(Drawing {
            name: format!("figure-{}-{name}", numbers.replace(" to ", "-")),
            caption: format!(
                "Figures {} ({name}): effective against original nonlinearity under a {} of {amplitude_v} V.",
                numbers.trim_start_matches('0'),
                name_of(waveform)
            ),
            chart: nonlinearities_chart(&dithered, &rows),
            csv: csv_of(&rows),
        });
    }
    let amplitudes = Amplitudes::from_volts(scenario, SQUARE_V, SINE_V);
    let responses = responses(scenario, &amplitudes);
    material.drawings.push(Drawing {
        name: format!("realisability-{name}"),
        caption: format!(
            "Realisability ({name}): frequency response of the steering actuator, and the torque that the paper's \
             amplitude requires."
        ),
        chart: bode_chart(scenario, &responses),
        csv: csv_of(&responses),
    });
    for demand in demands(scenario, &amplitudes) {
        material.findings.push((
            format!("Torque of the {} dither", name_of(demand.waveform)),
            format!(
                "{:.3} rad at {:.0} rad/s need {:.3} MN m; the motor's torque reaches {:.1e} of that amplitude",
                demand.amplitude_rad,
                demand.response.frequency_rad_per_s,
                1e-6 * demand.inertia_torque_nm,
                demand.reached_share()
            ),
        ));
    }
    (watch.done)();
    Ok(material)
}
