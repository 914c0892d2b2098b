//! The product's image: boots alone, configuration in flash, frames on a bus, log over RTT.

#![no_std]
#![no_main]

use core::panic::PanicInfo;
use cortex_m_rt::{entry, exception};
// The log's transport.
use defmt_rtt as _;
use firmware::fault::{Fault, enter_safe_state};
use firmware::product::interrupts::{self, ControlInterrupt, PwmInterrupt};
use firmware::product::{app, bus, safe_state};

#[entry]
fn main() -> ! {
    app::run()
}

#[exception]
fn SysTick() {
    static mut INTERRUPT: Option<&'static mut PwmInterrupt> = None;
    interrupts::pwm(INTERRUPT);
}

#[exception]
fn PendSV() {
    static mut INTERRUPT: Option<&'static mut ControlInterrupt> = None;
    interrupts::control(INTERRUPT);
}

/// The interrupt of the bus; any other has no business here.
// SAFETY: the bus's own state is taken in a critical section; the rest does not return.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    if !bus::interrupt(number) {
        enter_safe_state(Fault::UnexpectedInterrupt);
    }
}

// SAFETY: the one function of that name, with the signature that `fault` declares.
#[unsafe(export_name = "enter_safe_state")]
fn end_safely(fault: Fault) -> ! {
    safe_state::enter(fault)
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    enter_safe_state(Fault::Panic)
}
