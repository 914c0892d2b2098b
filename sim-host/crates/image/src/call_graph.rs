//! The call graph of an image, read from its machine code.
//!
//! Functions are the symbols of type function. Their code is decoded from start to end, except for
//! data, which the symbols `$d` and `$t` mark. A branch out of a function is a tail call, for which
//! the caller's frame is kept in the bound. A call through a pointer may reach every function whose
//! address occurs in the image: in a word of the data, or composed by two instructions.

use crate::AnalysisError;
use crate::budget::{self, Budget};
use crate::thumb::{self, Effect};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};
use std::collections::{BTreeMap, BTreeSet};

/// Section with the compiler's stack sizes.
const STACK_SIZES: &str = ".stack_sizes";
/// Its words are addresses of functions that the core calls, not a pointer.
const VECTOR_TABLE: &str = ".vector_table";

/// Maximum length of a function's name, bytes.
const LONGEST_NAME: usize = 1024;

/// One function.
#[derive(Debug, Clone, Default)]
pub struct Function {
    /// Length of its code, bytes; 0 if the symbol has none, which means up to the next function.
    pub length_bytes: u32,
    /// Its names, without the compiler's hashes; several where functions of the same code share
    /// it.
    pub names: BTreeSet<String>,
    /// Stack size given by the compiler, bytes; `None` for code that was not compiled with this
    /// image.
    pub stated_bytes: Option<u32>,
    /// Sum of the stack use of its instructions, bytes.
    pub counted_bytes: u32,
    /// Whether an instruction sets the stack pointer, so that the sum is not an upper bound.
    pub sets_stack_pointer: bool,
    /// Addresses of the functions that it calls.
    pub calls: BTreeSet<u32>,
    /// Calls through a pointer.
    pub indirect_calls: u32,
    /// Breakpoint instructions, which are faults without a debugger.
    pub breakpoints: u32,
    /// Branches to addresses outside all functions.
    pub strays: Vec<u32>,
}

impl Function {
    /// The first of its names in alphabetical order.
    pub fn name(&self) -> &str {
        self.names.first().map_or("", String::as_str)
    }

    /// Upper bound of its stack size, bytes; `None` if there is none.
    pub(crate) fn frame_bytes(&self) -> Option<u32> {
        match self.stated_bytes {
            Some(stated) => Some(stated.max(self.counted_bytes)),
            None => (!self.sets_stack_pointer).then_some(self.counted_bytes),
        }
    }
}

/// All functions of an image.
#[derive(Debug, Clone)]
pub struct CallGraph {
    /// The functions by address.
    pub functions: BTreeMap<u32, Function>,
    /// Functions whose address is taken.
    pub address_taken: BTreeSet<u32>,
}

impl CallGraph {
    /// Reads the graph.
    ///
    /// # Errors
    /// If the image is damaged, or was compiled without stack sizes.
    pub fn read(bytes: &[u8]) -> Result<Self, AnalysisError> {
        let file = budget::parse(bytes)?;
        let mut functions = named(&file)?;
        for (address, bytes) in stack_sizes(&file)? {
            if let Some(function) = functions.get_mut(&address) {
                function.stated_bytes = Some(bytes);
            }
        }
        let mut graph = Self {
            functions,
            address_taken: BTreeSet::new(),
        };
        graph.sweep(&file, Budget::new(bytes.len(), "functions"))?;
        graph.find_pointers(&file, Budget::new(bytes.len(), "sections"))?;
        Ok(graph)
    }

    /// The function of that name.
    pub fn find(&self, name: &str) -> Option<u32> {
        let mut functions = self.functions.iter();
        functions.find_map(|(&address, function)| function.names.contains(name).then_some(address))
    }

    fn sweep(&mut self, file: &object::File<'_>, mut budget: Budget) -> Result<(), AnalysisError> {
        let starts: Vec<u32> = self.functions.keys().copied().collect();
        let data = Marks::read(file);
        for section in file.sections().filter(|s| s.kind() == SectionKind::Text) {
            let code = Words::of(&section)?;
            let first = starts.partition_point(|&start| start < code.start);
            let behind = starts.partition_point(|&start| start < code.end);
            for index in first..behind {
                let start = starts[index];
                let next = starts.get(index + 1).copied().unwrap_or(u32::MAX);
                let end = match self.functions[&start].length_bytes {
                    0 => next.min(code.end),
                    length => start.saturating_add(length).min(code.end),
                };
                budget.spend(1 + u64::from(end - start))?;
                self.sweep_function(&code, start..end, &data);
            }
        }
        Ok(())
    }

