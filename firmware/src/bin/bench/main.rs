//! The laboratory's image: scenario on the emulator's command line, telemetry in the host's files.

#![no_std]
#![no_main]

mod log;

use core::panic::PanicInfo;
use cortex_m_rt::{entry, exception};
use firmware::bench::interrupts::{self, ControlInterrupt, PwmInterrupt};
use firmware::bench::{app, exit};
use firmware::fault::{Fault, enter_safe_state};
use firmware::stack;

#[entry]
fn main() -> ! {
    stack::guard();
    stack::paint();
    log::open();
    exit::end_safely(app::run())
}

#[exception]
fn SysTick() {
    static mut INTERRUPT: Option<PwmInterrupt> = None;
    interrupts::pwm(INTERRUPT);
}

#[exception]
fn PendSV() {
    static mut INTERRUPT: Option<ControlInterrupt> = None;
    interrupts::control(INTERRUPT);
}

// SAFETY: does not return, so what it interrupts does not matter.
#[exception]
unsafe fn DefaultHandler(_number: i16) -> ! {
    enter_safe_state(Fault::UnexpectedInterrupt)
}

// SAFETY: the one function of that name, with the signature that `fault` declares.
#[unsafe(export_name = "enter_safe_state")]
fn end_safely(fault: Fault) -> ! {
    exit::end_safely(fault.into())
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    enter_safe_state(Fault::Panic)
}
