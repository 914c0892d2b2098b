//! Fault injection: faults are injected into the loop, and every run is compared with its
//! fault-free run.
//!
//! | question | module |
//! |---|---|
//! | which faults are injected? | [`catalogue`], [`processor_fault`], [`memory`], [`injection`] |
//! | how do they act on the signals between vehicle and ECU? | [`injector`] |
//! | how do they act on the ECU's interrupts and on its controller? | [`tasks`], [`failed_controller`] |
//! | how do they act on the processor of the firmware? | [`processor`] |
//! | is a fault detected, after how many ticks, and what is the reaction? | [`judge`] |
//! | which faults may stay undetected, and why? | [`waivers`] |
//! | how are faults injected on all [`manoeuvres`], with the ECU's program on the host? | [`host`] |
//! | how is a campaign reported? | [`row`], [`totals`], [`figure`], [`fmea`] |

pub mod catalogue;
pub mod failed_controller;
pub mod figure;
pub mod fmea;
pub mod host;
pub mod injection;
pub mod injector;
pub mod judge;
pub mod manoeuvres;
pub mod memory;
pub mod processor;
pub mod processor_fault;
pub mod row;
pub mod tasks;
pub mod totals;
pub mod waivers;
