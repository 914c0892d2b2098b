//! The firmware's image: machine, size and symbols.

use crate::budget;
use files::input::{self, IMAGE_BYTES};
use object::read::elf::ProgramHeader;
use object::{Architecture, Object, ObjectSection, ObjectSymbol, SectionFlags, elf};
use std::path::{Path, PathBuf};

/// First data address of every Cortex-M.
const RAM_START: u64 = 0x2000_0000;

/// A valid firmware image.
#[derive(Debug, Clone)]
pub struct Image {
    /// Its path.
    pub path: PathBuf,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Flash size, bytes: code, constants and the start values of variables.
    pub flash_bytes: u64,
    /// RAM size of its static variables, bytes, without the stack.
    pub ram_bytes: u64,
    /// Name and version of the compiler; empty if unknown.
    pub compiler: String,
}

/// An error of reading an image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("cannot read the firmware image {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not an ELF file.
    #[error("{path} is not an ELF file: {reason}")]
    NotElf {
        /// The file.
        path: PathBuf,
        /// The error.
        reason: String,
    },
    /// It is for another machine.
    #[error("{path} is an image for {found}, not for a 32-bit Arm Cortex-M")]
    OtherMachine {
        /// The file.
        path: PathBuf,
        /// Its machine.
        found: String,
    },
}

impl Image {
    /// Reads and checks an image.
    ///
    /// # Errors
    /// If the file cannot be read or is not an ELF file for 32-bit Arm.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let path = path.to_path_buf();
        let is_elf = |start: &[u8]| start.starts_with(&elf::ELFMAG);
        let bytes =
            input::read(&path, IMAGE_BYTES, is_elf).map_err(|source| ImageError::Unreadable {
                path: path.clone(),
                source,
            })?;
        Self::of(path, bytes)
    }

    /// Checks the bytes of an image, which are those of the file `path`.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn of(path: PathBuf, bytes: Vec<u8>) -> Result<Self, ImageError> {
        let file = budget::parse(&bytes).map_err(|error| ImageError::NotElf {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        if file.architecture() != Architecture::Arm {
            return Err(ImageError::OtherMachine {
                path,
                found: format!("{:?}", file.architecture()),
            });
        }
        let (flash_bytes, ram_bytes) = sizes(&file);
        let compiler = compiler(&file);
        Ok(Self {
            path,
            compiler,
            flash_bytes,
            ram_bytes,
            bytes,
        })
    }

    /// Address of the function or variable with the given linker name; `None` if the image has
    /// none.
    pub fn address_of(&self, name: &str) -> Option<u32> {
        let file = object::File::parse(&*self.bytes).ok()?;
        let symbol = file.symbols().find(|s| s.name() == Ok(name))?;
        // The lowest bit of a function's symbol marks Thumb code and is not part of the address.
        let thumb = u64::from(symbol.kind() == object::SymbolKind::Text);
        u32::try_from(symbol.address() & !thumb).ok()
    }

    /// Place of a section's content in the file's bytes; `None` if the image has no such section,
    /// or it has no content.
    pub fn place_of(&self, section: &str) -> Option<std::ops::Range<usize>> {
        let file = object::File::parse(&*self.bytes).ok()?;
        let (start, length) = file.section_by_name(section)?.file_range()?;
        let start = usize::try_from(start).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        (end <= self.bytes.len()).then_some(start..end)
    }

    /// Content of the flash: for each part that is loaded, its first address and its bytes, in the
    /// order of addresses.
    pub fn flash(&self) -> Vec<(u32, &[u8])> {
        let Ok(object::File::Elf32(file)) = object::File::parse(&*self.bytes) else {
            return Vec::new();
        };
        let endian = file.endian();
        let mut parts: Vec<(u32, &[u8])> = file
            .elf_program_headers()
            .iter()
            .filter(|header| header.p_type(endian) == elf::PT_LOAD)
            .filter_map(|header| {
                let bytes = header.data(endian, &*self.bytes).ok()?;
                Some((header.p_paddr(endian), bytes))
            })
            .filter(|(_, bytes)| !bytes.is_empty())
            .collect();
        parts.sort_by_key(|(address, _)| *address);
        parts
    }

    /// All functions and variables.
    pub fn symbols(&self) -> Vec<Symbol> {
        let Ok(file) = object::File::parse(&*self.bytes) else {
            return Vec::new();
        };
        let mut symbols: Vec<Symbol> = file
            .symbols()
            .filter(|symbol| symbol.size() > 0)
            .filter_map(|symbol| {
                let is_code = symbol.kind() == object::SymbolKind::Text;
                Some(Symbol {
                    name: symbol.name().ok()?.to_owned(),
                    address: u32::try_from(symbol.address() & !u64::from(is_code)).ok()?,
                    size: u32::try_from(symbol.size()).ok()?,
                    is_code,
                })
            })
            .collect();
        symbols.sort_by_key(|symbol| (symbol.address, symbol.size));
        symbols
    }

    /// Address of the first occurrence of this halfword in the code, low byte first.
    pub fn find_code(&self, halfword: [u8; 2]) -> Option<u32> {
        let file = object::File::parse(&*self.bytes).ok()?;
        let section = file.section_by_name(".text")?;
        let index = section
            .data()
            .ok()?
            .chunks_exact(2)
            .position(|pair| pair == halfword)?;
        u32::try_from(section.address() + 2 * index as u64).ok()
    }
}

/// A function or a variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Symbol {
    /// The linker's name.
    pub name: String,
    /// First address.
    pub address: u32,
    /// Bytes.
    pub size: u32,
    /// A function.
    pub is_code: bool,
}

/// The compiler's line among the lines of all tools.
fn compiler(file: &object::File<'_>) -> String {
    let section = file.section_by_name(".comment");
    let bytes = section
        .and_then(|section| section.data().ok())
        .unwrap_or_default();
    let mut lines = bytes.split(|&byte| byte == 0).map(String::from_utf8_lossy);
    let compiler = lines.find(|line| line.starts_with("rustc"));
    compiler.map(String::from).unwrap_or_default()
}

fn sizes(file: &object::File<'_>) -> (u64, u64) {
    let (mut flash, mut ram) = (0, 0);
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else {
            continue;
        };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        let in_ram = section.address() >= RAM_START;
        let stored = section.file_range().is_some();
        if in_ram {
            ram = section.size().saturating_add(ram);
        }
        if stored {
            flash = section.size().saturating_add(flash);
        }
    }
    (flash, ram)
}
