//! Facts about the firmware that its analysis needs.

use image::stack::Priority;

/// Priorities of the firmware's code in rising order, as `firmware/src/tasks.rs` and
/// `firmware/src/product/uart.rs` set them.
pub const PRIORITIES: [Priority; 6] = [
    priority("main program", &["Reset"]),
    priority("control task", &["PendSV"]),
    priority("PWM interrupt", &["SysTick"]),
    priority("bus interrupt", &["DefaultHandler"]),
    // HardFault itself moves the stack pointer back to the top; this is counted all the same as if
    // it lay below the others.
    priority("hard fault", &["end_hard_fault"]),
    priority("watchdog", &["NonMaskableInt"]),
];

const fn priority(name: &'static str, entries: &'static [&'static str]) -> Priority {
    Priority { name, entries }
}
