//! Deepest use of the stack: free RAM is painted at the start and looked at in the end.

use core::ptr::{read_volatile, write_volatile};

const PAINT: u32 = 0xC0FF_EE11;
/// Left unpainted below the painting function's own frame, bytes.
const MARGIN: usize = 256;

// SAFETY: the linker script defines both. Only their addresses are taken.
unsafe extern "C" {
    /// End of static RAM and top of the stack, from the linker script.
    static mut __sheap: u32;
    static mut _stack_start: u32;
}

fn bounds() -> (usize, usize) {
    (
        &raw const __sheap as usize,
        &raw const _stack_start as usize,
    )
}

/// Paints the free RAM below the present stack.
pub fn paint() {
    let (bottom, _) = bounds();
    let here = cortex_m::register::msp::read() as usize;
    for address in (bottom..here.saturating_sub(MARGIN)).step_by(4) {
        // SAFETY: between the static variables and the stack in use, memory that belongs to nobody.
        unsafe { write_volatile(address as *mut u32, PAINT) };
    }
}

/// Bytes from the top of the stack to the deepest word that has changed since [`paint`].
pub fn deepest_bytes() -> u32 {
    let (bottom, top) = bounds();
    // SAFETY: reads of RAM from the end of the static variables to the top of the stack.
    let untouched = |address: &usize| unsafe { read_volatile(*address as *const u32) } == PAINT;
    let painted = (bottom..top).step_by(4).take_while(untouched).count();
    (top - bottom - 4 * painted) as u32
}
