//! No two source files of a crate use each other, directly or through others.
//!
//! A file uses another if a path in its code leads to an item that is defined there; re-exports are
//! followed. Declaring a module and re-exporting from it is no use of it. Tests inside the sources
//! do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};

/// A word or sign of the source and its line.
type Lexeme = (String, usize);
/// A module's path from the crate's root.
type ModulePath = Vec<String>;

/// A path in the code.
struct Reference {
    from: ModulePath,
    segments: Vec<String>,
    line: usize,
    is_reexport: bool,
}

/// The item or the module that a path leads to.
enum Target {
    Item(ModulePath),
    Module(ModulePath),
}

/// Files that use each other, and the uses: user, line, used.
struct Circle<'a> {
    files: BTreeSet<&'a Path>,
    uses: Vec<(&'a Path, usize, &'a Path)>,
}

/// A crate's modules and the paths in them.
#[derive(Default)]
struct Crate {
    files: BTreeMap<ModulePath, PathBuf>,
    imports: BTreeMap<(ModulePath, String), Vec<String>>,
    references: Vec<Reference>,
}

impl Crate {
    fn read(root: &Path) -> Self {
        let mut it = Self::default();
        it.read_file(root, root.parent().expect("it is in a folder"), vec![]);
        it
    }

    /// Reads a file whose child modules lie in `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, module: ModulePath) {
        let source = fs::read_to_string(file).expect("the source can be read");
        let tokens: TokenStream = source.parse().expect("the source is Rust");
        let mut lexemes = Vec::new();
        flatten(tokens, &mut lexemes);
        self.files.insert(module.clone(), file.to_owned());
        self.read_module(&lexemes, file, folder, module);
    }

    fn read_module(&mut self, lexemes: &[Lexeme], file: &Path, folder: &Path, module: ModulePath) {
        let is = |at: usize, word: &str| lexemes.get(at).is_some_and(|lexeme| lexeme.0 == word);
        let mut at = 0;
        while let Some((word, line)) = lexemes.get(at) {
            let texts = lexemes[at..].iter().take(7).map(|lexeme| lexeme.0.as_str());
            if texts.eq(["#", "[", "cfg", "(", "test", ")", "]"]) {
                at = end_of_item(lexemes, at + 7);
            } else if word == "#" && is(at + 1, "[") && is(at + 2, "path") {
                // A file of another crate, which is read there.
                at = end_of_item(lexemes, at);
            } else if word == "mod" && (is(at + 2, ";") || is(at + 2, "{")) {
                let name = lexemes[at + 1].0.clone();
                let child = child(&module, &name);
                let inside = folder.join(&name);
                if is(at + 2, ";") {
                    let flat = folder.join(&name).with_extension("rs");
                    let child_file = if flat.is_file() {
                        flat
                    } else {
                        inside.join("mod.rs")
                    };
                    self.read_file(&child_file, &inside, child);
                    at += 3;
                } else {
                    let end = end_of_item(lexemes, at);
                    self.files.insert(child.clone(), file.to_owned());
                    self.read_module(&lexemes[at + 3..end - 1], file, &inside, child);
                    at = end;
                }
            } else if word == "use" {
                let end = end_of_item(lexemes, at);
                let is_reexport = at > 0 && ["pub", ")"].contains(&lexemes[at - 1].0.as_str());
                let mut leaves = Vec::new();
                use_leaves(
                    &mut lexemes[at + 1..end].iter().peekable(),
                    &[],
                    &mut leaves,
                );
                for (segments, name) in leaves {
                    self.imports
                        .insert((module.clone(), name), segments.clone());
                    let from = module.clone();
                    self.references.push(Reference {
                        from,
                        segments,
                        line: *line,
                        is_reexport,
                    });
                }
                at = end;
            } else if is(at + 1, "::") && !(at > 0 && is(at - 1, "::")) {
                let words = lexemes[at..].chunks(2);
                let path = words.take_while(|pair| is_word(&pair[0].0));
                let mut segments = Vec::new();
                for pair in path {
                    segments.push(pair[0].0.clone());
                    if pair.get(1).is_none_or(|sign| sign.0 != "::") {
                        break;
                    }
                }
                at += 2 * segments.len().max(1) - 1;
                let from = module.clone();
                self.references.push(Reference {
                    from,
                    segments,
                    line: *line,
                    is_reexport: false,
                });
            } else {
                at += 1;
            }
        }
    }

    /// Where a path in the module `from` leads; `None` outside the crate.
    fn resolve(&self, from: &[String], segments: &[String], depth: u32) -> Option<Target> {
        let (first, mut rest) = segments.split_first()?;
        let mut module = match first.as_str() {
            "crate" => vec![],
            "self" => from.to_vec(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            _ if self.files.contains_key(&child(from, first)) => child(from, first),
            _ => return self.imported(from, segments, depth),
        };
        while let Some((name, more)) = rest.split_first() {
            if name == "super" {
                module.pop();
            } else if self.files.contains_key(&child(&module, name)) {
                module.push(name.clone());
            } else {
                let imported = self.imported(&module, rest, depth);
                return imported.or(Some(Target::Item(module)));
            }
            rest = more;
        }
        Some(Target::Module(module))
    }

    fn imported(&self, module: &[String], segments: &[String], depth: u32) -> Option<Target> {
        let (name, rest) = segments.split_first()?;
        let import = self.imports.get(&(module.to_vec(), name.clone()))?;
        let is_itself = import.first() == Some(name);
        if depth == 0 || (is_itself && import.len() == 1) {
            return None;
        }
        // A name that an import of the same name begins with is a crate's or a child's, not the
        // import.
        let is_child = self.files.contains_key(&child(module, name));
        if is_itself && !is_child {
            return None;
        }
        self.resolve(module, &[import.as_slice(), rest].concat(), depth - 1)
    }

    /// Each file, the files that it uses, and the line of the first use.
    fn uses(&self) -> BTreeMap<&Path, BTreeMap<&Path, usize>> {
        let mut uses: BTreeMap<&Path, BTreeMap<&Path, usize>> = BTreeMap::new();
        for Reference {
            from,
            segments,
            line,
            is_reexport,
        } in &self.references
        {
            let is_glob = segments.last().is_some_and(|last| last == "*");
            let target = match self.resolve(from, segments, 20) {
                Some(Target::Item(module)) => module,
                Some(Target::Module(module)) if is_glob => module,
                _ => continue,
            };
            let (user, used) = (&self.files[from], &self.files[&target]);
            let is_own_reexport = *is_reexport && target.starts_with(from);
            if user != used && !is_own_reexport {
                uses.entry(user).or_default().entry(used).or_insert(*line);
            }
        }
        uses
    }

    fn circles(&self) -> Vec<Circle<'_>> {
        let uses = self.uses();
        let reached_from = |start| {
            let mut reached = BTreeSet::new();
            let mut open = vec![start];
            while let Some(file) = open.pop() {
                let used = uses.get(file).into_iter().flat_map(BTreeMap::keys);
                open.extend(used.copied().filter(|used| reached.insert(*used)));
            }
            reached
        };
        let reached: BTreeMap<&Path, BTreeSet<&Path>> = uses
            .keys()
            .map(|&file| (file, reached_from(file)))
            .collect();
        let mutual = |file: &Path| {
            let others = reached[file].iter().copied();
            let back = |other: &&Path| reached.get(other).is_some_and(|them| them.contains(file));
            others.filter(back).collect::<BTreeSet<&Path>>()
        };
        let circles: BTreeSet<_> = reached.keys().map(|file| mutual(file)).collect();
        let circles = circles.into_iter().filter(|files| !files.is_empty());
        circles
            .map(|files| {
                let pairs = uses.iter().flat_map(|(&user, used)| {
                    used.iter().map(move |(&used, &line)| (user, line, used))
                });
                let inside =
                    pairs.filter(|(user, _, used)| files.contains(user) && files.contains(used));
                Circle {
                    uses: inside.collect(),
                    files,
                }
            })
            .collect()
    }
}

