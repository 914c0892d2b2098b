//! The product: configuration in flash, frames on a bus, log over RTT. It needs no debugger and no
//! host.
//!
//! | subject | module |
//! |---|---|
//! | start, and the safe state without a configuration | [`app`] |
//! | the two tasks in their interrupts | [`interrupts`] |
//! | configuration in flash | [`configuration`] |
//! | bytes of the bus | [`uart`] |
//! | faults, before and after the reset | [`safe_state`], [`history`] |

pub mod app;
pub mod configuration;
pub mod diagnosis;
pub mod history;
pub mod interrupts;
pub mod safe_state;
pub mod uart;
