//! The stack: an overflow is detected, and its deepest use is measured.
//!
//! It lies at the start of the RAM, and the memory protection unit lets nothing into the addresses
//! below, which on some machines take writes without a fault. Its free part is painted at the start
//! and inspected at the end.

use core::ptr::{read_volatile, write_volatile};

const PAINT: u32 = 0xC0FF_EE11;
/// Left unpainted below the painting function's own frame, bytes.
const MARGIN: usize = 256;

/// Size of the region below the stack, bytes, a power of two: more than any function's frame.
const GUARD_BYTES: u32 = 32 * 1024;
/// Bits of the protection unit's registers (ARMv7-M Architecture Reference Manual, B3.5): region
/// on, execution never, no access; unit on, its regions on top of the usual map, and off in the
/// fault handlers themselves.
const REGION_ON: u32 = 1;
const EXECUTE_NEVER: u32 = 1 << 28;
const UNIT_ON: u32 = 1;
const USUAL_MAP: u32 = 1 << 2;

// SAFETY: the linker script defines both. Only their addresses are taken.
unsafe extern "C" {
    /// Bottom and top of the stack, from the linker script.
    static mut _stack_end: u32;
    static mut _stack_start: u32;
}

fn bounds() -> (usize, usize) {
    (
        &raw const _stack_end as usize,
        &raw const _stack_start as usize,
    )
}

/// Makes any access just below the stack a hard fault.
pub fn guard() {
    let (bottom, _) = bounds();
    // The size's field holds the power of two less one.
    let size = (GUARD_BYTES.trailing_zeros() - 1) << 1;
    // SAFETY: called before anything else could use the unit; no address of the region belongs to
    // the program.
    unsafe {
        // Not by the crate's own way to the peripherals, which then are taken, and the board could
        // not have them.
        let unit = &*cortex_m::peripheral::MPU::PTR;
        unit.rnr.write(0);
        unit.rbar.write(bottom as u32 - GUARD_BYTES);
        unit.rasr.write(EXECUTE_NEVER | size | REGION_ON);
        unit.ctrl.write(USUAL_MAP | UNIT_ON);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Paints the free part below the present stack.
pub fn paint() {
    let (bottom, _) = bounds();
    let here = cortex_m::register::msp::read() as usize;
    for address in (bottom..here.saturating_sub(MARGIN)).step_by(4) {
        // SAFETY: between the stack's end and the stack in use, unused memory.
        unsafe { write_volatile(address as *mut u32, PAINT) };
    }
}

/// Bytes from the top of the stack to the deepest word that has changed since [`paint`].
pub fn deepest_bytes() -> u32 {
    let (bottom, top) = bounds();
    // SAFETY: reads of the stack's RAM.
    let untouched = |address: &usize| unsafe { read_volatile(*address as *const u32) } == PAINT;
    let painted = (bottom..top).step_by(4).take_while(untouched).count();
    (top - bottom - 4 * painted) as u32
}
