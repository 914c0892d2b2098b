//! A task in two channels: the same program on two sets of parameters and state. A bit that flips in one of them is found by
//! comparing the two.

/// Two channels that are equal as long as memory keeps what was written.
#[derive(Debug, Clone, Copy)]
pub struct Duplex<C>([C; 2]);

impl<C: Copy + PartialEq> Duplex<C> {
    /// Two channels that begin alike.
    pub fn new(channel: C) -> Self {
        // The optimiser must not see that the two are the same.
        Self([
            core::hint::black_box(channel),
            core::hint::black_box(channel),
        ])
    }

    /// The channels are equal in every number.
    pub fn agrees(&self) -> bool {
        self.0[0] == self.0[1]
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
