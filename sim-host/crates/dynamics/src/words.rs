//! Numbers and nouns in messages.

pub use shared_model::short::Short;
use std::fmt::Display;

/// A number of things: `1 value`, `2 values`.
pub fn counted<N: Display + PartialEq + From<u8>>(number: N, noun: &str) -> String {
    counted_as(number, noun, &format!("{noun}s"))
}

/// A number of things whose name has a plural of its own: `1 equilibrium`, `2 equilibria`.
pub fn counted_as<N: Display + PartialEq + From<u8>>(number: N, one: &str, many: &str) -> String {
    let noun = if number == N::from(1) { one } else { many };
    format!("{number} {noun}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thing_is_singular() {
        let texts = [0_usize, 1, 2].map(|n| counted(n, "value"));
        assert_eq!(texts, ["0 values", "1 value", "2 values"]);
        assert_eq!(counted_as(1_u16, "duty", "duties"), "1 duty");
    }
}
