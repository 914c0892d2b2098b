//! Limits of a value.

use crate::Real;

/// `value`, or the nearer end of the range if it is outside.
pub(crate) fn within<T: Real>(value: T, (least, most): (T, T)) -> T {
    if value > most {
        most
    } else if value < least {
        least
    } else {
        value
    }
}
