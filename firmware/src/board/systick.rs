//! SysTick as the PWM interrupt, the same on every Cortex-M.

use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Calls the SysTick exception every `period` clocks of the core, 2 to 65535, the first time in one period from now.
pub fn start(timer: &mut SYST, period: u16) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(u32::from(period) - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// Ends the calls.
pub fn stop() {
    // SAFETY: a write to one register of SysTick, which only this module uses.
    unsafe { (*SYST::PTR).csr.write(0) };
}

/// Enable bit of the control register.
const ENABLE: u32 = 1;

/// Stops the calls for a while.
pub fn pause() {
    // SAFETY: a write to one register of SysTick, which only this module uses.
    unsafe { (*SYST::PTR).csr.modify(|bits| bits & !ENABLE) };
}

/// Goes on after [`pause`], with a whole period.
pub fn resume() {
    // SAFETY: as above; any value written to the counter clears it.
    unsafe {
        (*SYST::PTR).cvr.write(0);
        (*SYST::PTR).csr.modify(|bits| bits | ENABLE);
    }
}
