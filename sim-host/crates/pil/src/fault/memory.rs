//! Single bits in the ECU's memory: which are flipped.

use super::processor::Action;
use image::{Image, Symbol};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use shared_model::listed;

/// The same flips in every run.
const SEED: u64 = 4;
/// Bytes of stack above its pointer of which a bit is taken: about the control interrupt's own.
const STACK_BYTES: u32 = 1536;
/// Data addresses start here on every Cortex-M.
const RAM_START: u32 = 0x2000_0000;
/// Variables that belong to the ECU's tasks, by a part of the linker's name.
const CONTROL_TASK: &str = "in_loop13place_control";
const PWM_TASK: &str = "in_loop9place_pwm";
const MAILBOXES: [&str; 2] = ["in_loop5INPUT", "in_loop6OUTPUT"];

listed! {
    /// A part of the memory.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Region {
        /// State, parameters and dither tables of the control task.
        ControlTask => "memory: control task",
        /// State and parameters of the PWM task.
        PwmTask => "memory: PWM task",
        /// What the tasks pass to each other.
        Mailboxes => "memory: mailboxes",
        /// All other variables.
        OtherVariables => "memory: other variables",
        /// The stack in use.
        Stack => "memory: stack",
        /// Code of the tasks.
        Code => "memory: code",
    }
}

impl Region {
    fn holds(self, symbol: &Symbol) -> bool {
        let is = |part: &str| symbol.name.contains(part);
        let is_mailbox = MAILBOXES.into_iter().any(is);
        let is_variable = !symbol.is_code && symbol.address >= RAM_START;
        let is_task = is(CONTROL_TASK) || is(PWM_TASK);
        match self {
            Self::ControlTask => is_variable && is(CONTROL_TASK),
            Self::PwmTask => is_variable && is(PWM_TASK),
            Self::Mailboxes => is_mailbox,
            Self::OtherVariables => is_variable && !is_mailbox && !is_task,
            Self::Stack => false,
            Self::Code => ["SysTick", "PendSV"].contains(&symbol.name.as_str()),
        }
    }
}

/// A flip and when it happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flip {
    /// Where.
    pub region: Region,
    /// What.
    pub action: Action,
    /// The control tick.
    pub tick: u32,
}

/// `count` flips in each region, at ticks from `first_tick` on, spread over `ticks`. Of variables each is as likely as it is
/// large, but none counts for more than 64 bytes: buffers that the loop does not use are most of the memory.
pub fn flips(image: &Image, count: usize, first_tick: u32, ticks: u32) -> Vec<Flip> {
    let mut generator = Pcg64Mcg::seed_from_u64(SEED);
    let mut below = |bound: u32| (generator.next_u64() % u64::from(bound.max(1))) as u32;
    let symbols = image.symbols();
    let mut flips = Vec::new();
    for region in Region::ALL {
        let places: Vec<&Symbol> = symbols.iter().filter(|s| region.holds(s)).collect();
        let weight = |symbol: &Symbol| match region {
            Region::OtherVariables => symbol.size.min(64),
            _ => symbol.size,
        };
        let total: u32 = places.iter().map(|symbol| weight(symbol)).sum();
        for _ in 0..count {
            let bit = below(8) as u8;
            let tick = first_tick + below(ticks);
            let mut draw = below(total);
            let place = places.iter().find(|symbol| {
                let is_here = draw < weight(symbol);
                draw = draw.wrapping_sub(if is_here { 0 } else { weight(symbol) });
                is_here
            });
            let action = match (region, place) {
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
            flips.push(Flip {
                region,
                action,
                tick,
            });
        }
    }
    flips
}
