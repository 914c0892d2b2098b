//! Arithmetics for analysis: the model evaluated in something else than plain numbers.

pub mod dual;
pub mod reference;
pub mod rounding;
