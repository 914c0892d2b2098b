//! Plain words in texts, comments and messages: phrases that are not used, and what to write
//! instead.
//!
//! A phrase is listed only if it is never right. Texts are searched for all of them, Rust sources
//! outside the folders that the rule still exempts.

use std::fs;
use std::path::Path;
use tests::{root, tracked};

/// A group of phrases.
struct Rule {
    /// Whole words, in lower case.
    phrases: &'static [&'static str],
    /// The replacement.
    instead: &'static str,
    /// Folders whose Rust sources still have them. Remove a folder when it is clean.
    exempt: &'static [&'static str],
}

const RULES: &[Rule] = &[
    Rule {
        phrases: &[
            "behind the transient",
            "behind the transients",
            "behind its transient",
            "behind their transients",
        ],
        instead: "after the transient",
        exempt: &["sim-host/crates/dynamics", "sim-host/src/verify"],
    },
    Rule {
        phrases: &["goes on", "go on", "gone on", "went on"],
        instead: "continues",
        exempt: &["sim-host/crates/engine", "sim-host/src/reproduce"],
    },
    Rule {
        phrases: &["so many"],
        instead: "the number of",
        exempt: &["sim-host/crates/dynamics", "sim-host/src/reproduce"],
    },
    Rule {
        phrases: &["as far as"],
        instead: "up to",
        exempt: &["sim-host/crates/engine", "sim-host/crates/plot"],
    },
    Rule {
        phrases: &["of its own", "of their own"],
        instead: "its own, separate",
        exempt: &[
            "firmware",
            "fuzz",
            "shared-model",
            "sim-host/crates/dynamics",
            "sim-host/crates/engine",
            "sim-host/crates/plot",
            "tests",
            "xtask",
        ],
    },
    Rule {
        phrases: &["nobody", "somebody", "anybody"],
        instead: "the program or the person that is meant, or the passive",
        exempt: &["sim-host/crates/dynamics"],
    },
    Rule {
        phrases: &["is told", "are told", "be told", "told apart", "told from"],
        instead: "is reported, is distinguished",
        exempt: &["sim-host/crates/dynamics"],
    },
    Rule {
        phrases: &["it is said", "is said"],
        instead: "is reported",
        exempt: &[],
    },
    Rule {
        phrases: &["knows no"],
        instead: "is independent of, does not contain",
        exempt: &[],
    },
    Rule {
        phrases: &[
            "instructions a second",
            "steps a second",
            "times a second",
            "instructions a step",
            "samples a period",
            "db a decade",
        ],
        instead: "per second, per step, per period, per decade",
        exempt: &[],
    },
    Rule {
        phrases: &["kind of motion", "kinds of motion"],
        instead: "regime",
        exempt: &[
            "sim-host/crates/dynamics",
            "sim-host/src/cli",
            "sim-host/src/reproduce",
        ],
    },
    Rule {
        phrases: &["not looked at"],
        instead: "discarded, not examined",
        exempt: &["sim-host/crates/dynamics", "sim-host/src/reproduce"],
    },
    Rule {
        phrases: &["what of"],
        instead: "which part of, the part of ... that",
        exempt: &["sim-host/crates/dynamics", "sim-host/src/reproduce"],
    },
    Rule {
        phrases: &["became of", "came of"],
        instead: "the outcome of, the result of",
        exempt: &[],
    },
    Rule {
        phrases: &["clean twin"],
        instead: "fault-free run",
        exempt: &[],
    },
    Rule {
        phrases: &["heedless"],
        instead: "that ignores the demand",
        exempt: &[],
    },
    Rule {
        phrases: &["aboard", "boarding"],
        instead: "active, scheduling",
        exempt: &["sim-host/crates/engine"],
    },
    Rule {
        phrases: &["unfound"],
        instead: "undetected",
        exempt: &[],
    },
    Rule {
        phrases: &["hostile bytes"],
        instead: "arbitrary input",
        exempt: &["fuzz", "xtask"],
    },
    Rule {
        phrases: &["check sum", "check sums"],
        instead: "checksum",
        exempt: &[
            "fuzz",
            "sim-host/crates/dynamics",
            "sim-host/src/reproduce",
            "sim-host/tests",
        ],
    },
    Rule {
        phrases: &["anew"],
        instead: "again",
        exempt: &[
            "sim-host/crates/dynamics",
            "sim-host/src/reproduce",
            "tests",
        ],
    },
    Rule {
        phrases: &["therein"],
        instead: "in it, then by",
        exempt: &["sim-host/crates/dynamics"],
    },
    Rule {
        phrases: &["till"],
        instead: "until",
        exempt: &["tests"],
    },
    Rule {
        phrases: &["unasked"],
        instead: "unless requested",
        exempt: &[],
    },
];

/// This file, which quotes the phrases.
const OWN: &str = "tests/words.rs";
/// Stands for code, between two pieces of prose.
const CODE: char = ';';

/// A word and its line, from 1; an empty word ends a phrase.
type Word = (String, usize);