    fn sweep_function(&mut self, code: &Words, range: std::ops::Range<u32>, marks: &Marks) {
        let mut swept = Function::default();
        let mut low_halves = BTreeMap::new();
        let mut address = range.start;
        while address < range.end {
            if marks.is_data(address) {
                self.note_pointer(code.word(address).filter(|_| address.is_multiple_of(4)));
                address = address.saturating_add(2);
                continue;
            }
            let (Some(first), second) = (code.half(address), code.half(address.saturating_add(2)))
            else {
                break;
            };
            let (length, effect) = thumb::decode(address, first, second.unwrap_or(0));
            match effect {
                Effect::None => {}
                Effect::Push(bytes) => {
                    swept.counted_bytes = swept.counted_bytes.saturating_add(bytes);
                }
                Effect::SetStackPointer => swept.sets_stack_pointer = true,
                Effect::Indirect => swept.indirect_calls += 1,
                Effect::Breakpoint => swept.breakpoints += 1,
                Effect::Branch(target) if range.contains(&target) => {}
                Effect::Call(target) | Effect::Branch(target) => {
                    if self.functions.contains_key(&target) {
                        swept.calls.insert(target);
                    } else {
                        swept.strays.push(target);
                    }
                }
                Effect::LowHalf(register, half) => {
                    low_halves.insert(register, half);
                }
                Effect::HighHalf(register, half) => {
                    self.note_pointer(low_halves.get(&register).map(|low| half << 16 | low));
                }
            }
            // A pointer below 64 KiB needs no upper half.
            if let Effect::LowHalf(_, half) = effect {
                self.note_pointer(Some(half));
            }
            address = address.saturating_add(length);
        }
        if let Some(function) = self.functions.get_mut(&range.start) {
            *function = Function {
                names: std::mem::take(&mut function.names),
                length_bytes: function.length_bytes,
                stated_bytes: function.stated_bytes,
                ..swept
            };
        }
    }

    fn find_pointers(
        &mut self,
        file: &object::File<'_>,
        mut budget: Budget,
    ) -> Result<(), AnalysisError> {
        let is_data = |kind| {
            matches!(
                kind,
                SectionKind::Data | SectionKind::ReadOnlyData | SectionKind::ReadOnlyString
            )
        };
        for section in file.sections().filter(|s| is_data(s.kind())) {
            if section.name()? == VECTOR_TABLE {
                continue;
            }
            let words = Words::of(&section)?;
            budget.spend(words.bytes.len() as u64)?;
            let first = words.start.checked_next_multiple_of(4);
            for address in (first.unwrap_or(words.end)..words.end).step_by(4) {
                self.note_pointer(words.word(address));
            }
        }
        Ok(())
    }

    /// Records a number that may be a function's address, which is odd.
    fn note_pointer(&mut self, number: Option<u32>) {
        let function = number.filter(|number| number % 2 == 1).map(|odd| odd - 1);
        if let Some(function) = function.filter(|f| self.functions.contains_key(f)) {
            self.address_taken.insert(function);
        }
    }
}

/// The functions by address, with their names only.
pub(crate) fn named(file: &object::File<'_>) -> Result<BTreeMap<u32, Function>, AnalysisError> {
    let mut functions = BTreeMap::new();
    for symbol in file.symbols().filter(|s| s.kind() == SymbolKind::Text) {
        let Ok(name) = symbol.name() else { continue };
        if name.is_empty() || name.starts_with('$') || symbol.is_undefined() {
            continue;
        }
        let address = address_of(symbol.address())? & !1;
        let function: &mut Function = functions.entry(address).or_default();
        function.names.insert(demangled(name));
        let length = u32::try_from(symbol.size()).unwrap_or(u32::MAX);
        function.length_bytes = function.length_bytes.max(length);
    }
    Ok(functions)
}

