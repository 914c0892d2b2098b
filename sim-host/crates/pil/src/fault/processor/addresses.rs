//! Addresses of the firmware at which faults are injected.

use crate::mil_sil_pil::{LoopError, Target};

/// `bx lr` as Thumb code.
const RETURN: [u8; 2] = [0x70, 0x47];

/// Addresses in the image.
#[derive(Debug, Clone, Copy)]
pub struct Addresses {
    pub pwm_interrupt: u32,
    pub control_interrupt: u32,
    /// Length of its code.
    pub control_bytes: u32,
    pub control_ticks: u32,
    pub idle: u32,
    pub stack_end: u32,
    pub stack_start: u32,
    pub return_code: u32,
}

impl Addresses {
    pub fn of(target: &Target) -> Result<Self, LoopError> {
        let image = &target.image;
        let symbol = |name| image.address_of(name).ok_or(LoopError::NoSymbol { name });
        let size = |name| {
            let symbol = image.symbols().into_iter().find(|s| s.name == name);
            symbol.map(|s| s.size).ok_or(LoopError::NoSymbol { name })
        };
        let part = |name| {
            let symbol = image.symbols().into_iter().find(|s| s.name.contains(name));
            symbol
                .map(|s| s.address)
                .ok_or(LoopError::NoSymbol { name })
        };
        Ok(Self {
            pwm_interrupt: symbol("SysTick")?,
            control_interrupt: symbol("PendSV")?,
            control_bytes: size("PendSV")?,
            control_ticks: part("13CONTROL_TICKS")?,
            // Under the compiler's former and its present scheme of symbol names.
            idle: part("4idle")?,
            stack_end: symbol("_stack_end")?,
            stack_start: symbol("_stack_start")?,
            return_code: image
                .find_code(RETURN)
                .ok_or(LoopError::NoSymbol { name: "bx lr" })?,
        })
    }
}
