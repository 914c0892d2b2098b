//! Proof that the control paths of both images cannot panic: this image links only if no panic is
//! reachable from their interrupts.
//!
//! The panic handler calls a function that is not defined. Where the optimiser finds every panic
//! unreachable, the handler and its call vanish; otherwise the linker reports the function, whose
//! name is the reason. The feature `reachable-panic` puts a panic into the path, to see that the
//! proof can fail. The image is never run.

#![no_std]
#![no_main]

use core::panic::PanicInfo;
use core::ptr::read_volatile;
use cortex_m_rt::exception;
use firmware::fault::{Fault, enter_safe_state};
use firmware::{bench, product};

// SAFETY: there is no such function; where it is called, the link fails.
unsafe extern "C" {
    fn a_panic_is_reachable_from_the_control_path() -> !;
}

/// An address in RAM, so that the tasks are unknown to the optimiser.
const ANYWHERE: usize = 0x2000_8000;

type BenchTasks = (
    bench::interrupts::PwmInterrupt,
    bench::interrupts::ControlInterrupt,
);
type ProductTasks = (
    &'static mut product::interrupts::PwmInterrupt,
    &'static mut product::interrupts::ControlInterrupt,
);

// SAFETY: the start-up code calls the function of this name, and there is no other.
#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    // SAFETY: none; this image is linked, not run.
    let (bench, product) = unsafe {
        (
            read_volatile(ANYWHERE as *const BenchTasks),
            read_volatile(ANYWHERE as *const ProductTasks),
        )
    };
    #[cfg(feature = "reachable-panic")]
    assert!(
        !matches!(bench.1, bench::interrupts::ControlInterrupt::InLoop(_)),
        "provoked"
    );
    bench::interrupts::hand_over(bench.0, bench.1, 10);
    product::interrupts::hand_over(product.0, product.1, 10);
    loop {
        cortex_m::asm::wfi();
    }
}

#[exception]
fn SysTick() {
    static mut BENCH: Option<bench::interrupts::PwmInterrupt> = None;
    static mut PRODUCT: Option<&'static mut product::interrupts::PwmInterrupt> = None;
    bench::interrupts::pwm(BENCH);
    product::interrupts::pwm(PRODUCT);
}

#[exception]
fn PendSV() {
    static mut BENCH: Option<bench::interrupts::ControlInterrupt> = None;
    static mut PRODUCT: Option<&'static mut product::interrupts::ControlInterrupt> = None;
    bench::interrupts::control(BENCH);
    product::interrupts::control(PRODUCT);
}

// SAFETY: none; this image is linked, not run.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    if !product::bus::interrupt(number) {
        enter_safe_state(Fault::UnexpectedInterrupt);
    }
}

// SAFETY: the one function of that name, with the signature that `fault` declares.
#[unsafe(export_name = "enter_safe_state")]
fn end_safely(fault: Fault) -> ! {
    if fault == Fault::Panic {
        product::safe_state::enter(fault);
    }
    bench::exit::end_safely(fault.into())
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    // SAFETY: there is no such function, which is the point.
    unsafe { a_panic_is_reachable_from_the_control_path() }
}