/// The module `name` in `module`.
fn child(module: &[String], name: &str) -> ModulePath {
    let mut path = module.to_vec();
    path.push(name.to_owned());
    path
}

fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn flatten(tokens: TokenStream, lexemes: &mut Vec<Lexeme>) {
    for token in tokens {
        let line = token.span().start().line;
        match token {
            TokenTree::Group(group) => {
                let signs = match group.delimiter() {
                    proc_macro2::Delimiter::Brace => ("{", "}"),
                    proc_macro2::Delimiter::Bracket => ("[", "]"),
                    _ => ("(", ")"),
                };
                lexemes.push((signs.0.to_owned(), line));
                flatten(group.stream(), lexemes);
                lexemes.push((signs.1.to_owned(), line));
            }
            TokenTree::Punct(sign) => match lexemes.last_mut() {
                Some((last, _)) if last == ":" && sign.as_char() == ':' => last.push(':'),
                _ => lexemes.push((sign.to_string(), line)),
            },
            // As text, so that a string is no word.
            word => lexemes.push((word.to_string(), line)),
        }
    }
}

/// The place after the item that begins at `start`: after its semicolon, or its last brace.
fn end_of_item(lexemes: &[Lexeme], start: usize) -> usize {
    let mut depth = 0;
    let is_use = lexemes.get(start).is_some_and(|lexeme| lexeme.0 == "use");
    for (at, (word, _)) in lexemes.iter().enumerate().skip(start) {
        match word.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 && (word == ";" || (word == "}" && !is_use)) {
            return at + 1;
        }
    }
    lexemes.len()
}

type Lexemes<'a> = std::iter::Peekable<std::slice::Iter<'a, Lexeme>>;

