//! A matrix of outcomes for a page: rows by columns, each cell with a mark, a short text and a
//! link.

use crate::verdict::Status;
use maud::{Markup, html};

/// An outcome as a symbol and a word, with a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    /// Class of the page's style, which gives the colour.
    pub class: &'static str,
    /// The symbol.
    pub symbol: &'static str,
    /// The word.
    pub word: &'static str,
}

impl Mark {
    /// Passed.
    pub const PASSED: Self = Self {
        class: "passed",
        symbol: "\u{2713}",
        word: "passed",
    };
    /// Failed.
    pub const FAILED: Self = Self {
        class: "failed",
        symbol: "\u{2717}",
        word: "failed",
    };
    /// True in part.
    pub const IN_PART: Self = Self {
        class: "in-part",
        symbol: "\u{25d0}",
        word: "in part",
    };
    /// Untested.
    pub const UNTESTED: Self = Self {
        class: "untested",
        symbol: "?",
        word: "untested",
    };

    /// The mark of a check's status.
    pub fn of(status: Status) -> Self {
        match status {
            Status::Passed => Self::PASSED,
            Status::Failed => Self::FAILED,
            Status::Untested => Self::UNTESTED,
        }
    }

    /// The same outcome with another word.
    #[must_use]
    pub const fn worded(self, word: &'static str) -> Self {
        Self { word, ..self }
    }

    /// The mark beside other text.
    pub fn badge(self) -> Markup {
        html! { span class={ "status " (self.class) } { (self.symbol) " " (self.word) } }
    }
}

/// A cell.
#[derive(Debug, Clone)]
pub struct Cell {
    /// The outcome.
    pub mark: Mark,
    /// A figure instead of the mark's word, which then is the beginning of the tooltip; may be
    /// empty.
    pub text: String,
    /// Tooltip.
    pub title: String,
    /// Id of the element with the details.
    pub target: String,
}

/// A row.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its name.
    pub title: String,
    /// Id of the element with the details, if there is one.
    pub target: Option<String>,
    /// A cell for each column; none where the column does not apply.
    pub cells: Vec<Option<Cell>>,
}

/// A column.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name.
    pub title: String,
    /// Tooltip; may be empty.
    pub explanation: String,
}

/// Rows by columns.
#[derive(Debug, Clone)]
pub struct Matrix {
    /// Name of the rows.
    pub corner: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Row>,
}

/// With more columns than this, a narrow screen shows only the symbols.
const WIDE: usize = 4;

impl Matrix {
    /// The matrix as a table.
    ///
    /// ```
    /// use plot::matrix::{Cell, Column, Mark, Matrix, Row};
    /// let cell = Cell { mark: Mark::PASSED, text: "0.98".into(), title: "defect over its bound".into(), target: "defect".into() };
    /// let matrix = Matrix {
    ///     corner: "run".into(),
    ///     columns: vec![Column { title: "one step".into(), explanation: String::new() }],
    ///     rows: vec![Row { title: "1750 rpm".into(), target: None, cells: vec![Some(cell)] }],
    /// };
    /// let page = matrix.markup().into_string();
    /// assert!(page.contains("href=\"#defect\"") && page.contains("title=\"passed: defect over its bound\""));
    /// ```
    pub fn markup(&self) -> Markup {
        let class = if self.columns.len() > WIDE {
            "matrix many"
        } else {
            "matrix"
        };
        html! {
            table class=(class) {
                thead {
                    tr {
                        th scope="col" { (self.corner) }
                        @for column in &self.columns {
                            th scope="col" title=[shown(&column.explanation)] { span { (column.title) } }
                        }
                    }
                }
                tbody {
                    @for row in &self.rows {
                        tr {
                            th scope="row" {
                                @match &row.target {
                                    Some(target) => a href={ "#" (target) } { (row.title) },
                                    None => (row.title),
                                }
                            }
                            @for cell in &row.cells {
                                @match cell {
                                    Some(cell) => (cell.markup()),
                                    None => td.none { "\u{2013}" },
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

impl Cell {
    fn markup(&self) -> Markup {
        let Mark {
            class,
            symbol,
            word,
        } = self.mark;
        let text = shown(&self.text);
        let title = [word, &self.title].map(shown).into_iter().flatten();
        let title = title.collect::<Vec<_>>().join(": ");
        html! {
            td class=(class) {
                a href={ "#" (self.target) } title=(title) {
                    span.symbol { (symbol) }
                    @match text {
                        Some(text) => {
                            span.unseen { " " (word) }
                            span.word { " " (text) }
                        },
                        None => span.word { " " (word) },
                    }
                }
            }
        }
    }
}

fn shown(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_its_word_or_names_it_for_a_screen_reader() {
        let cell = |text: &str| Cell {
            mark: Mark::FAILED,
            text: text.into(),
            title: String::new(),
            target: "a/b".into(),
        };
        let page = cell("").markup().into_string();
        assert!(page.contains("<span class=\"word\"> failed</span>"));
        let page = cell("3 < 4").markup().into_string();
        assert!(page.contains("<span class=\"unseen\"> failed</span>"));
        assert!(page.contains("title=\"failed\"") && page.contains("3 &lt; 4"));
    }

    #[test]
    fn a_cell_that_does_not_apply_has_no_mark() {
        let matrix = Matrix {
            corner: "run".into(),
            columns: vec![Column {
                title: "bits".into(),
                explanation: String::new(),
            }],
            rows: vec![Row {
                title: "1750 rpm".into(),
                target: Some("run".into()),
                cells: vec![None],
            }],
        };
        let page = matrix.markup().into_string();
        assert!(page.contains("<td class=\"none\">") && !page.contains("passed"));
        assert!(page.contains("<a href=\"#run\">1750 rpm</a>"));
    }
}
