//! Enumerations with the list of their variants and a name for each, both from one declaration.

/// Declares an enumeration without fields, with the constant `ALL`, which lists its variants in
/// their order, and, where every variant is followed by `=> "name"`, the method `name`.
///
/// ```
/// shared_model::listed! {
///     /// A colour.
///     #[derive(Debug, Clone, Copy, PartialEq)]
///     pub enum Colour {
///         /// Red.
///         Red = 4 => "red",
///         /// Blue.
///         Blue = 7 => "blue",
///     }
/// }
/// assert_eq!(Colour::ALL, [Colour::Red, Colour::Blue]);
/// assert_eq!(Colour::Blue.name(), "blue");
/// ```
#[macro_export]
macro_rules! listed {
    (
        $(#[$about:meta])*
        $vis:vis enum $Enum:ident {
            $($(#[$about_variant:meta])* $Variant:ident $(= $code:literal)? => $name:literal,)+
        }
    ) => {
        $crate::listed! {
            $(#[$about])*
            $vis enum $Enum {
                $($(#[$about_variant])* $Variant $(= $code)?,)+
            }
        }

        impl $Enum {
            /// Its name, for reports and files.
            $vis const fn name(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)+
                }
            }
        }
    };
    (
        $(#[$about:meta])*
        $vis:vis enum $Enum:ident {
            $($(#[$about_variant:meta])* $Variant:ident $(= $code:literal)?,)+
        }
    ) => {
        $(#[$about])*
        $vis enum $Enum {
            $($(#[$about_variant])* $Variant $(= $code)?,)+
        }

        impl $Enum {
            /// All variants, in the order of their declaration.
            $vis const ALL: [Self; [$(Self::$Variant),+].len()] = [$(Self::$Variant),+];
        }
    };
}
