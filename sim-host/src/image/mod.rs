//! Proofs about the firmware from its image alone: what it needs of a board's memory, and how deep its stack can get.
//!
//! | question | module |
//! |---|---|
//! | how much flash and RAM does it take, and how much is there? | [`memory`] |
//! | which function calls which, with what on the stack? | [`call_graph`] |
//! | is a damaged image read in a time that its length bounds? | `budget` |
//! | what does one instruction do to stack and flow? | [`thumb`] |
//! | how deep can the stack get? | [`stack`] |

mod budget;
pub mod call_graph;
pub mod memory;
pub mod stack;
pub mod thumb;

/// Why an image cannot be analysed.
#[derive(Debug, thiserror::Error)]
pub enum AnalysisError {
    /// The file is no ELF, or damaged.
    #[error("the image cannot be read: {0}")]
    Elf(#[from] object::Error),
    /// A symbol of the linker script is missing.
    #[error("the image has no symbol {0}")]
    NoSymbol(&'static str),
    /// A section is missing.
    #[error("the image has no section {0}")]
    NoSection(&'static str),
    /// The compiler was not asked for the functions' frames.
    #[error(
        "the image has no section .stack_sizes; `cargo xtask proofs` builds one with -Zemit-stack-sizes"
    )]
    NoStackSizes,
    /// Names or functions lie over each other, so that reading them takes far longer than the file is.
    #[error(
        "the image's {0} overlap, so that they are many times as long as the file; it is damaged"
    )]
    Overlap(&'static str),
    /// A symbol or a section lies beyond the addresses of 32 bits.
    #[error("the image has {0:#x} as an address, which has more than 32 bits")]
    Address(u64),
    /// The section with the functions' frames breaks off.
    #[error("the section .stack_sizes is damaged")]
    StackSizes,
}

pub(crate) use budget::parse;

/// Names of all functions in an image, without the compiler's hashes.
///
/// # Errors
/// If it is no ELF, or damaged.
pub fn function_names(bytes: &[u8]) -> Result<Vec<String>, AnalysisError> {
    let file = budget::parse(bytes)?;
    let functions = call_graph::named(&file)?.into_values();
    Ok(functions.flat_map(|function| function.names).collect())
}
