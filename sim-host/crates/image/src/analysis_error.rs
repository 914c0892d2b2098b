//! Errors of the analysis of an image.

/// An error of the analysis of an image.
#[derive(Debug, thiserror::Error)]
pub enum AnalysisError {
    /// The file is not an ELF file, or is damaged.
    #[error("the image cannot be read: {0}")]
    Elf(#[from] object::Error),
    /// A symbol of the linker script is missing.
    #[error("the image has no symbol {0}")]
    NoSymbol(&'static str),
    /// A section is missing.
    #[error("the image has no section {0}")]
    NoSection(&'static str),
    /// The image was compiled without stack sizes.
    #[error("the image has no section .stack_sizes; compile it with -Zemit-stack-sizes")]
    NoStackSizes,
    /// Names or functions lie over each other, so that reading them takes far longer than the file
    /// is.
    #[error(
        "the image's {0} overlap, so that they are many times as long as the file; it is damaged"
    )]
    Overlap(&'static str),
    /// A symbol or a section lies beyond the addresses of 32 bits.
    #[error("the image has {0:#x} as an address, which has more than 32 bits")]
    Address(u64),
    /// The section with the stack sizes is truncated.
    #[error("the section .stack_sizes is damaged")]
    StackSizes,
}
