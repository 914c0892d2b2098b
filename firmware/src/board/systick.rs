//! SysTick as the PWM interrupt, the same on every Cortex-M.

use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Calls the SysTick exception every `clocks` clocks of the core, 2 to 2^24, the first time in one
/// period from now.
pub fn start(timer: &mut SYST, clocks: u32) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(clocks - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// Ends the calls.
pub fn stop() {
    // SAFETY: a write to one register of SysTick, which only this module uses.
    unsafe { (*SYST::PTR).csr.write(0) };
}