/// The paths of a `use` with the names that they bring.
fn use_leaves(
    lexemes: &mut Lexemes<'_>,
    prefix: &[String],
    leaves: &mut Vec<(Vec<String>, String)>,
) {
    let mut path = prefix.to_vec();
    let mut name = String::new();
    while let Some((word, _)) = lexemes.next() {
        match word.as_str() {
            "::" => {}
            "{" => {
                while lexemes.peek().is_some_and(|next| next.0 != "}") {
                    use_leaves(lexemes, &path, leaves);
                }
                lexemes.next();
                name.clear();
                path.clear();
            }
            "as" => name = lexemes.next().expect("a name follows").0.clone(),
            "," | ";" => break,
            "self" if !path.is_empty() => name = path.last().cloned().unwrap_or_default(),
            segment => {
                path.push(segment.to_owned());
                name = segment.to_owned();
            }
        }
        if lexemes.peek().is_some_and(|next| next.0 == "}") {
            break;
        }
    }
    if !name.is_empty() {
        leaves.push((path, name));
    }
}

fn workspace() -> &'static Path {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().expect("xtask lies in the workspace's root")
}

/// The root files of all crates in `folder`: libraries and programs.
fn roots(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    if folder.join("Cargo.toml").is_file() {
        let programs = fs::read_dir(folder.join("src/bin")).into_iter().flatten();
        let programs = programs.flatten().map(|entry| entry.path());
        found.extend(programs.filter(|path| path.extension().is_some_and(|e| e == "rs")));
        let usual = ["src/lib.rs", "src/main.rs"].map(|file| folder.join(file));
        found.extend(usual.into_iter().filter(|file| file.is_file()));
    }
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && !name.starts_with('.') && !["target", "src"].contains(&name.as_ref()) {
            roots(&path, found);
        }
    }
}

#[test]
fn no_files_use_each_other() {
    let mut files = Vec::new();
    roots(workspace(), &mut files);
    assert!(files.len() > 10, "{files:?}");
    let relative = |file: &Path| {
        let file = file.strip_prefix(workspace());
        file.expect("it is in the workspace").display().to_string()
    };
    let mut report = String::new();
    for root in &files {
        for Circle { uses, .. } in Crate::read(root).circles() {
            report.push('\n');
            for (user, line, used) in uses {
                let _ = writeln!(report, "{}:{line} uses {}", relative(user), relative(used));
            }
        }
    }
    assert!(
        report.is_empty(),
        "files use each other in circles:\n{report}"
    );
}

/// The files of a small crate's circles.
fn circles_of(name: &str, files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    for (file, source) in files {
        let path = folder.join(file);
        fs::create_dir_all(path.parent().expect("it is in a folder")).expect("it can be made");
        fs::write(path, source).expect("it can be written");
    }
    let found = Crate::read(&folder.join("lib.rs"));
    let short = |path: &Path| path.strip_prefix(&folder).unwrap().display().to_string();
    let circles = found.circles().into_iter();
    circles
        .map(|circle| circle.files.into_iter().map(short).collect())
        .collect()
}

#[test]
fn circles_are_found_through_reexports_and_macros() {
    let library = ("lib.rs", "mod a; mod b; mod c; pub use a::A;");
    let with = |a, b, c| circles_of("through", &[library, ("a.rs", a), ("b.rs", b), ("c.rs", c)]);
    let none: [Vec<String>; 0] = [];
    assert_eq!(
        with("pub struct A;", "use crate::A;", "use super::{a::A, b};"),
        none
    );
    assert_eq!(
        with("use crate::b;", "use crate::A;", ""),
        none,
        "a module alone"
    );
    assert_eq!(
        with("fn f() { m!(crate::b::B) }", "use crate::A;", ""),
        [["a.rs", "b.rs"]]
    );
    let (a, b, c) = (
        "use super::c::{self, d as e};",
        "use crate::A;",
        "use super::b::B;",
    );
    assert_eq!(with(a, b, c), [["a.rs", "b.rs", "c.rs"]]);
    let test = "#[cfg(test)] mod tests { use crate::b::B; }";
    assert_eq!(with(test, "use crate::A;", ""), none);
}

#[test]
fn a_child_that_uses_its_parents_items_closes_a_circle() {
    let child = ("p/c.rs", "use super::P; pub struct C;");
    let with = |parent| {
        circles_of(
            "parent",
            &[("lib.rs", "mod p;"), ("p/mod.rs", parent), child],
        )
    };
    let none: [Vec<String>; 0] = [];
    assert_eq!(with("mod c; pub use c::C; struct P;"), none);
    assert_eq!(with("mod c; use c::C; struct P;"), [["p/c.rs", "p/mod.rs"]]);
    assert_eq!(
        with("mod c; struct P; fn f() { c::f() }"),
        [["p/c.rs", "p/mod.rs"]]
    );
}
