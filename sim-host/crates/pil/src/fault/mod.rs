//! Faults on purpose: what is done to the loop, whether the ECU or the vehicle finds it, and what the vehicle does then.
//!
//! | question | module |
//! |---|---|
//! | what can be done? | [`catalogue`] |
//! | how is it done to what passes between vehicle and ECU? | [`injector`] |
//! | how to the ECU's interrupts? | [`tasks`] |
//! | how to the memory and the core of the ECU on its processor? | [`processor`], [`memory`] |
//! | was it found, when, and what came of it? | [`judge`] |
//! | which faults may stay unfound, and why? | [`accepted`] |
//! | all of them, on all manoeuvres | [`campaign`] |
//! | how are they drawn? | [`figure`] |

pub mod accepted;
pub mod campaign;
pub mod catalogue;
pub mod figure;
pub mod injector;
pub mod judge;
pub mod manoeuvres;
pub mod memory;
pub mod processor;
pub mod tasks;
