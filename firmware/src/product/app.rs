//! From the reset to the running tasks, or to a safe state that reports why there are none.

use super::bus::{self, ProductBus};
use super::diagnosis::{Diagnosis, Start};
use super::interrupts::{self, ControlInterrupt, PwmInterrupt};
use super::{configuration, history};
use crate::board::{Board, Current};
use crate::fault::{Fault, enter_safe_state};
use crate::refusal::log_invalid_scenario;
use crate::{stack, steering, tasks};
use shared_model::Scenario;
use shared_model::bus::{Bus, Message};
use shared_model::configuration::ConfigurationError;
use shared_model::diagnostic::{FAULTS_IN_A_ROW, History, ResetCause};
use shared_model::ecu::Ecu;
use shared_model::independent_clock::ClockCheck;
use shared_model::signal::Mode;

/// The watchdog bites when no control tick comes for this many control periods, or for this long,
/// ms, if that is longer.
const WATCHDOG_PERIODS: f32 = 4.0;
const WATCHDOG_LEAST_MS: u32 = 20;
/// Time between two diagnostic frames, s.
const DIAGNOSIS_S: f32 = 0.1;
/// Time without a fault after which faults no longer count as in a row, s.
const HEALTHY_S: f32 = 10.0;
/// Carrier of the neutral PWM without a configuration, Hz.
const NEUTRAL_PWM_HZ: u32 = 10_000;

/// Runs the ECU.
pub fn run() -> ! {
    stack::guard();
    Current::disable_bridge();
    let reset_cause = Current::reset_cause();
    let history = begin(reset_cause);
    let Some(bus) = bus::open() else {
        stay_neutral()
    };
    let mut start = Start {
        reset_cause,
        configuration: 0,
        history,
    };
    defmt::info!(
        "start {=u32} after a reset by {=str}",
        history.starts,
        reset_cause.name()
    );
    if history.faults_in_a_row >= FAULTS_IN_A_ROW {
        defmt::error!(
            "{=u32} faults in a row: safe state until power-on",
            history.faults_in_a_row
        );
        stay_safe(bus, start);
    }
    let error = match configuration::read() {
        Ok(scenario) => match Ecu::new(&scenario, Current::COST_CLOCK_HZ) {
            Ok(ecu) => steer(&scenario, ecu, bus, start),
            Err(reason) => ConfigurationError::Invalid(reason),
        },
        Err(error) => error,
    };
    defmt::error!("configuration refused: {=str}", error.reason());
    if let ConfigurationError::Invalid(reason) = &error {
        log_invalid_scenario(reason);
    }
    start.configuration = error.code();
    stay_safe(bus, start)
}

/// The history with this start in it.
fn begin(reset_cause: ResetCause) -> History {
    let mut history = history::read();
    history.starts = history.starts.saturating_add(1);
    if reset_cause == ResetCause::Power {
        history.faults_in_a_row = 0;
    }
    history::write(&history);
    history
}

/// Starts the tasks, and feeds the watchdog as long as they run.
fn steer(scenario: &Scenario<f32>, ecu: Ecu<f32>, bus: ProductBus, start: Start) -> ! {
    let period = ecu.pwm.neutral().period();
    let rate_hz = scenario.run.control_rate_hz;
    let samples_per_ms = (scenario.run.pwm_rate_hz / 1000.0) as u32;
    let timeout_ms = (WATCHDOG_PERIODS * 1000.0 / rate_hz) as u32;
    let diagnosis_ticks = ((DIAGNOSIS_S * rate_hz) as u32).max(1);
    Current::start_independent_counter();
    let started = critical_section::with(|_| {
        let (pin, bridge) = Current::start_pwm(period).ok()?;
        tasks::set_priorities();
        let pwm = cortex_m::singleton!(: PwmInterrupt = PwmInterrupt {
            steering: steering::Pwm { task: ecu.pwm, pin, bridge },
            last_tick_counts: Current::cost_counter(),
            clock_check: ClockCheck::new(
                &Current::INDEPENDENT_CLOCK,
                rate_hz,
                scenario.gate.tick_tolerance,
            ),
        })?;
        let control = cortex_m::singleton!(: ControlInterrupt = ControlInterrupt {
            steering: steering::Control { task: ecu.control },
            bus,
            frame: None,
            diagnosis: Diagnosis::new(start),
            diagnosis_ticks,
            ticks_to_diagnosis: 1,
        })?;
        interrupts::hand_over(pwm, control, samples_per_ms);
        Current::start_watchdog(timeout_ms.max(WATCHDOG_LEAST_MS));
        Some(())
    });
    if started.is_none() {
        enter_safe_state(Fault::NotStarted);
    }
    let healthy_ticks = (HEALTHY_S * rate_hz) as u32;
    let mut ticks_seen = 0;
    let mut mode_seen = Mode::Starting;
    let mut is_healthy = false;
    loop {
        let ticks = steering::control_ticks();
        if ticks != ticks_seen {
            ticks_seen = ticks;
            Current::feed_watchdog();
            if ticks >= healthy_ticks && !is_healthy {
                is_healthy = true;
                forget_faults_in_a_row();
            }
        }
        let mode = interrupts::mode();
        if mode != mode_seen {
            mode_seen = mode;
            let faults = interrupts::gate_faults();
            defmt::info!("{=str}, faults {=u32:#x}", mode_text(mode), faults);
        }
        Current::idle();
    }
}

fn mode_text(mode: Mode) -> &'static str {
    match mode {
        Mode::Starting => "starting",
        Mode::Active => "active",
        Mode::Safe => "safe state",
    }
}

fn forget_faults_in_a_row() {
    critical_section::with(|_| {
        let mut history = history::read();
        history.faults_in_a_row = 0;
        history::write(&history);
    });
}

/// Bridge off, PWM neutral, and a diagnostic frame every tenth of a second.
fn stay_safe(mut bus: ProductBus, start: Start) -> ! {
    let period = (Current::TIMER_CLOCK_HZ / NEUTRAL_PWM_HZ) as u16;
    // Its interrupt finds no task. Where the PWM does not start, its pin is off.
    let _ = Current::start_pwm(period);
    Current::stop_pwm_interrupt();
    Current::neutralise_pwm();
    Current::disable_bridge();
    let mut diagnosis = Diagnosis::new(start);
    loop {
        let _ = bus.send(Message::Diagnostic, &diagnosis.frame(0));
        cortex_m::asm::delay(Current::CORE_CLOCK_HZ / 10);
    }
}

fn stay_neutral() -> ! {
    loop {
        Current::idle();
    }
}
