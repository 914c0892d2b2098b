//! The worst stack of a small image made by hand, whose depth is known.

use image::AnalysisError;
use image::stack::{Priority, Stack};
use object::write::{Object, Symbol, SymbolSection};
use object::{
    Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope,
};

/// Functions by name: address, half-words of their code, frame that the compiler states.
type Code<'a> = (&'a str, u64, &'a [u16], Option<u8>);

const RETURN: u16 = 0x4770;
/// `Reset` takes 8 bytes and calls `deep` (24 bytes), the control task 16 and calls through a
/// pointer, which can only be to `pointed` (40 bytes). A word between two functions is data and
/// would be a PUSH.
const CODE: [Code; 8] = [
    // push {r7, lr}; bl 0x110; udf
    ("Reset", 0x100, &[0xB580, 0xF000, 0xF805, 0xDE00], Some(8)),
    // sub sp, #16; push {r7, lr}; bx lr
    ("deep", 0x110, &[0xB084, 0xB580, RETURN], Some(24)),
    // push {r4, r5, r7, lr}; blx r1; pop {r4, r5, r7, pc}
    ("PendSV", 0x120, &[0xB5B0, 0x4788, 0xBDB0], Some(16)),
    // sub sp, #40; add sp, #40; bx lr, no frame stated
    ("pointed", 0x130, &[0xB08A, 0xB00A, RETURN], None),
    ("SysTick", 0x140, &[RETURN], Some(0)),
    // push {r7, lr}; pop {r7, pc}
    ("DefaultHandler", 0x150, &[0xB580, 0xBD80], Some(8)),
    ("end_hard_fault", 0x160, &[RETURN], Some(0)),
    ("NonMaskableInt", 0x170, &[RETURN], Some(0)),
];
const PRIORITIES: [Priority; 5] = [
    priority("main program", &["Reset"]),
    priority("control task", &["PendSV"]),
    priority("PWM interrupt", &["SysTick", "DefaultHandler"]),
    priority("hard fault", &["end_hard_fault"]),
    priority("watchdog", &["NonMaskableInt"]),
];
const POINTED: u32 = 0x131;
const DATA_AT: u64 = 0x106;

