//! `sim-host equilibria`: equilibria, their eigenvalues, and Hopf bifurcations.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use super::sweep::{SpeedRange, check_interrupted, with_progress};
use anyhow::{bail, ensure};
use dynamics::eigenvalues::Eigenvalue;
use dynamics::equilibria::{Equilibrium, Hopf, Speed, chart, hopf, over_speed};
use dynamics::words::{counted, counted_as};
use serde::Serialize;
use shared_model::vehicle::STEERING_ANGLE;

/// Compute all equilibria at a wheel speed or over a range of speeds, with eigenvalues and
/// stability, and the speeds of Hopf bifurcations.
///
/// The dither is averaged. Coulomb friction holds the steering in a band around each equilibrium,
/// which is reported with it. The eigenvalues are those of the slipping mode beside the
/// equilibrium; the JSON also contains those of the sticking mode.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host equilibria --rpm 1750        # all of the paper's vehicle
  sim-host equilibria --from 1000 --to 2000 --step 10 --figure hopf.svg
  sim-host equilibria --dither square --amplitude-v 0.1 --json equilibria.json")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    range: SpeedRange,
    #[command(flatten)]
    destinations: Destinations,
}

/// Maximum number of speeds; a longer range can be split into several runs.
const MAX_SPEEDS: usize = 100_000;

#[derive(Serialize)]
struct Results {
    speeds: Vec<Speed>,
    hopf: Vec<Hopf>,
}

/// A row of the CSV.
#[derive(Serialize)]
struct Row {
    wheel_speed_rpm: f64,
    sideslip_rad: f64,
    yaw_rate_rad_per_s: f64,
    steering_angle_rad: f64,
    residual: f64,
    stable: bool,
    eigenvalue_1_re_per_s: f64,
    eigenvalue_1_im_per_s: f64,
    eigenvalue_2_re_per_s: f64,
    eigenvalue_2_im_per_s: f64,
    eigenvalue_3_re_per_s: f64,
    eigenvalue_3_im_per_s: f64,
    eigenvalue_4_re_per_s: f64,
    eigenvalue_4_im_per_s: f64,
    stick_band_steering_angle_1_rad: Option<f64>,
    stick_band_steering_angle_2_rad: Option<f64>,
    stable_while_sticking: Option<bool>,
}

impl Row {
    fn new(wheel_speed_rpm: f64, equilibrium: &Equilibrium) -> Self {
        let zero = Eigenvalue { re: 0.0, im: 0.0 };
        let eigenvalue = |k: usize| equilibrium.eigenvalues_per_s.get(k).unwrap_or(&zero);
        let band = equilibrium.stick_band.as_ref();
        Self {
            wheel_speed_rpm,
            sideslip_rad: equilibrium.state[0],
            yaw_rate_rad_per_s: equilibrium.state[1],
            steering_angle_rad: equilibrium.state[2],
            residual: equilibrium.residual,
            stable: equilibrium.stable,
            eigenvalue_1_re_per_s: eigenvalue(0).re,
            eigenvalue_1_im_per_s: eigenvalue(0).im,
            eigenvalue_2_re_per_s: eigenvalue(1).re,
            eigenvalue_2_im_per_s: eigenvalue(1).im,
            eigenvalue_3_re_per_s: eigenvalue(2).re,
            eigenvalue_3_im_per_s: eigenvalue(2).im,
            eigenvalue_4_re_per_s: eigenvalue(3).re,
            eigenvalue_4_im_per_s: eigenvalue(3).im,
            stick_band_steering_angle_1_rad: band.map(|b| b.lower[STEERING_ANGLE]),
            stick_band_steering_angle_2_rad: band.map(|b| b.upper[STEERING_ANGLE]),
            stable_while_sticking: band.map(|b| b.stable),
        }
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    if let Some(time_s) = arguments.run.time {
        bail!("--time {time_s}: has no effect, because equilibria are solved directly; omit it");
    }
    let values = arguments.range.values(&scenario)?;
    ensure!(
        values.count() <= MAX_SPEEDS,
        "{} speeds: must be at most {MAX_SPEEDS}; increase --step",
        values.count()
    );
    arguments.destinations.check(arguments.run.config.input())?;
    let found = with_progress(values.count(), |watch| {
        over_speed(&scenario, &values, watch)
    })?;
    let hopf = hopf(&scenario, &found)?;
    let speed = |(wheel_speed_rpm, equilibria)| Speed {
        wheel_speed_rpm,
        equilibria,
    };
    let results = Results {
        speeds: found.into_iter().map(speed).collect(),
        hopf,
    };
    let rows = results.speeds.iter().flat_map(|speed| {
        let row = |equilibrium| Row::new(speed.wheel_speed_rpm, equilibrium);
        speed.equilibria.iter().map(row)
    });
    arguments.destinations.write(rows, &results, || {
        chart(&results.speeds, &results.hopf).svg()
    })?;
    show(&results);
    check_interrupted(results.speeds.len(), values.count())?;
    Ok(Outcome::Success)
}

fn show(results: &Results) {
    if let [speed] = &results.speeds[..] {
        show_speed(speed);
    } else {
        say!("equilibria at {}", counted(results.speeds.len(), "speed"));
    }
    for hopf in &results.hopf {
        say!(
            "Hopf bifurcation from {:.3} to {:.3} rpm at delta_f = {:.4} rad, {:.4} rad/s: {} above",
            hopf.lower_rpm,
            hopf.upper_rpm,
            hopf.state[STEERING_ANGLE],
            hopf.frequency_rad_per_s,
            if hopf.destabilises {
                "unstable"
            } else {
                "stable"
            }
        );
    }
    if results.speeds.len() > 1 && results.hopf.is_empty() {
        say!("no Hopf bifurcation between these speeds");
    }
}

fn show_speed(speed: &Speed) {
    say!(
        "{} at {} rpm",
        counted_as(speed.equilibria.len(), "equilibrium", "equilibria"),
        speed.wheel_speed_rpm
    );
    for equilibrium in &speed.equilibria {
        let [beta, gamma, delta, _] = equilibrium.state;
        let eigenvalues = &equilibrium.eigenvalues_per_s;
        let eigenvalues: Vec<_> = eigenvalues.iter().map(Eigenvalue::to_string).collect();
        let stability = if equilibrium.stable {
            "stable"
        } else {
            "unstable"
        };
        say!(
            "  beta {beta:.6} rad, gamma {gamma:.6} rad/s, delta_f {delta:.6} rad: {stability}\n    eigenvalues {} 1/s",
            eigenvalues.join(", ")
        );
        if let Some(band) = &equilibrium.stick_band {
            say!(
                "    sticks for delta_f from {:.6} to {:.6} rad, {} while it does",
                band.lower[STEERING_ANGLE].min(band.upper[STEERING_ANGLE]),
                band.lower[STEERING_ANGLE].max(band.upper[STEERING_ANGLE]),
                if band.stable { "stable" } else { "unstable" }
            );
        }
    }
}
