//! A run of the ECU from the command line to the exit code.

use super::command_line::{self, Command};
use super::exit::ExitCode;
use super::host_file::HostFileError;
use super::interrupts::{self, ControlInterrupt, PwmInterrupt};
use super::link::Link;
use super::pace::{self, Pace};
use super::recorder::{self, Recorder};
use super::refusal::{refuse_command, refuse_scenario, refuse_timer_clock};
use super::{counters, drill, in_loop, open_loop, run_state};
use crate::board::{Board, Current};
use crate::{stack, steering};
use shared_model::Scenario;
use shared_model::ecu::Ecu;
use shared_model::open_loop::OpenLoop;
use shared_model::telemetry::Header;

/// Runs the scenario of the command line to its end.
pub fn run() -> ExitCode {
    let run = match command_line::read() {
        Ok(Command::Run(run)) => run,
        Ok(Command::Drill(name)) => return drill::run(name),
        Err(error) => return refuse_command(&error),
    };
    let timer_clock_hz = run.scenario.servo.timer_clock_hz;
    if timer_clock_hz != Current::TIMER_CLOCK_HZ as f32 {
        return refuse_timer_clock(timer_clock_hz);
    }
    match run.link {
        Some(link) => steer(&run.scenario, link),
        None => simulate(&run.scenario, run.telemetry, run.pace),
    }
}

/// The vehicle model runs on the ECU.
// Out of line, as is the other: the stack need not hold what only one of them needs.
#[inline(never)]
fn simulate(scenario: &Scenario<f32>, telemetry: Option<&str>, pace: Pace) -> ExitCode {
    let ecu = match OpenLoop::new(scenario) {
        Ok(ecu) => ecu,
        Err(error) => return refuse_scenario(&error),
    };
    defmt::info!(
        "run of {=f32} s at {=f32} rpm, {=f32} model steps per second",
        scenario.run.duration_s,
        scenario.run.wheel_speed_rpm,
        scenario.model_rate_hz()
    );
    match run_open_loop(scenario, ecu, telemetry, pace) {
        Ok(code) => code,
        Err(HostFileError) => {
            defmt::error!("cannot write the telemetry file");
            ExitCode::TelemetryFailed
        }
    }
}

/// The ECU steers a vehicle on the other end of the link.
#[inline(never)]
fn steer(scenario: &Scenario<f32>, link: &str) -> ExitCode {
    let ecu = match Ecu::new(scenario, Current::COST_CLOCK_HZ) {
        Ok(ecu) => ecu,
        Err(error) => return refuse_scenario(&error),
    };
    let Ok(opened) = Link::open(link) else {
        defmt::error!("cannot open the link {=str}", link);
        return ExitCode::LinkLost;
    };
    defmt::info!("in the loop over the link {=str}", link);
    run_in_loop(scenario, ecu, opened)
}

/// Runs the scenario to its end, with telemetry into the host's file called `telemetry`.
///
/// # Errors
/// If the host cannot write the file.
fn run_open_loop(
    scenario: &Scenario<f32>,
    ecu: OpenLoop<f32>,
    telemetry: Option<&str>,
    pace: Pace,
) -> Result<ExitCode, HostFileError> {
    let neutral = ecu.pwm.neutral();
    let header = Header {
        samples_per_step: scenario.samples_per_step() as u16,
        step_rate_hz: (scenario.model_rate_hz() + 0.5) as u32,
        pwm_period: neutral.period(),
        cost_clock_hz: Current::COST_CLOCK_HZ,
        instruction_rate_hz: Current::INSTRUCTION_RATE_HZ,
        initial: *ecu.control.state(),
    };
    let rings = Recorder::new(telemetry, &header)?;
    let (Some((mut recorder, records)), Some(recording)) = (rings, recorder::take_duty_recording())
    else {
        return Ok(ExitCode::TelemetryFailed);
    };
    let period = neutral.period();
    let (task, control) = (ecu.pwm, ecu.control);
    if pace == Pace::Host {
        counters::leave_pwm_unmeasured();
    }
    interrupts::start(period, scenario, scenario.step_s(), pace, |(pwm, _)| {
        let pwm = cortex_m::singleton!(: open_loop::PwmInterrupt = open_loop::PwmInterrupt {
            task,
            pwm,
            recording,
        })?;
        let control = cortex_m::singleton!(: open_loop::ControlInterrupt = open_loop::ControlInterrupt {
            task: control,
            records,
            steps: scenario.steps(),
            index: 0,
        })?;
        Some((
            PwmInterrupt::OpenLoop(pwm),
            ControlInterrupt::OpenLoop(control),
        ))
    });

    while !run_state::is_finished() {
        let is_taken = recorder.take_one()?;
        if is_taken {
            Current::feed_watchdog();
        }
        match pace {
            Pace::Host => pace::begin_period(),
            Pace::Timer if is_taken => {}
            Pace::Timer => Current::idle(),
        }
    }
    while recorder.take_one()? {}
    recorder.flush()?;
    Current::neutralise_pwm();
    Ok(conclude(counters::overruns()))
}

/// Steers until the host ends the run.
fn run_in_loop(scenario: &Scenario<f32>, ecu: Ecu<f32>, link: Link) -> ExitCode {
    let period = ecu.pwm.neutral().period();
    let tick_s = 1.0 / scenario.run.control_rate_hz;
    let pace = link.pace;
    interrupts::start(period, scenario, tick_s, pace, |(pin, bridge)| {
        let pwm = in_loop::place_pwm(in_loop::PwmInterrupt {
            steering: steering::Pwm {
                task: ecu.pwm,
                pin,
                bridge,
            },
            link,
            frame: None,
            last_tick_counts: Current::cost_counter(),
            nominal_counts: (Current::COST_CLOCK_HZ as f32 * tick_s) as u32,
        })?;
        let control = in_loop::place_control(in_loop::ControlInterrupt {
            steering: steering::Control { task: ecu.control },
        })?;
        Some((PwmInterrupt::InLoop(pwm), ControlInterrupt::InLoop(control)))
    });
    let mut ticks_seen = 0;
    while !run_state::is_finished() {
        let ticks = steering::control_ticks();
        if ticks != ticks_seen {
            ticks_seen = ticks;
            Current::feed_watchdog();
        }
        match pace {
            Pace::Host => pace::begin_period(),
            Pace::Timer => Current::idle(),
        }
    }
    Current::neutralise_pwm();
    conclude(0)
}

/// Reports how the run ended.
fn conclude(overruns: u32) -> ExitCode {
    let stack_bytes = stack::deepest_bytes();
    if overruns == 0 {
        // The host takes a run for complete only if it sees these words.
        defmt::info!("run complete; deepest stack {=u32} bytes", stack_bytes);
        ExitCode::Complete
    } else {
        defmt::error!("run failed: {=u32} overruns", overruns);
        ExitCode::Overrun
    }
}
