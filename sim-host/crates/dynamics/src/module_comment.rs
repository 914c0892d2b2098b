//! Comments of generated Rust source.

/// Most columns of a line, as rustfmt is set up.
const COLUMNS: usize = 100;

/// A text in lines of a module's comment.
pub(crate) fn module_comment(text: &str) -> String {
    let mut lines = String::new();
    let mut line = String::from("//!");
    for word in text.split(' ') {
        if line.len() + 1 + word.len() > COLUMNS {
            lines += &line;
            lines.push('\n');
            line = String::from("//!");
        }
        line.push(' ');
        line += word;
    }
    lines + &line + "\n"
}
