//! Worst-case stack.
//!
//! All code shares one stack. Code of each priority may be preempted at its deepest point by code
//! of the next priority, and the core saves its registers at each preemption. The sum over the
//! priorities is an upper bound of the stack.
//!
//! Limits of the method:
//! * The frame of a function is the compiler's stack size (`-Zemit-stack-sizes`), or the sum over
//!   its instructions if that is greater. A function without a stack size (assembly, compiler
//!   built-ins) has that sum.
//! * A path through the call graph may be impossible in a run, and the caller's frame is counted in
//!   a tail call: the bound may be too high.
//! * A call through a pointer is assumed to reach the deepest of all functions whose address occurs
//!   in the image. Addresses that are computed by arithmetic would be missed; neither the compiler
//!   nor this project computes any.
//! * Recursion, and code with unknown stack use, have no bound: they are reported as problems, and
//!   the proof fails.
//! * An exception does not preempt one of the same priority, which is a property of the core. The
//!   firmware must have the given priorities.

use crate::AnalysisError;
use crate::budget;
use crate::call_graph::{CallGraph, Function};
use crate::memory::address_of;
use serde::Serialize;
use std::collections::BTreeMap;

/// Exception frame with the floating-point unit in use: 8 core registers, 16 floating-point
/// registers, status and a reserved word, also with lazy stacking (Arm DDI 0403, B1.5.7).
const EXCEPTION_FRAME_BYTES: u32 = 4 * (8 + 18);
/// Maximum padding that aligns the stack pointer to 8 bytes.
const ALIGNMENT_BYTES: u32 = 4;

/// Code that runs at one priority.
#[derive(Debug, Clone, Copy)]
pub struct Priority {
    /// Name in reports.
    pub name: &'static str,
    /// Entry functions; the deepest counts.
    pub entries: &'static [&'static str],
}

/// The worst stack of one level.
#[derive(Debug, Clone, Serialize)]
pub struct Level {
    /// The code of the level.
    pub name: &'static str,
    /// Worst-case bytes, without exception frames.
    pub bytes: u32,
    /// The chain of calls: function and frame, bytes.
    pub path: Vec<(String, u32)>,
}

/// The worst stack of an image.
#[derive(Debug, Clone, Serialize)]
pub struct Stack {
    /// Worst stack of each level, in order of rising priority.
    pub levels: Vec<Level>,
    /// Exception frames between them, bytes.
    pub exception_frames_bytes: u32,
    /// Sum of both, bytes.
    pub worst_bytes: u32,
    /// RAM between the static variables and the top of the stack, bytes.
    pub room_bytes: u32,
    /// Functions with a stack size from the compiler.
    pub stated_functions: usize,
    /// Those whose instructions confirm it exactly.
    pub confirmed_functions: usize,
    /// Functions without one; their frame is computed from their instructions.
    pub counted_functions: usize,
    /// Functions that call through pointers.
    pub indirect_callers: Vec<String>,
    /// Functions whose address is taken.
    pub address_taken: usize,
    /// Reasons why the sum is not a bound; empty in a proof.
    pub problems: Vec<String>,
}

impl Stack {
    /// Analyses an image whose code runs at the given priorities, in rising order.
    ///
    /// # Errors
    /// If it is damaged, was compiled without stack sizes, or lacks a symbol that every image of
    /// the firmware has.
    pub fn analyse(bytes: &[u8], priorities: &[Priority]) -> Result<Self, AnalysisError> {
        let graph = CallGraph::read(bytes)?;
        let file = budget::parse(bytes)?;
        let room =
            address_of(&file, "_stack_start")?.saturating_sub(address_of(&file, "_stack_end")?);
        Self::of(&graph, priorities, room as u32)
    }

    /// Whether the sum is a bound and fits into the RAM.
    pub fn fits(&self) -> bool {
        self.problems.is_empty() && self.worst_bytes <= self.room_bytes
    }

    fn of(
        graph: &CallGraph,
        priorities: &[Priority],
        room_bytes: u32,
    ) -> Result<Self, AnalysisError> {
        let mut search = Search::new(graph);
        let mut found = Vec::new();
        for priority in priorities {
            found.push(search.level(priority)?);
        }
        let preemptions = (priorities.len() as u32).saturating_sub(1);
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

/// A callee: a function, or any function whose address is taken.
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

/// A callee in progress.
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
    /// Results; `None` while a callee is in progress.
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

    fn level(&mut self, priority: &Priority) -> Result<Level, AnalysisError> {
        let mut deepest: Option<(u32, u32)> = None;
        for &entry in priority.entries {
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
            name: priority.name,
            bytes,
            path: self.path(entry),
        })
    }

    /// Bytes of stack below the caller. Iterative, because the depth of a recursion would depend on
    /// the image.
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

    /// A callee with its own part; its problems are recorded.
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
        let priorities = [("main program", &["f0"]), ("task", &["f8"])];
        let priorities = priorities.map(|(name, entries)| Priority { name, entries });
        Stack::of(graph, &priorities, 4096).unwrap()
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

    /// A crafted image of one megabyte has a very long chain.
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