/// The prose of a Rust source, at its lines: comments and strings; code is replaced by [`CODE`].
fn prose_of_rust(source: &str) -> String {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or_default();
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut prose = String::new();
    let mut i = 0;
    while i < chars.len() {
        // A raw string's beginning, `r`, hashes and a quotation mark.
        let raw = at(i) == 'r' && (i == 0 || !is_name(at(i - 1)) || at(i - 1) == 'b');
        let hashes = chars[i + 1..].iter().take_while(|&&c| c == '#').count();
        match at(i) {
            '/' if at(i + 1) == '/' => {
                while matches!(at(i), '/' | '!') {
                    i += 1;
                }
                while i < chars.len() && at(i) != '\n' {
                    prose.push(at(i));
                    i += 1;
                }
            }
            'r' if raw && at(i + 1 + hashes) == '"' => {
                let mut end = vec!['"'];
                end.resize(1 + hashes, '#');
                prose.push(CODE);
                i += 2 + hashes;
                while i < chars.len() && !chars[i..].starts_with(&end) {
                    prose.push(at(i));
                    i += 1;
                }
                prose.push(CODE);
                i += end.len();
            }
            '"' => {
                prose.push(CODE);
                i += 1;
                while i < chars.len() && at(i) != '"' {
                    // At a line's end a backslash joins two lines; an escaped character is none of
                    // prose.
                    if at(i) == '\\' {
                        i += 1;
                        prose.push(if at(i) == '\n' { '\n' } else { ' ' });
                    } else {
                        prose.push(at(i));
                    }
                    i += 1;
                }
                prose.push(CODE);
                i += 1;
            }
            // A character; any other apostrophe is that of a lifetime.
            '\'' if at(i + 1) == '\\' => {
                i += 3;
                while i < chars.len() && at(i) != '\'' {
                    i += 1;
                }
                i += 1;
            }
            '\'' if at(i + 2) == '\'' => i += 3,
            c => {
                prose.push(if c.is_whitespace() { c } else { CODE });
                i += 1;
            }
        }
    }
    prose
}

/// The prose of a Markdown text, at its lines: without blocks of code.
fn prose_of_markdown(text: &str) -> String {
    let mut fenced = false;
    let lines = text.lines().map(|line| {
        let is_fence = line.trim_start().starts_with("```");
        fenced ^= is_fence;
        if fenced || is_fence { ";" } else { line }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Words in lower case; punctuation and code in backquotes separate phrases, ends of lines do not.
fn words(prose: &str) -> Vec<Word> {
    let mut words = Vec::new();
    for (line, text) in prose.lines().enumerate() {
        for (index, part) in text.split('`').enumerate() {
            if index > 0 {
                words.push((String::new(), line + 1));
            }
            if index % 2 == 1 {
                continue;
            }
            let part = part.to_lowercase();
            for word in part.split_whitespace() {
                let is_separator = |c: char| !c.is_alphanumeric() && c != '\'';
                for piece in word.split(is_separator) {
                    words.push((piece.to_owned(), line + 1));
                }
            }
        }
    }
    words
}

/// The line of each phrase among the words.
fn lines_with(phrase: &str, words: &[Word]) -> Vec<usize> {
    let phrase: Vec<&str> = phrase.split(' ').collect();
    let windows = words.windows(phrase.len());
    let found = windows.filter(|window| window.iter().map(|(word, _)| word).eq(&phrase));
    found.map(|window| window[0].1).collect()
}

/// All Markdown and Rust files that git tracks.
fn files() -> Vec<String> {
    let files = [tracked("*.md"), tracked("*.rs")].concat();
    assert!(files.len() > 100, "the checkout has more files");
    files
}

#[test]
fn only_plain_words_are_used() {
    let mut found = Vec::new();
    for file in files() {
        // A tracked file may have been removed and not yet committed.
        let Ok(text) = fs::read_to_string(root().join(&file)) else {
            continue;
        };
        let is_rust = file.ends_with(".rs");
        let prose = if is_rust {
            prose_of_rust(&text)
        } else {
            prose_of_markdown(&text)
        };
        let words = words(&prose);
        for rule in RULES {
            let is_exempt = rule
                .exempt
                .iter()
                .any(|folder| Path::new(&file).starts_with(folder));
            if file == OWN || is_rust && is_exempt {
                continue;
            }
            for phrase in rule.phrases {
                for line in lines_with(phrase, &words) {
                    let instead = rule.instead;
                    found.push(format!("{file}:{line}: \"{phrase}\": write \"{instead}\""));
                }
            }
        }
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn comments_and_strings_are_prose() {
    let source = r###"
fn till<'a>(goes: &'a str) -> char { let on = '"'; '\'' } // It goes
    /// on; and `goes on` is code.
const TEXT: &str = "it GOES \
    on\n";
const RAW: &str = r#"goes "on" goes on"#;
let goes = on;
"###;
    let words = words(&prose_of_rust(source));
    assert_eq!(lines_with("goes on", &words), [2, 4, 6]);
    assert_eq!(lines_with("till", &words), [0; 0]);
}

#[test]
fn blocks_of_code_are_no_prose() {
    let text = "It goes\non. So it goes. On.\n```\ngoes on\n```\nongoes on, `goes on`\n";
    let words = words(&prose_of_markdown(text));
    assert_eq!(lines_with("goes on", &words), [1]);
}
