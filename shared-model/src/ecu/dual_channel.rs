//! A task in two channels: the same program on two sets of parameters and state. Comparing the two
//! detects a flipped bit in one of them.

/// Two channels, which are equal unless memory is corrupted.
#[derive(Debug, Clone, Copy)]
pub struct DualChannel<C>([C; 2]);

impl<C: Copy + PartialEq> DualChannel<C> {
    /// Two equal channels.
    pub fn new(channel: C) -> Self {
        // Hides from the optimiser that the two are equal. By reference: less to copy.
        Self([
            *core::hint::black_box(&channel),
            *core::hint::black_box(&channel),
        ])
    }

    /// The channels are equal in every number.
    pub fn agrees(&self) -> bool {
        self.0[0] == self.0[1]
    }

    /// Both channels, to read them.
    pub fn get(&self) -> &[C; 2] {
        &self.0
    }

    /// Both channels.
    pub fn both(&mut self) -> &mut [C; 2] {
        &mut self.0
    }

    /// Runs both channels.
    pub fn run<O>(&mut self, mut f: impl FnMut(&mut C) -> O) -> [O; 2] {
        let [a, b] = &mut self.0;
        [f(a), f(b)]
    }

    /// Runs both channels, each on its own argument.
    pub fn run_each<A, O>(
        &mut self,
        arguments: &[A; 2],
        mut f: impl FnMut(&mut C, &A) -> O,
    ) -> [O; 2] {
        let [a, b] = &mut self.0;
        let [for_a, for_b] = arguments;
        [f(a, for_a), f(b, for_b)]
    }
}
