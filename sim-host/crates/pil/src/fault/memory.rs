//! Single bits in the ECU's memory: a random sample from a fixed seed.

use super::processor_fault::{Action, ProcessorFault, Region};
use image::{Image, Symbol};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use std::ops::Range;

/// Fixed, so that every run has the same flips.
const SEED: u64 = 4;
/// Bytes of stack above its pointer from which a bit is drawn: about the control interrupt's frame.
const STACK_BYTES: u32 = 1536;
/// First data address of every Cortex-M.
const RAM_START: u32 = 0x2000_0000;
/// Variables of the ECU's tasks, by a part of the symbol's name.
const CONTROL_TASK: &str = "in_loop13place_control";
const PWM_TASK: &str = "in_loop9place_pwm";
const MAILBOXES: [&str; 2] = ["steering5INPUT", "steering6OUTPUT"];

/// `count` flips in each region, at random ticks in `ticks`. The probability of a variable is
/// proportional to its size. A size above 64 bytes counts as 64 bytes, because most of the memory
/// is buffers that the loop does not use.
pub fn flips(image: &Image, count: usize, ticks: Range<u32>) -> Vec<ProcessorFault> {
    let mut generator = Pcg64Mcg::seed_from_u64(SEED);
    let mut below = |bound: u32| (generator.next_u64() % u64::from(bound.max(1))) as u32;
    let all = image.symbols();
    let mut flips = Vec::new();
    for region in Region::ALL {
        let symbols: Vec<&Symbol> = all.iter().filter(|s| holds(region, s)).collect();
        let weight = |symbol: &Symbol| match region {
            Region::OtherVariables => symbol.size.min(64),
            _ => symbol.size,
        };
        let total: u32 = symbols.iter().map(|symbol| weight(symbol)).sum();
        for _ in 0..count {
            let bit = below(8) as u8;
            let tick = ticks.start + below(ticks.len() as u32);
            let mut draw = below(total);
            let drawn = symbols.iter().find(|symbol| {
                let is_here = draw < weight(symbol);
                draw = draw.wrapping_sub(if is_here { 0 } else { weight(symbol) });
                is_here
            });
            let action = match (region, drawn) {
                (Region::Stack, _) => Action::FlipStack {
                    seed: below(u32::MAX),
                    offset: below(STACK_BYTES),
                    bit,
                },
                (_, Some(symbol)) => Action::Flip {
                    address: symbol.address + below(symbol.size),
                    bit,
                },
                (_, None) => continue,
            };
            flips.push(ProcessorFault {
                action,
                region: Some(region),
                tick,
            });
        }
    }
    flips
}

/// Whether a symbol lies in a region.
fn holds(region: Region, symbol: &Symbol) -> bool {
    let is = |part: &str| symbol.name.contains(part);
    let is_mailbox = MAILBOXES.into_iter().any(is);
    let is_variable = !symbol.is_code && symbol.address >= RAM_START;
    let is_task = is(CONTROL_TASK) || is(PWM_TASK);
    match region {
        Region::ControlTask => is_variable && is(CONTROL_TASK),
        Region::PwmTask => is_variable && is(PWM_TASK),
        Region::Mailboxes => is_mailbox,
        Region::OtherVariables => is_variable && !is_mailbox && !is_task,
        Region::Stack => false,
        Region::Code => ["SysTick", "PendSV"].contains(&symbol.name.as_str()),
    }
}
