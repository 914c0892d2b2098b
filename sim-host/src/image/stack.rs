//! How deep the stack can get at worst.
//!
//! All code shares one stack. The main program may be interrupted at its deepest by the control task, that by the PWM
//! interrupt, that by a hard fault, and that by the watchdog: each lower level at its deepest, with the registers that the
//! core saves in between. The sum over these levels bounds the stack from above.
//!
//! Limits of the method:
//! * The frame of a function is what the compiler states (`-Zemit-stack-sizes`), or the sum of what its instructions take,
//!   if that is more. A function that the compiler states nothing of (assembly, the compiler's own arithmetic) has that sum.
//! * A path through the call graph need not be one that a run can take, and a tail call keeps its caller's frame: the
//!   bound may be too high.
//! * A call through a pointer is taken to reach the deepest of all functions whose address is somewhere in the image.
//!   Addresses that are computed by arithmetic would be missed; neither the compiler nor this project makes any.
//! * Recursion, and code whose use of the stack nobody states, have no bound: they are problems, and the proof fails.
//! * Levels are exceptions of different priority, as the firmware sets them. That an exception does not interrupt one of
//!   its own level is the core's property, that the priorities are as here is the firmware's (`firmware/src/interrupts.rs`).

use super::AnalysisError;
use super::call_graph::{CallGraph, Function};
use super::memory::address_of;
use serde::Serialize;
use std::collections::BTreeMap;

/// What the core saves for an exception where the floating-point unit is in use: 8 core registers, 16 of its own, status and a
/// gap, also when saving is put off until they are used (Arm DDI 0403, B1.5.7).
const EXCEPTION_FRAME_BYTES: u32 = 4 * (8 + 18);
/// What it may add to align the stack pointer to 8 bytes.
const ALIGNMENT_BYTES: u32 = 4;

/// Levels by rising priority: name, and the functions that begin there. Of several the deepest counts.
const LEVELS: [(&str, &[&str]); 5] = [
    ("main program", &["Reset"]),
    ("control task", &["PendSV"]),
    ("PWM interrupt", &["SysTick", "DefaultHandler"]),
    // HardFault itself moves the stack pointer back to the top; this is counted all the same as if it lay below the others.
    ("hard fault", &["end_hard_fault"]),
    ("watchdog", &["NonMaskableInt"]),
];

/// The worst stack of one level.
#[derive(Debug, Clone, Serialize)]
pub struct Level {
    /// What runs there.
    pub name: &'static str,
    /// Bytes at worst, without what the core saves.
    pub bytes: u32,
    /// The calls that lead there: function and its frame, bytes.
    pub path: Vec<(String, u32)>,
}

/// The worst stack of an image.
#[derive(Debug, Clone, Serialize)]
pub struct Stack {
    /// Worst of each level, by rising priority.
    pub levels: Vec<Level>,
    /// What the core saves between them, bytes.
    pub exception_frames_bytes: u32,
    /// Sum of both, bytes.
    pub worst_bytes: u32,
    /// RAM between the static variables and the top of the stack, bytes.
    pub room_bytes: u32,
    /// Functions with the compiler's figure, and those of them whose instructions take exactly that.
    pub stated_functions: usize,
    /// See there.
    pub confirmed_functions: usize,
    /// Functions without one; their frame is counted from their instructions.
    pub counted_functions: usize,
    /// Functions that call through pointers.
    pub indirect_callers: Vec<String>,
    /// Functions that a pointer may point to.
    pub address_taken: usize,
    /// Why the figure is no bound; a proof has none.
    pub problems: Vec<String>,
}

impl Stack {
    /// Analyses an image.
    ///
    /// # Errors
    /// If it is damaged, was compiled without the functions' frames, or lacks a symbol that every image of the firmware has.
    pub fn analyse(bytes: &[u8]) -> Result<Self, AnalysisError> {
        let graph = CallGraph::read(bytes)?;
        let file = super::parse(bytes)?;
        let room =
            address_of(&file, "_stack_start")?.saturating_sub(address_of(&file, "_stack_end")?);
        Self::of(&graph, &LEVELS, room as u32)
    }

    /// Whether the figure is a bound, and there is RAM for it.
    pub fn fits(&self) -> bool {
        self.problems.is_empty() && self.worst_bytes <= self.room_bytes
    }