fn address_of(address: u64) -> Result<u32, AnalysisError> {
    u32::try_from(address).map_err(|_| AnalysisError::Address(address))
}

/// A name without the compiler's hashes; a few bytes of a mangled one may stand for megabytes,
/// which are cut off.
fn demangled(name: &str) -> String {
    struct Short(String);
    impl std::fmt::Write for Short {
        fn write_str(&mut self, piece: &str) -> std::fmt::Result {
            let room = LONGEST_NAME - self.0.len();
            let end = piece.floor_char_boundary(room);
            self.0.push_str(&piece[..end]);
            if end == piece.len() {
                Ok(())
            } else {
                Err(std::fmt::Error)
            }
        }
    }
    let mut short = Short(String::new());
    // An error is the end of what is kept.
    let _ = std::fmt::write(
        &mut short,
        format_args!("{:#}", rustc_demangle::demangle(name)),
    );
    short.0
}

/// Address and frame of each compiled function: a word, and a number in LEB128.
fn stack_sizes(file: &object::File<'_>) -> Result<Vec<(u32, u32)>, AnalysisError> {
    let section = file
        .section_by_name(STACK_SIZES)
        .ok_or(AnalysisError::NoStackSizes)?;
    let mut rest = section.data()?;
    let mut sizes = Vec::new();
    while let Some((address, tail)) = rest.split_first_chunk() {
        let length = tail.iter().take_while(|&&byte| byte & 0x80 != 0).count() + 1;
        let number = tail.get(..length).ok_or(AnalysisError::StackSizes)?;
        let bytes = number
            .iter()
            .rev()
            .fold(0, |sum: u32, &byte| sum << 7 | u32::from(byte & 0x7F));
        sizes.push((u32::from_le_bytes(*address) & !1, bytes));
        rest = &tail[length..];
    }
    if sizes.is_empty() || !rest.is_empty() {
        return Err(AnalysisError::StackSizes);
    }
    Ok(sizes)
}

/// A section's bytes at their addresses.
struct Words<'a> {
    start: u32,
    end: u32,
    bytes: &'a [u8],
}

impl<'a> Words<'a> {
    fn of(section: &impl ObjectSection<'a>) -> Result<Self, AnalysisError> {
        let bytes = section.data()?;
        let start = section.address();
        Ok(Self {
            start: address_of(start)?,
            end: address_of(start.saturating_add(bytes.len() as u64))?,
            bytes,
        })
    }

    fn at<const N: usize>(&self, address: u32) -> Option<[u8; N]> {
        let offset = address.checked_sub(self.start)?;
        let bytes = self.bytes.get(offset as usize..)?;
        bytes.first_chunk().copied()
    }

    fn half(&self, address: u32) -> Option<u16> {
        self.at(address).map(u16::from_le_bytes)
    }

    fn word(&self, address: u32) -> Option<u32> {
        self.at(address).map(u32::from_le_bytes)
    }
}

/// Where data begins and ends within code, by the mapping symbols of the Arm ELF specification.
struct Marks(BTreeMap<u32, bool>);

impl Marks {
    fn read(file: &object::File<'_>) -> Self {
        let mut marks = BTreeMap::new();
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or("");
            let is_data = name == "$d" || name.starts_with("$d.");
            let is_code = name == "$t" || name.starts_with("$t.");
            // Where both are at one address, the piece of data is empty.
            if is_data || is_code {
                let mark = marks.entry(symbol.address() as u32).or_insert(true);
                *mark &= is_data;
            }
        }
        Self(marks)
    }

    fn is_data(&self, address: u32) -> bool {
        let before = self.0.range(..=address).next_back();
        before.is_some_and(|(_, &is_data)| is_data)
    }
}

/// Names of all functions in an image, without the compiler's hashes.
///
/// # Errors
/// If it is no ELF, or damaged.
pub fn function_names(bytes: &[u8]) -> Result<Vec<String>, AnalysisError> {
    let file = budget::parse(bytes)?;
    let functions = named(&file)?.into_values();
    Ok(functions.flat_map(|function| function.names).collect())
}
