//! The configuration in its own section of the flash, which `sim-host firmware configure` writes.

use crate::board::{Board, Current};
use core::ptr::read_volatile;
use shared_model::Scenario;
use shared_model::configuration::{CONFIGURATION_LEN, ConfigurationError, ERASED, load};

/// The blocks. Erased in the image that the linker makes.
// SAFETY: constants in a part of the flash of their own; nothing else has this name.
#[unsafe(link_section = ".configuration")]
#[unsafe(export_name = "CONFIGURATION")]
static BLOCKS: [u8; CONFIGURATION_LEN] = [ERASED; CONFIGURATION_LEN];

/// The scenario in flash, checked.
///
/// # Errors
/// The reason why it is refused.
// Out of line: the stack for it is free again when the tasks run.
#[inline(never)]
pub fn read() -> Result<Scenario<f32>, ConfigurationError> {
    // SAFETY: a read of a static. Volatile, because the bytes are written after the compiler has
    // seen them.
    let blocks = unsafe { read_volatile(&raw const BLOCKS) };
    load(&blocks, Current::NAME, Current::TIMER_CLOCK_HZ)
}