    fn of(
        graph: &CallGraph,
        levels: &[(&'static str, &'static [&'static str])],
        room_bytes: u32,
    ) -> Result<Self, AnalysisError> {
        let mut search = Search::new(graph);
        let mut found = Vec::new();
        for &(name, entries) in levels {
            found.push(search.level(name, entries)?);
        }
        let preemptions = levels.len() as u32 - 1;
        let exception_frames_bytes = preemptions * (EXCEPTION_FRAME_BYTES + ALIGNMENT_BYTES);
        let functions = || graph.functions.values();
        let stated = || functions().filter(|function| function.stated_bytes.is_some());
        let indirect = functions().filter(|function| function.indirect_calls > 0);
        Ok(Self {
            worst_bytes: found.iter().fold(exception_frames_bytes, |sum, level| {
                sum.saturating_add(level.bytes)
            }),
            levels: found,
            exception_frames_bytes,
            room_bytes,
            stated_functions: stated().count(),
            confirmed_functions: stated().filter(|function| is_confirmed(function)).count(),
            counted_functions: functions().count() - stated().count(),
            indirect_callers: indirect
                .map(|function| function.name().to_owned())
                .collect(),
            address_taken: graph.address_taken.len(),
            problems: search.problems,
        })
    }
}

fn is_confirmed(function: &Function) -> bool {
    function.stated_bytes == Some(function.counted_bytes)
}

/// What is called: a function, or whatever a pointer may point to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Callee {
    Function(u32),
    ByPointer,
}

/// The deepest path below a callee.
#[derive(Debug, Clone, Copy)]
struct Deepest {
    bytes: u32,
    next: Option<Callee>,
}

/// A callee whose own are being looked at.
struct Open<'a> {
    callee: Callee,
    own_bytes: u32,
    deepest: Deepest,
    calls: std::collections::btree_set::Iter<'a, u32>,
    by_pointer: bool,
}

impl Open<'_> {
    fn next(&mut self) -> Option<Callee> {
        let function = self.calls.next().copied().map(Callee::Function);
        function.or_else(|| std::mem::take(&mut self.by_pointer).then_some(Callee::ByPointer))
    }

    fn called(&mut self, callee: Callee, bytes: u32) {
        let bytes = self.own_bytes.saturating_add(bytes);
        if bytes > self.deepest.bytes {
            self.deepest = Deepest {
                bytes,
                next: Some(callee),
            };
        }
    }
}

struct Search<'a> {
    graph: &'a CallGraph,
    /// What is known; `None` while a callee is open.
    known: BTreeMap<Callee, Option<Deepest>>,
    problems: Vec<String>,
}

impl<'a> Search<'a> {
    fn new(graph: &'a CallGraph) -> Self {
        Self {
            graph,
            known: BTreeMap::new(),
            problems: Vec::new(),
        }
    }

    fn level(
        &mut self,
        name: &'static str,
        entries: &[&'static str],
    ) -> Result<Level, AnalysisError> {
        let mut deepest: Option<(u32, u32)> = None;
        for &entry in entries {
            let function = self
                .graph
                .find(entry)
                .ok_or(AnalysisError::NoSymbol(entry))?;
            let bytes = self.deepest(Callee::Function(function));
            if deepest.is_none_or(|(most, _)| bytes > most) {
                deepest = Some((bytes, function));
            }
        }
        let (bytes, entry) = deepest.unwrap_or_default();
        Ok(Level {
            name,
            bytes,
            path: self.path(entry),
        })
    }

    /// Bytes of stack below the caller. Not by recursion, whose depth would be that of the image.
    fn deepest(&mut self, entry: Callee) -> u32 {
        if let Some(Some(known)) = self.known.get(&entry) {
            return known.bytes;
        }
        let mut open = vec![self.open(entry)];
        loop {
            let top = open.last_mut().expect("the entry is closed last");
            if let Some(callee) = top.next() {
                match self.known.get(&callee) {
                    Some(Some(known)) => top.called(callee, known.bytes),
                    Some(None) => {
                        let again = self.name(match callee {
                            Callee::Function(_) => callee,
                            Callee::ByPointer => top.callee,
                        });
                        self.problems.push(format!("{again} calls itself"));
                    }
                    None => open.push(self.open(callee)),
                }
                continue;
            }
            let Open {
                callee, deepest, ..
            } = open.pop().expect("it is there");
            self.known.insert(callee, Some(deepest));
            match open.last_mut() {
                Some(caller) => caller.called(callee, deepest.bytes),
                None => return deepest.bytes,
            }
        }
    }

    /// A callee with its own part, and its problems noted.
    fn open(&mut self, callee: Callee) -> Open<'a> {
        let graph = self.graph;
        self.known.insert(callee, None);
        let (own_bytes, calls, by_pointer) = match callee {
            Callee::ByPointer => (0, &graph.address_taken, false),
            Callee::Function(address) => {
                let function = &graph.functions[&address];
                for stray in &function.strays {
                    let problem = format!("{} goes to {stray:#x}, no function", function.name());
                    self.problems.push(problem);
                }
                let own = function.frame_bytes().unwrap_or_else(|| {
                    let problem = format!("{} sets the stack pointer itself", function.name());
                    self.problems.push(problem);
                    0
                });
                (own, &function.calls, function.indirect_calls > 0)
            }
        };
        Open {
            callee,
            own_bytes,
            deepest: Deepest {
                bytes: own_bytes,
                next: None,
            },
            calls: calls.iter(),
            by_pointer,
        }
    }

