//! The steering ECU.

#![no_std]
#![no_main]

use core::panic::PanicInfo;
use firmware::exit::ExitCode;
use firmware::{app, fault};

#[cortex_m_rt::entry]
fn main() -> ! {
    let code = app::run();
    fault::end_safely(code)
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    fault::end_safely(ExitCode::Panic)
}
