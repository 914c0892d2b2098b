//! The bus on CAN. Nothing here waits.

use crate::board::{CanBoard, Current};
use crate::nvic;

/// The bus.
pub type ProductBus = <Current as CanBoard>::Bus;

/// Below the PWM interrupt's and above the control task's: the controller holds three frames, which
/// take longer than a PWM period to arrive.
const PRIORITY: u8 = 0x40;

/// Opens the CAN; `None` at the second call, or if the controller does not answer.
pub fn open() -> Option<ProductBus> {
    let bus = Current::open_can()?;
    nvic::unmask(Current::CAN_INTERRUPTS, PRIORITY);
    Some(bus)
}

/// The CAN's interrupt, if `number` is one.
pub fn interrupt(number: i16) -> bool {
    let is_can = nvic::is_one_of(number, Current::CAN_INTERRUPTS);
    if is_can {
        Current::can_interrupt();
    }
    is_can
}
