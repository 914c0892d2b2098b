//! Trajectories of the vehicle model on the host: integrators for analysis, and the arithmetics that they are generic over.

pub mod engine;
pub mod interrupt;
pub mod motion;
