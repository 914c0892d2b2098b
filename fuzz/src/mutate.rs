//! Mutations at random, from a seed: the same in every run and on every machine.

use crate::target::Target;
use fastrand::Rng;

/// Numbers at which counters and lengths break.
const NUMBERS: [u64; 12] = [
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFF_FFFF,
    0x8000_0000,
    0xFFFF_FFFF,
    0x7FFF_FFFF_FFFF_FFFF,
    u64::MAX,
];
/// Words at which readers of text break.
const WORDS: [&str; 16] = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "1e308",
    "1e-320",
    "9223372036854775807",
    "1e999",
    "[]",
    "{}",
    "\"\"",
    "[[",
    "\n",
    "=",
    "\u{10FFFF}",
];

/// Changes the input in one to four ways, puts in a part of `other`, and most times makes check
/// sums right again.
pub fn mutate(target: &Target, rng: &mut Rng, input: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..rng.u32(1..=4) {
        once(rng, input, other);
    }
    if rng.u8(..) < 200 {
        (target.repair)(input);
    }
}

fn once(rng: &mut Rng, input: &mut Vec<u8>, other: &[u8]) {
    if input.is_empty() {
        input.extend_from_slice(other);
        return;
    }
    let at = rng.usize(..input.len());
    let length = rng.usize(..=(input.len() - at).min(64));
    match rng.u8(..9) {
        0 => input[at] ^= 1 << rng.u8(..8),
        1 => input[at] = rng.u8(..),
        2 => {
            let number = rng.choice(NUMBERS).unwrap_or(0).to_le_bytes();
            let width = rng.choice([1, 2, 4, 8]).unwrap_or(1).min(input.len() - at);
            input[at..at + width].copy_from_slice(&number[..width]);
        }
        3 => drop(input.drain(at..at + length)),
        4 => {
            let again = input[at..at + length].to_vec();
            input.splice(at..at, again);
        }
        5 => input.truncate(at),
        6 if !other.is_empty() => {
            let from = rng.usize(..other.len());
            let piece = &other[from..(from + 64).min(other.len())];
            input.splice(at..at + length, piece.iter().copied());
        }
        7 => replace_number(rng, input, at),
        _ => {
            let word = rng.choice(WORDS).unwrap_or("");
            input.splice(at..at + length.min(8), word.bytes());
        }
    }
}

/// Puts another number, or a word, in the place of the next one in a text.
fn replace_number(rng: &mut Rng, input: &mut Vec<u8>, at: usize) {
    let is_digit = |byte: &u8| byte.is_ascii_digit() || b".-e".contains(byte);
    let Some(start) = input[at..].iter().position(u8::is_ascii_digit) else {
        return;
    };
    let start = at + start;
    let end = input[start..].iter().position(|byte| !is_digit(byte));
    let end = end.map_or(input.len(), |length| start + length);
    let number = match rng.bool() {
        true => rng.choice(NUMBERS).unwrap_or(0).to_string(),
        false => rng.choice(WORDS).unwrap_or("0").to_owned(),
    };
    input.splice(start..end, number.bytes());
}
