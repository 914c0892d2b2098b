//! Each safety requirement of docs/safety.md has a test with its number in the name, and each such
//! number is that of a requirement.

use std::collections::BTreeSet;
use std::fs;
use tests::{root, tracked};

/// Number of a requirement's row in the table, `| SR07 | ...`.
fn row(line: &str) -> Option<&str> {
    let (id, _) = line.strip_prefix("| ")?.split_once(" |")?;
    let number = id.strip_prefix("SR")?;
    is_number(number).then_some(number)
}

/// Numbers in the name of a test, `fn sr05_sr06_...`.
fn numbers(line: &str) -> Vec<&str> {
    let name = line.trim_start().strip_prefix("fn ");
    let parts = name.into_iter().flat_map(|name| name.split('_'));
    let numbers = parts.map_while(|part| part.strip_prefix("sr").filter(|rest| is_number(rest)));
    numbers.collect()
}

fn is_number(text: &str) -> bool {
    text.len() == 2 && text.chars().all(|c| c.is_ascii_digit())
}

#[test]
fn every_requirement_has_a_test() {
    let page = fs::read_to_string(root().join("docs/safety.md")).expect("the page is there");
    let required: BTreeSet<&str> = page.lines().filter_map(row).collect();
    assert!(required.len() > 15, "{required:?}");
    let texts: Vec<String> = tracked("*.rs")
        .iter()
        // A tracked file may have been removed and not yet committed.
        .filter_map(|name| fs::read_to_string(root().join(name)).ok())
        .collect();
    let tested: BTreeSet<&str> = texts
        .iter()
        .flat_map(|text| text.lines())
        .flat_map(numbers)
        .collect();
    assert_eq!(required, tested, "required (left) and tested (right)");
}

#[test]
fn rows_and_names_are_recognised() {
    assert_eq!(row("| SR07 | An impossible value | "), Some("07"));
    for other in [
        "SR07",
        "| SR7 | a",
        "| SR07a | a",
        "| id | requirement |",
        "| 07 | a |",
    ] {
        assert_eq!(row(other), None, "{other}");
    }
    assert_eq!(numbers("    fn sr05_sr06_pin() {"), ["05", "06"]);
    assert_eq!(numbers("fn pin_sr05() {"), [""; 0]);
    assert_eq!(numbers("fn sr5_pin() {"), [""; 0]);
}
