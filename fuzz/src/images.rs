//! Images of the firmware, and the log that one of them writes.

use crate::target::{Target, as_it_is};
use image::Image;
use image::stack::Stack;
use object::write::{Object, Symbol, SymbolSection};
use object::{
    Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope,
};
use qemu::log::LogDecoder;
use sim_host::firmware::PRIORITIES;
use std::path::PathBuf;
use std::sync::LazyLock;

/// An image.
pub const ELF: Target = Target {
    name: "elf",
    read: read_elf,
    repair: as_it_is,
    seeds: || vec![image(&[]), image(FORMATS)],
    // Functions of 16 bytes in the file with names of a kilobyte, and problems in words.
    multiple: 512,
    mutations: 50_000,
};

/// The console of an image.
pub const LOG: Target = Target {
    name: "log",
    read: read_log,
    repair: repair_log,
    seeds: || {
        vec![frames(&[
            &[1, 0, 210, 4, 0, 0],
            &[2, 0, 2, 0, 0, 0, 104, 105],
        ])]
    },
    multiple: 64,
    mutations: 100_000,
};

/// Name, address, and code of each function.
const CODE: [(&str, u64, &[u16]); 8] = [
    ("Reset", 0x100, &[0xB580, 0xF000, 0xF805, 0xDE00]),
    ("deep", 0x110, &[0xB084, 0xB580, 0x4770]),
    ("PendSV", 0x120, &[0xB5B0, 0x4788, 0xBDB0]),
    (
        "_ZN4core3fmt5write17h0123456789abcdefE",
        0x130,
        &[0xB08A, 0xB00A, 0x4770],
    ),
    ("SysTick", 0x140, &[0x4770]),
    ("DefaultHandler", 0x150, &[0xB580, 0xBD80]),
    ("end_hard_fault", 0x160, &[0x4770]),
    ("NonMaskableInt", 0x170, &[0x4770]),
];

/// Formats of a log: tag and text.
const FORMATS: &[(&str, &str)] = &[
    ("defmt_info", "run complete; deepest stack {=u32} bytes"),
    ("defmt_error", "cannot open the link {=str}"),
    (
        "defmt_warn",
        "{=f64} {=bool} {=char} {=[u8]} {=i8:x} {=0..4}",
    ),
    ("defmt_info", "a {=?} of {=[?]}"),
    ("defmt_derived", "Kind {{ x: {=u8} }}"),
];

fn image(formats: &[(&str, &str)]) -> Vec<u8> {
    let mut object = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let text = object.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    let mut bytes = vec![0; 0x180];
    for (_, at, words) in CODE {
        for (k, word) in words.iter().enumerate() {
            let at = at as usize + 2 * k;
            bytes[at..at + 2].copy_from_slice(&word.to_le_bytes());
        }
    }
    object.set_section_data(text, bytes, 4);
    let data = object.add_section(Vec::new(), b".rodata".to_vec(), SectionKind::ReadOnlyData);
    object.set_section_data(data, 0x131_u32.to_le_bytes().to_vec(), 4);
    let frames = object.add_section(Vec::new(), b".stack_sizes".to_vec(), SectionKind::Other);
    let stated = CODE
        .iter()
        .flat_map(|(_, at, _)| [&(*at as u32 | 1).to_le_bytes()[..], &[8]].concat());
    object.set_section_data(frames, stated.collect::<Vec<u8>>(), 1);
    let log = object.add_section(Vec::new(), b".defmt".to_vec(), SectionKind::Other);
    object.set_section_data(log, vec![0; 16], 1);
    let mut symbol = |name: &str, value, kind, section| {
        object.add_symbol(Symbol {
            name: name.as_bytes().to_vec(),
            value,
            size: 1,
            kind,
            scope: SymbolScope::Linkage,
            weak: false,
            section,
            flags: SymbolFlags::None,
        });
    };
    for (name, at, _) in CODE {
        symbol(name, at | 1, SymbolKind::Text, SymbolSection::Section(text));
    }
    for (name, at) in [("$t", 0x100), ("$d", 0x106), ("$t", 0x110)] {
        symbol(name, at, SymbolKind::Label, SymbolSection::Section(text));
    }
    for (name, at) in [("_stack_start", 0x2000_1000), ("_stack_end", 0x2000_0800)] {
        symbol(name, at, SymbolKind::Data, SymbolSection::Absolute);
    }
    if !formats.is_empty() {
        for name in ["_defmt_version_ = 4", "_defmt_encoding_ = rzcobs"] {
            symbol(name, 0, SymbolKind::Data, SymbolSection::Section(log));
        }
    }
    for (address, (tag, format)) in (1..).zip(formats) {
        let name = format!(
            r#"{{"package":"p","tag":"{tag}","data":"{format}","disambiguator":"{address}","crate_name":"c"}}"#
        );
        symbol(
            &name,
            address,
            SymbolKind::Data,
            SymbolSection::Section(log),
        );
    }
    object.write().expect("it is written to memory")
}

fn read_elf(bytes: &[u8]) {
    if let Ok(image) = Image::of(PathBuf::from("image"), bytes.to_vec()) {
        image.symbols();
        image.find_code([0xB5, 0x80]);
        image.address_of("Reset");
        let _ = Stack::analyse(&image.bytes, &PRIORITIES);
        let _ = image::function_names(&image.bytes);
        // An image that is run is a program that is trusted, so its log's formats are: they are
        // only read here.
        let _ = LogDecoder::new(&image);
    }
}

static DECODER: LazyLock<LogDecoder> = LazyLock::new(|| {
    let image = Image::of(PathBuf::from("image"), image(FORMATS)).expect("it is an image");
    LogDecoder::new(&image).expect("it has a log")
});

fn read_log(bytes: &[u8]) {
    assert!(DECODER.is_readable());
    let mut longest = 0;
    let mut console = bytes;
    DECODER.decode(&mut console, &mut |line| longest = longest.max(line.len()));
    assert!(longest < 1 << 15);
}

/// What lies between zeros, as frames with the encoding of zeros.
fn repair_log(bytes: &mut Vec<u8>) {
    let plain: Vec<&[u8]> = bytes.split(|&byte| byte == 0).collect();
    *bytes = frames(&plain);
}

/// Frames as rzCOBS has them, in pieces of seven bytes of which one is zero.
fn frames(plain: &[&[u8]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for frame in plain {
        for piece in frame.chunks(6) {
            let is_zero = |k: usize| piece.get(k).is_none_or(|&byte| byte == 0);
            let zeros = (0..7)
                .filter(|&k| is_zero(k))
                .fold(0, |zeros, k| zeros | 1 << k);
            bytes.extend(piece.iter().filter(|&&byte| byte != 0));
            bytes.push(zeros);
        }
        bytes.push(0);
    }
    bytes
}
