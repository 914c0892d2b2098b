//! Fault drill: the fault handlers, triggered on purpose.

use super::exit::ExitCode;
use super::recorder::Recorder;
use crate::board::{Board, Current};
use shared_model::Scenario;
use shared_model::open_loop::OpenLoop;
use shared_model::telemetry::Header;

/// Provokes the fault of that name: `panic`, `hard-fault`, `stack-overflow`, `watchdog` (the main
/// loop stops feeding it) or `hang` (interrupts and watchdog off, for the runner's time-out).
/// Returns only if there is none of that name.
pub fn run(name: &str) -> ExitCode {
    drive_pwm();
    match name {
        "panic" => panic!("drill"),
        // SAFETY: not safe, and meant not to be: nothing is mapped there, so the read faults.
        "hard-fault" => unsafe {
            core::ptr::read_volatile(0xF000_0000 as *const u32);
        },
        "stack-overflow" => {
            overflow();
        }
        "watchdog" => Current::start_watchdog(20),
        "hang" => cortex_m::interrupt::disable(),
        _ => {
            defmt::error!(
                "scenario refused: fault={=str}: no fault of that name",
                name
            );
            return ExitCode::BadScenario;
        }
    }
    loop {
        core::hint::spin_loop();
    }
}

/// Pushes words until there is no stack left. No recursion, which would leave the image without a
/// bound of its stack.
#[inline(never)]
fn overflow() -> ! {
    // SAFETY: not safe, and meant not to be: the stack ends in memory that denies all accesses.
    unsafe { core::arch::asm!("2: push {{r0}}", "b 2b", options(noreturn)) }
}

/// Brings the PWM off its neutral duty, so that the way back shows in the trailer of `drill.bin`.
fn drive_pwm() {
    use embedded_hal::pwm::SetDutyCycle;
    let mut scenario = Scenario::reconstruction();
    scenario.servo.timer_clock_hz = Current::TIMER_CLOCK_HZ as f32;
    let Ok(ecu) = OpenLoop::new(&scenario) else {
        return;
    };
    let period = ecu.pwm.neutral().period();
    let header = Header {
        samples_per_step: 1,
        step_rate_hz: 1,
        pwm_period: period,
        cost_clock_hz: Current::COST_CLOCK_HZ,
        instruction_rate_hz: Current::INSTRUCTION_RATE_HZ,
        initial: *ecu.control.state(),
    };
    let _ = Recorder::new(Some("drill.bin"), &header);
    if let Ok((mut pwm, _)) = Current::start_pwm(period) {
        let _ = pwm.set_duty_cycle(period);
    }
    Current::stop_pwm_interrupt();
}
