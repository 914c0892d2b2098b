//! A run of the ECU from the command line to the exit code.

use crate::board::{Board, Current};
use crate::command_line::{self, CommandError};
use crate::exit::ExitCode;
use crate::host_file::HostFileError;
use crate::recorder::{self, Recorder};
use crate::tasks::{self, ControlInterrupt, PwmInterrupt};
use crate::{log, stack};
use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::SystemHandler;
use shared_model::open_loop::OpenLoop;
use shared_model::telemetry::Header;
use shared_model::{InvalidScenario, Scenario};

/// The watchdog bites when no model step arrives for this many of its periods, or for this long, ms, if that is longer.
const WATCHDOG_PERIODS: f32 = 4.0;
const WATCHDOG_LEAST_MS: u32 = 20;
/// Priorities as the registers have them; a lower number preempts a higher one.
const PWM_PRIORITY: u8 = 0x00;
const CONTROL_PRIORITY: u8 = 0xE0;

/// Runs the scenario of the command line to its end.
pub fn run() -> ExitCode {
    stack::paint();
    log::open();
    let command = match command_line::read() {
        Ok(command) => command,
        Err(error) => return refuse_command(&error),
    };
    let ecu = match OpenLoop::new(&command.scenario) {
        Ok(ecu) => ecu,
        Err(error) => return refuse_scenario(&error),
    };
    if command.scenario.servo.timer_clock_hz != Current::TIMER_CLOCK_HZ as f32 {
        return refuse_timer_clock(command.scenario.servo.timer_clock_hz);
    }
    defmt::info!(
        "run of {=f32} s at {=f32} rpm, {=f32} model steps a second",
        command.scenario.run.duration_s,
        command.scenario.run.wheel_speed_rpm,
        command.scenario.model_rate_hz()
    );
    match record(&command.scenario, ecu, command.telemetry) {
        Ok(code) => code,
        Err(HostFileError) => {
            defmt::error!("cannot write the telemetry file");
            ExitCode::TelemetryFailed
        }
    }
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
    match error {
        InvalidScenario::OutOfRange(error) => defmt::error!(
            "scenario refused: {=str}.{=str} = {=f64}: must be a finite number from {=f64} to {=f64}",
            error.section,
            error.name,
            error.value,
            error.min,
            error.max
        ),
        InvalidScenario::Rates { control_hz, pwm_hz } => defmt::error!(
            "scenario refused: run.pwm_rate_hz = {=f64} and run.control_rate_hz = {=f64}: must be whole, the first a multiple of the second",
            pwm_hz,
            control_hz
        ),
        InvalidScenario::TimerPeriod { counts } => defmt::error!(
            "scenario refused: a carrier period of {=u32} timer counts: must be from 2 to 65535",
            counts
        ),
        InvalidScenario::Duration {
            duration_s,
            min_s,
            max_s,
        } => defmt::error!(
            "scenario refused: run.duration_s = {=f64}: must be from {=f64} to {=f64}",
            duration_s,
            min_s,
            max_s
        ),
        InvalidScenario::DitherFrequency {
            frequency_rad_per_s,
            max_rad_per_s,
        } => defmt::error!(
            "scenario refused: dither frequency {=f64} rad/s: must be at most {=f64} rad/s, half the PWM rate",
            frequency_rad_per_s,
            max_rad_per_s
        ),
        InvalidScenario::OverVoltage {
            motor_v,
            dither_v,
            bus_v,
        } => defmt::error!(
            "scenario refused: dither.amplitude_v = {=f64} with {=f64} V for the motor exceeds servo.bus_voltage_v = {=f64}",
            dither_v,
            motor_v,
            bus_v
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

fn record(
    scenario: &Scenario<f32>,
    ecu: OpenLoop<f32>,
    telemetry: Option<&str>,
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
    let Some((mut recorder, records)) = Recorder::new(telemetry, &header)? else {
        return Ok(ExitCode::TelemetryFailed);
    };
    let control = ControlInterrupt {
        task: ecu.control,
        records,
        steps: scenario.steps(),
        index: 0,
    };
    start(ecu.pwm, control, scenario);

    while !tasks::is_finished() {
        if recorder.take_one()? {
            Current::feed_watchdog();
        } else {
            Current::idle();
        }
    }
    while recorder.take_one()? {}
    recorder.flush()?;
    Current::neutralise_pwm();
    Ok(conclude())
}

fn start(
    task: shared_model::open_loop::PwmTask<f32>,
    control: ControlInterrupt,
    scenario: &Scenario<f32>,
) {
    let timeout_ms = (WATCHDOG_PERIODS * 1000.0 * scenario.step_s()) as u32;
    let samples_a_ms = (scenario.run.pwm_rate_hz / 1000.0) as u32;
    critical_section::with(|_| {
        let period = task.neutral().period();
        // Started once and with a period that the scenario's check has passed.
        let recording = recorder::take_duty_recording();
        if let (Ok(pwm), Some(recording)) = (Current::start_pwm(period), recording) {
            let interrupt = PwmInterrupt {
                task,
                pwm,
                recording,
            };
            tasks::hand_over(interrupt, control, samples_a_ms);
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

fn conclude() -> ExitCode {
    let overruns = recorder::overruns();
    let stack_bytes = stack::deepest_bytes();
    if overruns == 0 {
        defmt::info!("run complete; deepest stack {=u32} bytes", stack_bytes);
        ExitCode::Complete
    } else {
        defmt::error!("run failed: {=u32} overruns", overruns);
        ExitCode::Overrun
    }
}