const fn priority(name: &'static str, entries: &'static [&'static str]) -> Priority {
    Priority { name, entries }
}

/// The image, its sections at the addresses that their symbols have.
fn image(code: &[Code], states_frames: bool) -> Vec<u8> {
    let mut object = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let text = object.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    let end = code
        .iter()
        .map(|(_, at, words, _)| at + 2 * words.len() as u64)
        .max();
    let mut bytes = vec![0; end.unwrap_or(0) as usize];
    for (_, at, words, _) in code {
        for (k, word) in words.iter().enumerate() {
            let at = *at as usize + 2 * k;
            bytes[at..at + 2].copy_from_slice(&word.to_le_bytes());
        }
    }
    object.set_section_data(text, bytes, 4);
    let data = object.add_section(Vec::new(), b".rodata".to_vec(), SectionKind::ReadOnlyData);
    object.set_section_data(data, POINTED.to_le_bytes().to_vec(), 4);
    let mut symbol = |name: &str, value, kind, section| {
        object.add_symbol(Symbol {
            name: name.as_bytes().to_vec(),
            value,
            size: 0,
            kind,
            scope: SymbolScope::Linkage,
            weak: false,
            section,
            flags: SymbolFlags::None,
        });
    };
    for (name, at, ..) in code {
        symbol(name, at | 1, SymbolKind::Text, SymbolSection::Section(text));
    }
    for (name, at) in [("$t", 0x100), ("$d", DATA_AT), ("$t", 0x110)] {
        symbol(name, at, SymbolKind::Label, SymbolSection::Section(text));
    }
    for (name, at) in [("_stack_start", 0x2000_1000), ("_stack_end", 0x2000_0800)] {
        symbol(name, at, SymbolKind::Data, SymbolSection::Absolute);
    }
    if states_frames {
        let frames = object.add_section(Vec::new(), b".stack_sizes".to_vec(), SectionKind::Other);
        let stated = code
            .iter()
            .filter_map(|(_, at, _, frame)| Some((*at as u32 | 1, (*frame)?)));
        let entries = stated.flat_map(|(at, frame)| [&at.to_le_bytes()[..], &[frame]].concat());
        object.set_section_data(frames, entries.collect::<Vec<u8>>(), 1);
    }
    object.write().expect("the image can be written")
}

#[test]
fn the_depth_is_the_one_made() {
    let stack =
        Stack::analyse(&image(&CODE, true), &PRIORITIES).expect("the image can be analysed");
    assert_eq!(stack.problems, [] as [&str; 0]);
    let bytes: Vec<u32> = stack.levels.iter().map(|level| level.bytes).collect();
    assert_eq!(bytes, [8 + 24, 16 + 40, 8, 0, 0]);
    assert_eq!(stack.worst_bytes, 32 + 56 + 8 + 4 * 108);
    assert_eq!(stack.room_bytes, 0x800);
    assert!(stack.fits());
    assert_eq!((stack.stated_functions, stack.confirmed_functions), (7, 7));
    assert_eq!((stack.counted_functions, stack.address_taken), (1, 1));
}

#[test]
fn what_the_instructions_take_counts_where_more_is_stated_than_true() {
    let mut code = CODE;
    // Stated: 4 bytes, taken: 24.
    code[1].3 = Some(4);
    let stack =
        Stack::analyse(&image(&code, true), &PRIORITIES).expect("the image can be analysed");
    assert_eq!(stack.levels[0].bytes, 8 + 24);
    assert_eq!(stack.confirmed_functions, 6);
}

#[test]
fn recursion_in_the_code_is_found() {
    let mut code = CODE;
    // bl 0x110, from itself.
    code[1].2 = &[0xB580, 0xF7FF, 0xFFFD, RETURN];
    let stack =
        Stack::analyse(&image(&code, true), &PRIORITIES).expect("the image can be analysed");
    assert_eq!(stack.problems, ["deep calls itself"]);
    assert!(!stack.fits());
}

/// Symbols of one name at every other half-word of 64 KiB of code, each of that size.
fn many(name: &str, symbols: u64, size: u64) -> Vec<u8> {
    let mut object = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let text = object.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    object.set_section_data(text, vec![0; 1 << 16], 4);
    let frames = object.add_section(Vec::new(), b".stack_sizes".to_vec(), SectionKind::Other);
    object.set_section_data(frames, vec![1, 1, 0, 0, 8], 1);
    for k in 0..symbols {
        object.add_symbol(Symbol {
            name: name.as_bytes().to_vec(),
            value: (4 * k) | 1,
            size,
            kind: SymbolKind::Text,
            scope: SymbolScope::Linkage,
            weak: false,
            section: SymbolSection::Section(text),
            flags: SymbolFlags::None,
        });
    }
    object.write().expect("the image can be written")
}

/// What a small file says of itself may be read for hours and fill all memory.
#[test]
fn names_and_functions_that_overlap_are_refused() {
    for (image, what) in [
        (many(&"n".repeat(1 << 16), 10_000, 4), "names"),
        (many("n", 10_000, 1 << 16), "functions"),
    ] {
        let error = Stack::analyse(&image, &PRIORITIES).expect_err("it is damaged");
        assert!(
            matches!(error, AnalysisError::Overlap(found) if found == what),
            "{error}"
        );
    }
    // As a linker lays them out.
    let error = Stack::analyse(&many("n", 10_000, 4), &PRIORITIES).expect_err("it lacks a symbol");
    assert!(matches!(error, AnalysisError::NoSymbol(_)), "{error}");
}

/// Eight bytes of a mangled name stand for twice as much as the eight before.
#[test]
fn names_that_grow_are_cut() {
    let mut name = String::from("_RMC0");
    for _ in 0..30 {
        name.insert_str(2, "TB_B_");
    }
    for name in [name, "_ZN3foo3barE".into(), "é".repeat(2000)] {
        let names = image::function_names(&many(&name, 3, 4)).expect("it can be read");
        assert!(
            names
                .iter()
                .all(|name| !name.is_empty() && name.len() <= 1024)
        );
    }
}

#[test]
fn without_frames_there_is_no_bound() {
    let error =
        Stack::analyse(&image(&CODE, false), &PRIORITIES).expect_err("nothing states the frames");
    assert!(matches!(error, AnalysisError::NoStackSizes), "{error}");
}
