//! Options of the subcommands that run the emulator.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use image::Image;
use qemu::Machine;
use qemu::session::LinkKind;
use std::path::Path;

/// The machines by name.
pub fn machines() -> impl TypedValueParser<Value = Machine> {
    parser(Machine::ALL, |machine| (machine.name(), machine.core()))
}

/// The links by name.
pub fn link_kinds() -> impl TypedValueParser<Value = LinkKind> {
    parser(LinkKind::ALL, |kind| (kind.name(), kind.description()))
}

/// A parser of the names of `all`, each with its description in the help.
fn parser<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    described: fn(T) -> (&'static str, &'static str),
) -> impl TypedValueParser<Value = T> {
    let values = all.map(|value| {
        let (name, description) = described(value);
        PossibleValue::new(name).help(description)
    });
    PossibleValuesParser::new(values).try_map(move |text| {
        let mut all = all.into_iter();
        all.find(|value| described(*value).0 == text)
            .ok_or("not among the possible values")
    })
}

/// Opens a firmware image.
pub fn open_image(path: &Path) -> anyhow::Result<Image> {
    Image::open(path)
        .map_err(|error| anyhow::anyhow!("{error}; build the image with `cargo xtask firmware`"))
}
