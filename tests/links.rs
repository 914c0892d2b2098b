//! Links between the texts of the repository: the file is there, and so is the heading.

use std::fs;
use tests::{root, tracked};

/// The targets of all links and pictures.
fn links(text: &str) -> Vec<&str> {
    let targets = text.split("](").skip(1);
    let targets = targets.filter_map(|rest| Some(rest.split_once(')')?.0));
    targets
        .filter(|target| !target.contains(char::is_whitespace))
        .collect()
}

/// A heading's anchor, as GitHub and mdBook make it.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = text
        .chars()
        .filter(|&c| c.is_alphanumeric() || " -_".contains(c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn has_heading(text: &str, wanted: &str) -> bool {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings.map(anchor).any(|anchor| anchor == wanted)
}

#[test]
fn every_link_leads_somewhere() {
    let mut broken = Vec::new();
    let mut checked = 0;
    for file in tracked("*.md") {
        let path = root().join(&file);
        // A tracked file may have been removed and not yet committed.
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        for link in links(&text) {
            if link.starts_with("http") {
                continue;
            }
            checked += 1;
            let (name, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = match name {
                "" => path.clone(),
                name => path.with_file_name(name),
            };
            let is_there = target.exists()
                && (heading.is_empty()
                    || fs::read_to_string(&target).is_ok_and(|text| has_heading(&text, heading)));
            if !is_there {
                broken.push(format!("{file}: {link}"));
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
    assert!(checked > 20, "the texts have more links than {checked}");
}

/// A command with `-p PACKAGE --example NAME` finds the example in one of the crates.
#[test]
fn every_example_that_is_named_is_there() {
    let sources = tracked("*/examples/*.rs").join("\n");
    let mut named = 0;
    for file in tracked("*.md") {
        let text = fs::read_to_string(root().join(&file)).unwrap_or_default();
        for rest in text.split("--example ").skip(1) {
            let name = rest.split_whitespace().next().unwrap_or_default();
            let source = format!("/examples/{}.rs", name.trim_matches('`'));
            let is_there = |path: &str| path.ends_with(&source) && root().join(path).is_file();
            assert!(sources.lines().any(is_there), "{file}: --example {name}");
            named += 1;
        }
    }
    assert!(named >= 3, "{named} examples");
}

/// A chapter that is not in the table of contents is not in the book.
#[test]
fn every_chapter_is_in_the_book() {
    let contents = fs::read_to_string(root().join("docs/SUMMARY.md")).expect("it is there");
    let listed = links(&contents);
    for file in tracked("*.md") {
        if let Some(chapter) = file.strip_prefix("docs/")
            && chapter != "SUMMARY.md"
        {
            assert!(listed.contains(&chapter), "docs/SUMMARY.md lacks {chapter}");
        }
    }
}

#[test]
fn anchors_are_those_of_the_headings() {
    let text = "# One\n## Period, bands and `regions`\n";
    assert!(has_heading(text, "period-bands-and-regions"));
    assert!(!has_heading(text, "two"));
    assert_eq!(links("[a](b.md#c) ![d](e.svg)"), ["b.md#c", "e.svg"]);
}