    fn name(&self, callee: Callee) -> &'a str {
        match callee {
            Callee::Function(address) => self.graph.functions[&address].name(),
            Callee::ByPointer => "what a pointer may point to",
        }
    }

    fn path(&self, entry: u32) -> Vec<(String, u32)> {
        let mut path = Vec::new();
        let mut at = Some(Callee::Function(entry));
        while let Some(callee) = at {
            if let Callee::Function(address) = callee {
                let function = &self.graph.functions[&address];
                let bytes = function.frame_bytes().unwrap_or(0);
                path.push((function.name().to_owned(), bytes));
            }
            let deepest = self.known.get(&callee).copied().flatten();
            at = deepest.and_then(|deepest| deepest.next);
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Functions by address: frame, calls, calls through pointers.
    fn graph(functions: &[(u32, u32, &[u32], u32)], address_taken: &[u32]) -> CallGraph {
        let function = |&(address, bytes, calls, indirect_calls): &(u32, u32, &[u32], u32)| {
            let function = Function {
                names: [format!("f{address}")].into(),
                stated_bytes: Some(bytes),
                calls: calls.iter().copied().collect(),
                indirect_calls,
                ..Function::default()
            };
            (address, function)
        };
        CallGraph {
            functions: functions.iter().map(function).collect(),
            address_taken: address_taken.iter().copied().collect(),
        }
    }

    fn worst(graph: &CallGraph) -> Stack {
        Stack::of(graph, &[("main program", &["f0"]), ("task", &["f8"])], 4096).unwrap()
    }

    #[test]
    fn the_deepest_paths_add_up_with_the_core_s_frames() {
        let graph = graph(
            &[
                (0, 8, &[2, 4], 0),
                (2, 100, &[], 0),
                (4, 16, &[6], 0),
                (6, 90, &[], 0),
                (8, 24, &[6], 0),
            ],
            &[],
        );
        let stack = worst(&graph);
        assert_eq!(stack.problems, [] as [&str; 0]);
        assert_eq!(stack.worst_bytes, (8 + 16 + 90) + (24 + 90) + 108);
        assert_eq!(
            stack.levels[0].path,
            [("f0".into(), 8), ("f4".into(), 16), ("f6".into(), 90)]
        );
    }

    #[test]
    fn a_pointer_reaches_the_deepest_function_that_has_an_address() {
        let functions: &[(u32, u32, &[u32], u32)] = &[
            (0, 8, &[], 1),
            (2, 100, &[], 0),
            (4, 200, &[], 0),
            (8, 0, &[], 0),
        ];
        assert_eq!(worst(&graph(functions, &[2])).levels[0].bytes, 108);
        assert_eq!(worst(&graph(functions, &[2, 4])).levels[0].bytes, 208);
    }

    /// A hostile image has one in a megabyte.
    #[test]
    fn a_chain_of_calls_takes_no_stack_of_this_program() {
        let length = 200_000;
        let calls: Vec<[u32; 1]> = (0..length).map(|k| [2 * k + 2]).collect();
        let mut functions: Vec<(u32, u32, &[u32], u32)> = (0..length)
            .zip(&calls)
            .map(|(k, called)| (2 * k, 1, &called[..], 0))
            .collect();
        functions.push((2 * length, 1, &[], 0));
        let stack = worst(&graph(&functions, &[]));
        assert_eq!(stack.problems, [] as [&str; 0]);
        assert_eq!(stack.levels[0].bytes, length + 1);
        assert_eq!(stack.levels[1].bytes, length + 1 - 4);
    }

    #[test]
    fn recursion_through_a_pointer_has_no_bound() {
        let functions: &[(u32, u32, &[u32], u32)] =
            &[(0, 8, &[], 1), (2, 8, &[], 1), (8, 8, &[], 0)];
        let problems = worst(&graph(functions, &[2])).problems;
        assert_eq!(problems, ["f2 calls itself"]);
    }

    #[test]
    fn recursion_has_no_bound() {
        let functions: &[(u32, u32, &[u32], u32)] = &[
            (0, 8, &[2], 0),
            (2, 8, &[4], 0),
            (4, 8, &[2], 0),
            (8, 8, &[], 0),
        ];
        assert_eq!(worst(&graph(functions, &[])).problems, ["f2 calls itself"]);
    }

    #[test]
    fn unknown_frames_and_strays_are_problems() {
        let mut graph = graph(&[(0, 8, &[2], 0), (2, 8, &[], 0), (8, 8, &[], 0)], &[]);
        let function = graph.functions.get_mut(&2).unwrap();
        function.stated_bytes = None;
        function.sets_stack_pointer = true;
        function.strays = vec![0x100];
        assert_eq!(worst(&graph).problems.len(), 2);
    }
}
