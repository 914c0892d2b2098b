#![doc = include_str!("../README.md")]
//!
//! A program's signal handler calls [`request`]. Every long loop calls [`check`], which leaves it
//! by unwinding the stack; [`catch`] ends the unwinding and returns an error. The caller keeps the
//! results that were complete before. Therefore no function between the loop and the caller needs
//! an error for the interruption.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by [`request`].
pub static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The computation was interrupted by [`request`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Requests that all computations end. Returns whether that had been requested before.
pub fn request() -> bool {
    REQUESTED.swap(true, Ordering::Relaxed)
}

/// Whether the end was requested.
#[inline]
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Leaves the computation if its end was requested. The cost is one load.
#[inline]
pub fn check() {
    if requested() {
        leave();
    }
}

#[cold]
fn leave() -> ! {
    // Without the panic hook, because an interruption is not an error and prints nothing.
    resume_unwind(Box::new(Interrupted))
}

/// The result of `work`, or [`Interrupted`] if a [`check`] within it left it. A panic continues.
///
/// # Errors
/// If `work` was interrupted.
pub fn catch<R>(work: impl FnOnce() -> R) -> Result<R, Interrupted> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        match payload.downcast::<Interrupted>() {
            Ok(interrupted) => *interrupted,
            Err(panic) => resume_unwind(panic),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interruption_is_an_error_and_a_panic_stays_one() {
        assert_eq!(catch(|| 7), Ok(7));
        assert_eq!(catch(|| -> u8 { leave() }), Err(Interrupted));
        let panic = catch_unwind(|| catch(|| -> u8 { resume_unwind(Box::new("other")) }));
        assert_eq!(panic.unwrap_err().downcast_ref(), Some(&"other"));
    }
}
