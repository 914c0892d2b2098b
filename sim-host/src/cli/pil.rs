//! `sim-host pil`: manoeuvres with the ECU in the loop.

use super::emulator::{link_kinds, machines, open_image};
use super::firmware::find;
use super::measurement::drive;
use super::options::{time_out, waveform};
use super::outcome::Outcome;
use super::output::{Destinations, check, named};
use super::pil_replay;
use anyhow::{Context, ensure};
use dynamics::config::{to_toml, validate};
use files::input;
use files::output::{self, write_json, write_rows, write_text};
use indicatif::{ProgressBar, ProgressStyle};
use pil::can_log;
use pil::comparison::Comparison;
use pil::figure::draw;
use pil::manoeuvre::{self, Manoeuvre};
use pil::mil_sil_pil::{MilSilPil, Target, run_all};
use pil::profile::Profile;
use pil::recording::Recording;
use pil::sensed_plant::lead_in_periods;
use pil::vehicle_node::ecu_scenario;
use qemu::Machine;
use qemu::session::LinkKind;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::path::{Path, PathBuf};

/// Run manoeuvres with the ECU in the loop as a model (MIL), as software on this host (SIL) and as
/// firmware in QEMU (PIL), and compare the three in each PWM period.
///
/// The vehicle is simulated on the host in f64. In each PWM period it responds to the ECU's duty.
/// Firmware and vehicle exchange their data once per control tick or, with `--link files`, once per
/// PWM period, with the same commands. Repeated runs are byte-identical.
#[derive(clap::Args)]
#[command(
    mut_arg("out", |arg| arg.help("Write the vehicle's trajectory as CSV, one row per control tick")),
    mut_arg("json", |arg| arg.help("Write the comparisons as JSON")),
    mut_arg("figure", |arg| arg.help("Draw the manoeuvre as an SVG figure"))
)]
#[command(after_help = "Examples:
  sim-host pil              # 1750 rpm, square dither from 3 s
  sim-host pil --rpm 1880 --dither sine --figure pil.svg
  sim-host pil --scenario examples/manoeuvres/speed-ramp.toml \\
      --record ramp.loop --out ramp.csv
  sim-host pil --replay ramp.loop       # the recorded run, without QEMU
  sim-host pil --mdf4 drive.mf4         # for tools that read MDF 4
  sim-host pil --can-log drive.log      # its frames, as candump writes them
  sim-host pil --replay drive.log --out drive.csv       # the ECU fed with them
  sim-host pil --scenario examples/manoeuvres/*.toml    # a table over all
  sim-host pil --link uart --time 5     # the image `ecu`, over its UART")]
pub struct Arguments {
    /// Manoeuvres, as TOML files [default: constant speed of 1750 rpm, square dither from 3 s, 20
    /// s]
    #[arg(long, value_name = "FILE", num_args = 1..)]
    scenario: Vec<PathBuf>,
    /// Constant wheel speed instead of the manoeuvre's, rpm
    #[arg(long, value_name = "RPM", allow_negative_numbers = true)]
    rpm: Option<f64>,
    /// Waveform of the dither instead of the manoeuvre's: none, square or sine
    #[arg(long, value_name = "WAVEFORM", value_parser = waveform)]
    dither: Option<Waveform>,
    /// Length instead of the manoeuvre's, s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    time: Option<f64>,
    /// Link to the firmware
    #[arg(long, value_parser = link_kinds(), default_value = "ticks")]
    link: LinkKind,
    /// Machine to emulate
    #[arg(long, value_parser = machines(), default_value = "mps2-an386")]
    machine: Machine,
    /// Firmware image (ELF) [default: `bench`, or `ecu` for the link uart, in the folder
    /// DITHERSTEER_FIRMWARE, in `firmware` beside this program, or in target/]
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Record the exchange between firmware and vehicle
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write the frames of both directions as a log of the bus: ASC for a name in .asc, else that of
    /// candump. The CAN database that names the signals is written beside it, with the ending .dbc
    #[arg(long, value_name = "FILE")]
    can_log: Option<PathBuf>,
    /// Write the drive as a measurement file (ASAM MDF 4.10): vehicle and actuator frame at each
    /// control tick, the duty codes in each PWM period
    #[arg(long, value_name = "FILE")]
    mdf4: Option<PathBuf>,
    /// Replay a recorded run without QEMU, and compare; or feed the ECU's program with the sensor
    /// frames of a bus log (candump or ASC), with the configuration of --scenario
    #[arg(long, value_name = "FILE", conflicts_with_all = ["rpm", "dither", "time", "record", "can_log", "mdf4", "json", "figure"])]
    replay: Option<PathBuf>,
    #[command(flatten)]
    files: Destinations,
    /// Time limit for one answer of the firmware, s
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    time_out: f64,
}

const USUAL: &str = include_str!("../../examples/manoeuvres/constant-speed.toml");

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    if let Some(file) = &arguments.replay {
        return arguments.replay(file);
    }
    let time_out = time_out(arguments.time_out)?;
    let manoeuvres = arguments.manoeuvres()?;
    let firmware = arguments.firmware();
    let database = arguments.database();
    arguments.check_outputs(manoeuvres.len(), firmware.as_deref().ok(), &database)?;
    let target = Target {
        image: open_image(&firmware?)?,
        machine: arguments.machine,
        link: arguments.link,
        time_out,
    };
    keep_to_one_core();
    let mut summaries = Vec::new();
    for (scenario, manoeuvre) in &manoeuvres {
        let runs =
            with_progress(scenario, manoeuvre, &target).with_context(|| manoeuvre.name.clone())?;
        arguments.write(scenario, manoeuvre, &runs)?;
        if let Some(path) = &database {
            write_text(path, can_log::DATABASE, arguments.files.force)?;
        }
        // Only the summary is stored, because a run may be long.
        summaries.push(Summary::of(&runs));
    }
    if let Some(path) = &arguments.files.json {
        write_json(path, &summaries, arguments.files.force)?;
    }
    show(&summaries, arguments.link);
    Ok(if summaries.iter().all(|summary| summary.agree) {
        Outcome::Success
    } else {
        Outcome::Failed
    })
}

/// Host and emulator alternate. On one core this costs a context switch; on two it costs a wake-up,
/// which can take several times as long.
fn keep_to_one_core() {
    use rustix::thread::{CpuSet, sched_getcpu, sched_setaffinity};
    let mut core = CpuSet::new();
    core.set(sched_getcpu());
    // Without permission, the run only takes longer.
    let _ = sched_setaffinity(None, &core);
}

impl Arguments {
    fn firmware(&self) -> anyhow::Result<PathBuf> {
        match (&self.firmware, self.link) {
            (Some(firmware), _) => Ok(firmware.clone()),
            (None, LinkKind::Uart) => find::image("ecu"),
            (None, _) => find::image("bench"),
        }
    }

    fn manoeuvres(&self) -> anyhow::Result<Vec<(Scenario<f64>, Manoeuvre)>> {
        let mut manoeuvres = Vec::new();
        for file in &self.scenario {
            let loaded = manoeuvre::load(file);
            manoeuvres.push(loaded.with_context(|| file.display().to_string())?);
        }
        if self.scenario.is_empty() {
            manoeuvres.push(manoeuvre::from_text(USUAL)?);
        }
        for (scenario, manoeuvre) in &mut manoeuvres {
            self.adapt(scenario, manoeuvre)?;
        }
        Ok(manoeuvres)
    }

    fn replay(&self, file: &Path) -> anyhow::Result<Outcome> {
        let input = pil_replay::open(file)?;
        if input.is_recording {
            ensure!(
                self.scenario.is_empty() && self.files.out.is_none(),
                "{} is a recorded run, which has its configuration: --scenario and --out are for a bus log",
                file.display()
            );
            return pil_replay::recording(file, input);
        }
        ensure!(
            self.scenario.len() < 2,
            "--replay with {} scenarios: must be one",
            self.scenario.len()
        );
        let manoeuvres = self.manoeuvres()?;
        let (scenario, manoeuvre) = &manoeuvres[0];
        let inputs = [("--replay", file)];
        let scenarios = self
            .scenario
            .iter()
            .map(|file| ("--scenario", file.as_path()));
        check(
            inputs.into_iter().chain(scenarios),
            [named("--out", &self.files.out)],
            self.files.force,
        )?;
        let ecu = ecu_scenario(scenario, manoeuvre);
        pil_replay::log(
            file,
            input,
            &ecu,
            self.files.out.as_deref(),
            self.files.force,
        )
    }

    fn adapt(&self, scenario: &mut Scenario<f64>, manoeuvre: &mut Manoeuvre) -> anyhow::Result<()> {
        if let Some(rpm) = self.rpm {
            manoeuvre.wheel_speed_rpm = Profile::constant(rpm);
            manoeuvre.name = format!("{}, at {rpm} rpm", manoeuvre.name);
        }
        if let Some(waveform) = self.dither {
            scenario.dither.waveform = waveform;
        }
        scenario.run.duration_s = self.time.unwrap_or(scenario.run.duration_s);
        scenario.servo.timer_clock_hz = self.machine.timer_clock_hz();
        manoeuvre.validate()?;
        validate(&manoeuvre.begin(scenario))?;
        Ok(())
    }

    /// Rejects invalid outputs before the work begins.
    fn check_outputs(
        &self,
        manoeuvres: usize,
        firmware: Option<&Path>,
        database: &Option<PathBuf>,
    ) -> anyhow::Result<()> {
        let [out, json, figure] = self.files.files();
        let (record, can_log) = (&self.record, &self.can_log);
        let of_one = [
            named("--record", record),
            named("--can-log", can_log),
            named("--mdf4", &self.mdf4),
            out,
            figure,
        ];
        for (option, _) in of_one.into_iter().flatten() {
            ensure!(
                manoeuvres == 1,
                "{option} with {manoeuvres} manoeuvres: must be one manoeuvre; give one --scenario"
            );
        }
        let scenarios = self.scenario.iter();
        let firmware = firmware.map(|firmware| ("--firmware", firmware));
        let inputs = scenarios.map(|file| ("--scenario", file.as_path()));
        let database = named("the CAN database of --can-log", database);
        let files = of_one.into_iter().chain([json, database]);
        check(inputs.chain(firmware), files, self.files.force).map(drop)
    }

    /// The file beside the log for the CAN database, unless it is there; none for a pipe or a device.
    fn database(&self) -> Option<PathBuf> {
        let log = self.can_log.as_deref().filter(|log| output::is_file(log))?;
        let path = log.with_extension("dbc");
        let is_there = output::is_file(&path)
            && input::read(&path, input::TEXT_BYTES, |_| true)
                .is_ok_and(|bytes| bytes == can_log::DATABASE.as_bytes());
        // The log itself is another file than the database, whatever it is now.
        (!is_there || path == log).then_some(path)
    }

    fn write(
        &self,
        scenario: &Scenario<f64>,
        manoeuvre: &Manoeuvre,
        runs: &MilSilPil,
    ) -> anyhow::Result<()> {
        let run = &runs.processor.run;
        if let Some(path) = &self.record {
            let recording = Recording {
                scenario: ecu_scenario(scenario, manoeuvre),
                exchanges: run.exchanges.clone(),
            };
            output::write(path, self.files.force, |to| Ok(recording.write(to)?))?;
        }
        if let Some(path) = &self.can_log {
            let (format, rate_hz) = (can_log::Format::of(path), scenario.run.pwm_rate_hz);
            output::write(path, self.files.force, |to| {
                Ok(can_log::write(&run.exchanges, rate_hz, format, to)?)
            })?;
        }
        if let Some(path) = &self.mdf4 {
            let comment = format!("{}\n\n{}", manoeuvre.name, to_toml(scenario));
            let lead_in = lead_in_periods(scenario, manoeuvre) as usize;
            let rate_hz = scenario.run.pwm_rate_hz;
            drive::write(run, lead_in, rate_hz, comment, path, self.files.force)?;
        }
        if let Some(path) = &self.files.out {
            write_rows(path, &run.records, self.files.force)?;
        }
        if let Some(path) = &self.files.figure {
            write_text(path, &draw(&runs.name, run), self.files.force)?;
        }
        Ok(())
    }
}

fn with_progress(
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    target: &Target,
) -> anyhow::Result<MilSilPil> {
    /// PWM periods between two updates of the progress.
    const REPORTED: u64 = 1000;
    let rate_hz = scenario.run.pwm_rate_hz;
    let bar = ProgressBar::new((scenario.run.duration_s * rate_hz) as u64).with_style(
        ProgressStyle::with_template("{elapsed_precise} [{bar:40}] {percent} % {msg}, {eta} left")
            .expect("the template is valid")
            .progress_chars("=> "),
    );
    bar.set_message(manoeuvre.name.clone());
    let mut periods = 0;
    let runs = run_all(scenario, manoeuvre, target, &mut || {
        periods += 1;
        if periods % REPORTED == 0 {
            bar.set_position(periods);
        }
    });
    bar.finish_and_clear();
    Ok(runs?)
}

/// The summary of a manoeuvre.
#[derive(serde::Serialize)]
struct Summary {
    manoeuvre: String,
    simulated_s: f64,
    model_software: Comparison,
    software_processor: Comparison,
    double_precision_different_duties: usize,
    double_precision_worst_counts: u16,
    agree: bool,
    times_real_time: f64,
    firmware: String,
}

impl Summary {
    fn of(runs: &MilSilPil) -> Self {
        Self {
            manoeuvre: runs.name.clone(),
            simulated_s: runs.simulated_s,
            model_software: runs.model_software,
            software_processor: runs.software_processor,
            double_precision_different_duties: runs.double_precision.different_duties,
            double_precision_worst_counts: runs.double_precision.worst_counts,
            agree: runs.agree(),
            times_real_time: runs.speed(),
            firmware: runs.processor.log.last().cloned().unwrap_or_default(),
        }
    }
}

fn show(summaries: &[Summary], link: LinkKind) {
    say!(
        "{:38} {:>7} {:>9} {:>15} {:>15} {:>15} {:>7}",
        "manoeuvre",
        "s",
        "duties",
        "MIL = SIL",
        "SIL = PIL",
        "f64",
        "speed"
    );
    for summary in summaries {
        let other = summary.double_precision_different_duties;
        let double = match other {
            0 => "equal".into(),
            _ => format!("{other}, <= {}", summary.double_precision_worst_counts),
        };
        say!(
            "{:38} {:7.2} {:9} {:>15} {:>15} {:>15} {:>5.1} x",
            summary.manoeuvre,
            summary.simulated_s,
            summary.software_processor.duties,
            summary.model_software,
            summary.software_processor,
            double,
            summary.times_real_time
        );
    }
    if let [only] = summaries {
        say!("firmware: {}", only.firmware);
    }
    say!(
        "duties and actuator frames are compared bit for bit; `f64`: duty codes of an ECU in f64 that differ, and the greatest difference in counts"
    );
    say!(
        "not compared: costs and times (the emulator counts instructions), the log, and the vehicle, which is the same code in all \
         three; of the frames MIL checks the freshness only, and therefore has other warnings"
    );
    say!(
        "PIL: {}",
        match link {
            LinkKind::Ticks | LinkKind::MeasuredTicks =>
                "over pipes, one exchange per control tick; the host is the clock, and each control tick takes its nominal time",
            LinkKind::Files =>
                "over pipes, one exchange per PWM period; the host is the clock, and each control tick takes its nominal time",
            LinkKind::Timed => "over pipes; the board's timers are the clock",
            LinkKind::Uart =>
                "the image `ecu` over its UART; the board's timers are the clock, the debugger stops them while the vehicle answers",
        }
    );
}
