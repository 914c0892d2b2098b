//! Every `unsafe` in the sources has a reason in front of it, and all of them are in one table.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use tests::golden::check_text;
use tests::root;

const CRATES: [&str; 7] = [
    "benches/c-reference",
    "shared-model",
    "firmware",
    "page",
    "sim-host",
    "tests",
    "xtask",
];
const REASON: &str = "SAFETY:";

/// One use of the word.
#[derive(Debug, PartialEq)]
struct Use {
    /// Line, from 1.
    line: usize,
    /// Kind of the unsafe code.
    kind: &'static str,
    /// Why it is sound; `None` without a comment.
    reason: Option<String>,
}

/// All of a file, macros included; comments and strings are no code.
fn uses(source: &str) -> Vec<Use> {
    let tokens: TokenStream = source.parse().expect("the source is Rust");
    let lines: Vec<&str> = source.lines().collect();
    let mut found = Vec::new();
    collect(tokens, &lines, &mut found);
    found
}

fn collect(tokens: TokenStream, lines: &[&str], found: &mut Vec<Use>) {
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Group(group) => collect(group.stream(), lines, found),
            TokenTree::Ident(word) if word == "unsafe" => {
                let line = word.span().start().line;
                found.push(Use {
                    line,
                    kind: kind(tokens.peek()),
                    reason: reason(lines, line),
                });
            }
            _ => {}
        }
    }
}

fn kind(next: Option<&TokenTree>) -> &'static str {
    match next {
        Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => "block",
        Some(TokenTree::Group(_)) => "attribute",
        Some(TokenTree::Ident(word)) if word == "impl" => "impl",
        Some(TokenTree::Ident(word)) if word == "extern" => "extern",
        Some(TokenTree::Ident(word)) if word == "fn" => "fn",
        other => panic!("unsafe what? {other:?}"),
    }
}

/// The comment in front of the line, attributes and the beginning of its statement skipped.
fn reason(lines: &[&str], line: usize) -> Option<String> {
    let above = lines[..line - 1].iter().rev().map(|line| line.trim());
    let is_skipped = |line: &&str| line.starts_with("#[") || line.ends_with('=');
    let comment: Vec<&str> = above
        .skip_while(is_skipped)
        .map_while(|line| {
            line.strip_prefix("//")
                .filter(|rest| !rest.starts_with(['/', '!']))
        })
        .collect();
    let comment: Vec<&str> = comment.iter().rev().map(|line| line.trim()).collect();
    let (_, reason) = comment
        .join(" ")
        .split_once(REASON)
        .map(|(a, b)| (a.to_owned(), b.trim().to_owned()))?;
    (!reason.is_empty()).then_some(reason)
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder)
        .expect("the folder can be read")
        .flatten()
    {
        let path = entry.path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn every_use_has_a_reason_and_is_in_the_table() {
    let mut files = Vec::new();
    for name in CRATES {
        sources(&root().join(name), &mut files);
    }
    files.sort();
    let mut table = String::new();
    let (mut total, mut missing) = (0, Vec::new());
    for file in files {
        let source = fs::read_to_string(&file).expect("the source can be read");
        let uses = uses(&source);
        if uses.is_empty() {
            continue;
        }
        let file = file.strip_prefix(root()).expect("it is in the workspace");
        let file = file.display().to_string().replace('\\', "/");
        let _ = writeln!(table, "\n{file}: {}", uses.len());
        total += uses.len();
        for found in uses {
            let reason = found.reason.unwrap_or_else(|| {
                missing.push(format!("{file}:{}", found.line));
                String::new()
            });
            let _ = writeln!(table, "  {:9}  {reason}", found.kind);
        }
    }
    assert_eq!(
        missing,
        [] as [&str; 0],
        "no comment `// {REASON} ...` in front"
    );
    let heading = format!(
        "# Every `unsafe` of all crates and why it is sound; shared-model forbids it.\ntotal: {total}\n"
    );
    check_text("unsafe.txt", &(heading + &table));
}

/// The model and the ECU's program have none, and the compiler sees to it.
#[test]
fn the_model_forbids_it() {
    let source = fs::read_to_string(root().join("shared-model/src/lib.rs")).expect("it is there");
    assert!(source.contains("#![forbid(unsafe_code)]"));
}

#[test]
fn uses_are_found_with_their_reasons() {
    let source = r#"
// SAFETY: of two
// lines.
#[inline]
unsafe fn f() {}
// Another comment.
macro_rules! m { () => { unsafe { g() } } }
const TEXT: &str = "unsafe { }"; // unsafe { }
/// SAFETY: a docstring is for callers.
unsafe impl Sync for S {}
fn h() {
    // SAFETY: split.
    let x =
        unsafe { g() };
}
"#;
    let found: Vec<_> = uses(source)
        .into_iter()
        .map(|found| (found.line, found.kind, found.reason))
        .collect();
    let some = |text: &str| Some(text.to_owned());
    assert_eq!(
        found,
        [
            (5, "fn", some("of two lines.")),
            (7, "block", None),
            (10, "impl", None),
            (14, "block", some("split.")),
        ]
    );
}
