//! The safe state after a fault of the program: bridge off, PWM neutral, the fault recorded, and a
//! reset. The program after the reset reports it on the bus.

use super::{history, interrupts};
use crate::board::{Board, Current};
use crate::fault::Fault;
use crate::steering;
use cortex_m::peripheral::SCB;
use shared_model::diagnostic::Record;

/// Ends the program.
pub fn enter(fault: Fault) -> ! {
    cortex_m::interrupt::disable();
    Current::disable_bridge();
    Current::neutralise_pwm();
    history::add(Record {
        fault: fault as u8,
        start: 0,
        gate_faults: interrupts::gate_faults(),
        ticks: steering::control_ticks(),
    });
    SCB::sys_reset()
}
