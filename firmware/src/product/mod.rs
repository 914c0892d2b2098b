//! The product: configuration in flash, frames on a bus, log over RTT. It needs no debugger and no
//! host.
//!
//! | subject | module |
//! |---|---|
//! | start, and the safe state without a configuration | [`app`] |
//! | the two tasks in their interrupts | [`interrupts`] |
//! | configuration in flash | [`configuration`] |
//! | the bus | [`bus`]: bytes of a UART, or with the feature `can` frames of a CAN |
//! | faults, before and after the reset | [`safe_state`], [`history`] |

pub mod app;
#[cfg(feature = "can")]
#[path = "can.rs"]
pub mod bus;
#[cfg(not(feature = "can"))]
#[path = "uart.rs"]
pub mod bus;
pub mod configuration;
pub mod diagnosis;
pub mod history;
pub mod interrupts;
pub mod safe_state;
