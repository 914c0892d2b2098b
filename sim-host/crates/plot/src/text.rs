//! Text helpers that the figures, the page and the terminal share.

use crate::number::four_digits;
use crate::verdict::{Check, Status, Verdict};

/// The run that a check is about: the part of its id after the first `/`; `General` without one.
pub fn run_of(check: &Check) -> &str {
    check.id.split_once('/').map_or("General", |(_, run)| run)
}

/// The checks of each run; runs and checks in order of first appearance.
pub fn by_run(verdict: &Verdict) -> Vec<(&str, Vec<&Check>)> {
    let mut groups: Vec<(&str, Vec<&Check>)> = Vec::new();
    for check in &verdict.checks {
        let run = run_of(check);
        match groups.iter_mut().find(|(name, _)| *name == run) {
            Some((_, checks)) => checks.push(check),
            None => groups.push((run, vec![check])),
        }
    }
    groups
}

/// The measured figure with its unit; a dash where there is none.
pub fn measured(check: &Check) -> String {
    check.measured.map_or("\u{2013}".into(), |value| {
        with_unit(&four_digits(value), check)
    })
}

/// The limit with its unit; a dash where there is none.
pub fn limit(check: &Check) -> String {
    if check.limit.is_empty() {
        return "\u{2013}".into();
    }
    with_unit(&check.limit, check)
}

fn with_unit(text: &str, check: &Check) -> String {
    if check.unit.is_empty() {
        return text.into();
    }
    format!("{text} {}", check.unit)
}

/// Name of a status for people.
pub(crate) fn status_word(status: Status) -> &'static str {
    match status {
        Status::Passed => "passed",
        Status::Failed => "failed",
        Status::Untested => "untested",
    }
}

/// `12 passed, 1 failed, 0 untested`.
pub fn counts(verdict: &Verdict) -> String {
    [Status::Passed, Status::Failed, Status::Untested]
        .map(|status| format!("{} {}", verdict.count(status), status_word(status)))
        .join(", ")
}

/// The text in lines of at most `width` characters, broken at spaces; only a longer word is cut.
pub fn wrap(text: &str, width: usize) -> Vec<String> {
    let width = width.max(1);
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut rest: Vec<char> = word.chars().collect();
        while !rest.is_empty() {
            let line = lines.last_mut().expect("never empty");
            let used = line.chars().count();
            let gap = usize::from(used > 0);
            if used + gap + rest.len() <= width {
                line.extend(std::iter::repeat_n(' ', gap).chain(rest.drain(..)));
            } else if used > 0 {
                lines.push(String::new());
            } else {
                line.extend(rest.drain(..width));
                if !rest.is_empty() {
                    lines.push(String::new());
                }
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_at_spaces_and_cuts_only_long_words() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefgh ij", 3), ["abc", "def", "gh", "ij"]);
        assert_eq!(wrap("", 3), [""]);
    }

    #[test]
    fn checks_are_grouped_by_run_in_order() {
        let check = |id: &str| Check::equals(id, "title", 0.0, 0.0);
        let verdict = Verdict::over(vec![
            check("bits/a"),
            check("bits/b"),
            check("step/a"),
            check("link"),
        ]);
        let groups: Vec<_> = by_run(&verdict)
            .into_iter()
            .map(|(run, checks)| (run, checks.len()))
            .collect();
        assert_eq!(groups, [("a", 2), ("b", 1), ("General", 1)]);
    }
}
