#![doc = include_str!("../README.md")]

pub mod closed_loop;
pub mod comparison;
pub mod disturbance;
pub mod ecu;
pub mod equivalence;
pub mod fault;
pub mod figure;
pub mod instructions;
pub mod manoeuvre;
pub mod mil_sil_pil;
pub mod plant;
pub mod profile;
pub mod record;
pub mod recording;
pub mod sensor;
pub mod servo_filter;
pub mod vehicle_node;

/// Former names, still used by the program's verification and report.
#[doc(hidden)]
pub mod levels {
    pub use crate::mil_sil_pil::{
        LoopError as LevelError, MilSilPil as Levels, Target, run_all as drive,
    };
}

/// Former names, still used by the program's verification and report.
#[doc(hidden)]
pub mod run {
    pub use crate::{closed_loop::Run, comparison::Comparison};
}
