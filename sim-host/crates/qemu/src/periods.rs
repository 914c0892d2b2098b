//! The PWM periods of a control tick, received together and passed on one by one.

use std::collections::VecDeque;

/// Periods that are not yet passed on.
#[derive(Debug, Clone)]
pub struct Periods<P>(VecDeque<P>);

impl<P> Default for Periods<P> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl<P> Periods<P> {
    /// The next period; if none is left, the first of the tick that `receive` returns. `None` if
    /// that has no period.
    ///
    /// # Errors
    /// Those of `receive`.
    pub fn next_or<E>(
        &mut self,
        receive: impl FnOnce() -> Result<Vec<P>, E>,
    ) -> Result<Option<P>, E> {
        if self.is_last() {
            self.0 = receive()?.into();
        }
        Ok(self.0.pop_front())
    }

    /// Whether the period that was passed on is the last of its tick.
    pub fn is_last(&self) -> bool {
        self.0.is_empty()
    }

    /// Drops the periods that are left.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}
