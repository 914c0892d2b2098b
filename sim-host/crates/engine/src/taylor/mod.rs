//! Many motions at once: a Taylor integrator of high order whose lanes are motions.
//!
//! Each lane takes its own steps: as long as the last term of its expansion allows, shortened where
//! the friction mode ends, and where a span of its plan does. The polynomial of a step is the
//! motion in it, so changes of friction mode, maxima and crossings of a section are its roots. A
//! vector test tells in which lanes there may be one; only those leave the vector for it. A lane
//! whose motion is done takes the next one. A motion's numbers do not depend on those beside it, on
//! the number of threads, or on the instruction set.

// An iterator's closures are not always inlined, and then not compiled for the instruction set: see
// `lanes`.
#![allow(clippy::needless_range_loop)]

mod angles;
mod batch;
mod chassis;
mod ensemble;
mod equation;
mod expansion;
mod forces;
mod guard;
mod lanes;
mod observables;
mod queue;
mod roots;
mod series;
mod task;
mod tires;

pub use ensemble::{Compiled, Ensemble, Tangents};
pub use observables::{Crossing, LogStretching, Observables, Span, Trajectory};
pub use series::ORDER;
pub use task::Unsupported;
