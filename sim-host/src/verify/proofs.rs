//! What is shown of the firmware itself: how deep its stack can get.

use super::case::Outcome;
use super::job::Options;
use image::stack::Stack;
use plot::verdict::Check;

/// Checks of the stack's bound against the RAM that there is for it, and of the depths that were
/// measured against the bound.
pub(super) fn stack(options: &Options, outcomes: &[Outcome]) -> Vec<Check> {
    let title = "Worst stack by call graph and frames, against the RAM beside static variables";
    let stack = match analyse(options) {
        Ok(stack) => stack,
        Err(reason) => return vec![Check::untested("stack-bound/ecu", title, reason)],
    };
    let levels = stack.levels.iter();
    let levels: Vec<String> = levels
        .map(|level| format!("{} {}", level.name, level.bytes))
        .collect();
    let bound = Check::at_most(
        "stack-bound/ecu",
        title,
        stack.worst_bytes.into(),
        stack.room_bytes.into(),
    )
    .unit("bytes")
    .detail(format!(
        "one level on top of the other: {}, and {} saved by the core between them",
        levels.join(", "),
        stack.exception_frames_bytes
    ));
    let problems = Check::equals(
        "stack-problems/ecu",
        "Recursion, unknown frames and other gaps in the stack's bound",
        stack.problems.len() as f64,
        0.0,
    )
    .detail(if stack.problems.is_empty() {
        format!(
            "{} frames stated by the compiler, {} of them confirmed by their instructions, {} counted from instructions alone; \
             {} functions call through pointers, to any of {}",
            stack.stated_functions,
            stack.confirmed_functions,
            stack.counted_functions,
            stack.indirect_callers.len(),
            stack.address_taken
        )
    } else {
        stack.problems.join("; ")
    });
    let measured = outcomes.iter().map(Outcome::stack_bytes).max();
    let measured = Check::at_most(
        "stack-measured/ecu",
        "Deepest stack of all runs, against the bound",
        measured.unwrap_or(u32::MAX).into(),
        stack.worst_bytes.into(),
    )
    .unit("bytes");
    vec![bound, problems, measured]
}

fn analyse(options: &Options) -> Result<Stack, String> {
    Stack::analyse(&options.image.bytes, &crate::firmware::PRIORITIES)
        .map_err(|error| error.to_string())
}
