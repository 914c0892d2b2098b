//! A run of the ECU from the command line to the exit code.

use crate::board::{Board, Current};
use crate::command_line::{self, CommandError};
use crate::exit::ExitCode;
use crate::host_file::HostFileError;
use crate::link::Link;
use crate::tasks::{self, ControlInterrupt, PwmInterrupt};
use crate::{in_loop, log, open_loop, stack};
use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::SystemHandler;
use shared_model::ecu::Ecu;
use shared_model::open_loop::OpenLoop;
use shared_model::stability::{MOST_STEP_TIMES_RATE, least_rate_hz};
use shared_model::{InvalidScenario, MAX_RATIO, Scenario};

/// The watchdog bites when no model step arrives for this many of its periods, or for this long, ms, if that is longer.
const WATCHDOG_PERIODS: f32 = 4.0;
const WATCHDOG_LEAST_MS: u32 = 20;
/// Priorities as the registers have them; a lower number preempts a higher one.
const PWM_PRIORITY: u8 = 0x00;
const CONTROL_PRIORITY: u8 = 0xE0;

/// Runs the scenario of the command line to its end.
pub fn run() -> ExitCode {
    stack::guard();
    stack::paint();
    log::open();
    let command = match command_line::read() {
        Ok(command) => command,
        Err(error) => return refuse_command(&error),
    };
    let timer_clock_hz = command.scenario.servo.timer_clock_hz;
    if timer_clock_hz != Current::TIMER_CLOCK_HZ as f32 {
        return refuse_timer_clock(timer_clock_hz);
    }
    match command.link {
        Some(link) => steer(&command.scenario, link),
        None => simulate(&command.scenario, command.telemetry),
    }
}

/// The vehicle model runs on the ECU.
// Out of line, as is the other: the stack need not hold what only one of them needs.
#[inline(never)]
fn simulate(scenario: &Scenario<f32>, telemetry: Option<&str>) -> ExitCode {
    let ecu = match OpenLoop::new(scenario) {
        Ok(ecu) => ecu,
        Err(error) => return refuse_scenario(&error),
    };
    defmt::info!(
        "run of {=f32} s at {=f32} rpm, {=f32} model steps a second",
        scenario.run.duration_s,
        scenario.run.wheel_speed_rpm,
        scenario.model_rate_hz()
    );
    match open_loop::run(scenario, ecu, telemetry) {
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
    in_loop::run(scenario, ecu, opened)
}

fn refuse_command(error: &CommandError) -> ExitCode {
    match error {
        CommandError::Unreadable => defmt::error!("scenario refused: no readable command line"),
        CommandError::Setting(word, error) => {
            defmt::error!("scenario refused: {=str}: {=str}", word, error.reason());
        }
    }
    ExitCode::BadScenario
}

fn refuse_scenario(error: &InvalidScenario) -> ExitCode {
    // In the words of its `Display`, whose formatting would take flash and panics; a test holds the two together.
    match *error {
        InvalidScenario::OutOfRange(error) => defmt::error!(
            "scenario refused: {=str}.{=str} = {=f64}: must be a finite number from {=f64} to {=f64}",
            error.section,
            error.name,
            error.value,
            error.min,
            error.max
        ),
        InvalidScenario::Rates { control_hz, pwm_hz } => defmt::error!(
            "scenario refused: run.pwm_rate_hz = {=f64} and run.control_rate_hz = {=f64}: both must be whole numbers, the first a multiple of the second, at most {=u32} times it",
            pwm_hz,
            control_hz,
            MAX_RATIO
        ),
        InvalidScenario::TimerPeriod { counts } => defmt::error!(
            "scenario refused: servo.timer_clock_hz over run.pwm_rate_hz is {=u32} counts: must be from 2 to {=u16}",
            counts,
            u16::MAX
        ),
        InvalidScenario::Duration {
            duration_s,
            min_s,
            max_s,
        } => defmt::error!(
            "scenario refused: run.duration_s = {=f64}: must be from {=f64} (one step) to {=f64}",
            duration_s,
            min_s,
            max_s
        ),
        InvalidScenario::DitherFrequency {
            frequency_rad_per_s,
            max_rad_per_s,
        } => defmt::error!(
            "scenario refused: dither frequency {=f64} rad/s: must be at most {=f64} rad/s, half of run.pwm_rate_hz",
            frequency_rad_per_s,
            max_rad_per_s
        ),
        InvalidScenario::OverVoltage {
            motor_v,
            dither_v,
            bus_v,
        } => defmt::error!(
            "scenario refused: dither.amplitude_v = {=f64}: with {=f64} V for the motor current it exceeds servo.bus_voltage_v = {=f64}; at most {=f64} V are left for the dither",
            dither_v,
            motor_v,
            bus_v,
            InvalidScenario::left_for_dither_v(motor_v, bus_v)
        ),
        InvalidScenario::StepTooLong {
            field,
            rate_hz,
            fastest_rate_per_s,
        } => defmt::error!(
            "scenario refused: {=str} = {=f64}: the step is too long; {=f64} s times the model's fastest rate, {=f64} 1/s, is {=f64}, and must be at most {=f64}: at least {=f64} Hz",
            field,
            rate_hz,
            1.0 / rate_hz,
            fastest_rate_per_s,
            fastest_rate_per_s / rate_hz,
            MOST_STEP_TIMES_RATE,
            least_rate_hz(fastest_rate_per_s)
        ),
    }
    ExitCode::BadScenario
}

fn refuse_timer_clock(timer_clock_hz: f32) -> ExitCode {
    defmt::error!(
        "scenario refused: servo.timer_clock_hz = {=f32}: must be {=u32}, this board's",
        timer_clock_hz,
        Current::TIMER_CLOCK_HZ
    );
    ExitCode::BadScenario
}

/// Starts PWM, interrupts and watchdog; `tasks` says what the two interrupts work on, the control task once every `tick_s`.
pub fn start(
    period: u16,
    scenario: &Scenario<f32>,
    tick_s: f32,
    tasks: impl FnOnce(<Current as Board>::Pwm) -> Option<(PwmInterrupt, ControlInterrupt)>,
) {
    let timeout_ms = (WATCHDOG_PERIODS * 1000.0 * tick_s) as u32;
    let samples_a_ms = (scenario.run.pwm_rate_hz / 1000.0) as u32;
    critical_section::with(|_| {
        // Started once and with a period that the scenario's check has passed.
        let pwm = Current::start_pwm(period).ok();
        if let Some((pwm, control)) = pwm.and_then(tasks) {
            tasks::hand_over(pwm, control, samples_a_ms);
        }
        set_priorities();
        Current::start_watchdog(timeout_ms.max(WATCHDOG_LEAST_MS));
    });
}

fn set_priorities() {
    // SAFETY: called once, inside a critical section, so nothing runs at the old priorities meanwhile.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        SCB::set_priority(&mut core.SCB, SystemHandler::SysTick, PWM_PRIORITY);
        SCB::set_priority(&mut core.SCB, SystemHandler::PendSV, CONTROL_PRIORITY);
    }
}

/// Says how the run ended.
pub fn conclude(overruns: u32) -> ExitCode {
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
