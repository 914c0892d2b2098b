//! Counts instructions by the emulator's time, in which one takes 32 ns.

use crate::interface::Call;
use core::ffi::c_void;
use core::hint::black_box;
use core::mem::MaybeUninit;
use firmware::board::{Board, Current};

/// The same call on this many copies of a task, so that the counter resolves single instructions.
pub const REPEATS: usize = 10;

/// Places for copies of a task.
pub type Copies<T> = [MaybeUninit<T>; REPEATS];

/// Runs `call` on the task, and returns its instructions, without those of the call itself.
pub fn counted<T: Clone, I, O>(
    call: Call,
    task: &mut T,
    copies: &mut Copies<T>,
    input: &I,
    output: &mut O,
) -> u32 {
    for copy in &mut *copies {
        copy.write(task.clone());
    }
    // Before the other, whose calls change the copies.
    let of_nothing = counts(nothing, copies, input, output);
    let counts = counts(call, copies, input, output).saturating_sub(of_nothing);
    // SAFETY: task, input and output were chosen for the call.
    unsafe { call_on(call, task, input, output) };
    let per_count = f64::from(Current::INSTRUCTION_RATE_HZ) / f64::from(Current::COST_CLOCK_HZ);
    (f64::from(counts) * per_count / REPEATS as f64 + 0.5) as u32
}

#[inline(never)]
fn counts<T, I, O>(call: Call, tasks: &mut [T; REPEATS], input: &I, output: &mut O) -> u32 {
    let call = black_box(call);
    let start = Current::cost_counter();
    for task in tasks {
        // SAFETY: as in `counted`; every copy was written.
        unsafe { call_on(call, task, input, output) };
    }
    Current::cost_counter().wrapping_sub(start)
}

#[inline(always)]
// SAFETY: the call must be one for these.
unsafe fn call_on<T, I, O>(call: Call, task: &mut T, input: &I, output: &mut O) {
    // SAFETY: the caller guarantees it.
    unsafe {
        call(
            (&raw mut *task).cast::<c_void>(),
            (&raw const *input).cast::<c_void>(),
            (&raw mut *output).cast::<c_void>(),
        );
    }
}

/// A call that does nothing, for the cost of the call itself.
// SAFETY: touches nothing.
#[inline(never)]
unsafe extern "C" fn nothing(_task: *mut c_void, _input: *const c_void, _output: *mut c_void) {
    black_box(());
}

/// More than any call takes.
const BINS: usize = 3072;

/// Instructions of many calls.
pub struct Tally {
    /// How often each number of instructions was counted.
    times: [u16; BINS],
    calls: u32,
    sum: u64,
    most: u32,
}

impl Tally {
    pub const EMPTY: Self = Self {
        times: [0; BINS],
        calls: 0,
        sum: 0,
        most: 0,
    };

    pub fn note(&mut self, instructions: u32) {
        if let Some(times) = self.times.get_mut(instructions as usize) {
            *times += 1;
        }
        self.calls += 1;
        self.sum += u64::from(instructions);
        self.most = self.most.max(instructions);
    }

    pub fn calls(&self) -> u32 {
        self.calls
    }

    /// The number that half of all calls do not exceed.
    pub fn median(&self) -> u32 {
        let mut seen = 0;
        let reaches = |&times: &u16| {
            seen += u32::from(times);
            2 * seen >= self.calls
        };
        self.times.iter().position(reaches).unwrap_or(BINS) as u32
    }

    pub fn most(&self) -> u32 {
        self.most
    }

    /// Rounded.
    pub fn mean(&self) -> u32 {
        let calls = u64::from(self.calls.max(1));
        ((self.sum + calls / 2) / calls) as u32
    }
}
