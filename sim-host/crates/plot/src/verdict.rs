//! Checks and the verdict over them.

use crate::number::four_digits;
use serde::Serialize;

/// How a check came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The measured figure is within its limit.
    Passed,
    /// It is not.
    Failed,
    /// It could not be measured; the check's detail says why.
    Untested,
}

/// One check: what was measured, and what is allowed.
#[derive(Debug, Clone, Serialize)]
pub struct Check {
    /// Name for programs: `what/run`, for instance `bits/1750-square`.
    pub id: String,
    /// Name for people.
    pub title: String,
    /// The measured figure; none where untested.
    pub measured: Option<f64>,
    /// What is allowed, for instance `<= 1` or `30 to 60`.
    pub limit: String,
    /// Unit of both; empty for counts and ratios.
    pub unit: String,
    /// How it came out.
    pub status: Status,
    /// How the figure came about, its uncertainty, or why it is missing.
    pub detail: String,
}

impl Check {
    /// A check that the figure is at most `limit`. NaN fails.
    pub fn at_most(
        id: impl Into<String>,
        title: impl Into<String>,
        measured: f64,
        limit: f64,
    ) -> Self {
        Self::new(
            id,
            title,
            measured,
            format!("<= {}", four_digits(limit)),
            measured <= limit,
        )
    }

    /// A check that the figure is at least `limit`. NaN fails.
    pub fn at_least(
        id: impl Into<String>,
        title: impl Into<String>,
        measured: f64,
        limit: f64,
    ) -> Self {
        Self::new(
            id,
            title,
            measured,
            format!(">= {}", four_digits(limit)),
            measured >= limit,
        )
    }

    /// A check that the figure lies from `low` to `high`. NaN fails.
    pub fn within(
        id: impl Into<String>,
        title: impl Into<String>,
        measured: f64,
        (low, high): (f64, f64),
    ) -> Self {
        let limit = format!("{} to {}", four_digits(low), four_digits(high));
        Self::new(
            id,
            title,
            measured,
            limit,
            low <= measured && measured <= high,
        )
    }

    /// A check that the figure equals `expected`.
    pub fn equals(
        id: impl Into<String>,
        title: impl Into<String>,
        measured: f64,
        expected: f64,
    ) -> Self {
        let limit = format!("= {}", four_digits(expected));
        #[expect(clippy::float_cmp, reason = "counts and other exact figures")]
        Self::new(id, title, measured, limit, measured == expected)
    }

    /// A check that could not be made.
    pub fn untested(
        id: impl Into<String>,
        title: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            measured: None,
            limit: String::new(),
            unit: String::new(),
            status: Status::Untested,
            detail: reason.into(),
        }
    }

    fn new(
        id: impl Into<String>,
        title: impl Into<String>,
        measured: f64,
        limit: String,
        passed: bool,
    ) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            measured: Some(measured),
            limit,
            unit: String::new(),
            status: if passed {
                Status::Passed
            } else {
                Status::Failed
            },
            detail: String::new(),
        }
    }

    /// The same check with a unit.
    #[must_use]
    pub fn unit(mut self, unit: &str) -> Self {
        self.unit = unit.into();
        self
    }

    /// The same check with an explanation.
    #[must_use]
    pub fn detail(mut self, detail: impl Into<String>) -> Self {
        self.detail = detail.into();
        self
    }
}

/// All checks of a job.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    /// `pass` if no check failed and none was left untested, else `fail`.
    pub verdict: &'static str,
    /// The checks.
    pub checks: Vec<Check>,
}

impl Verdict {
    /// The verdict over the checks. A check that was not made is not a pass.
    pub fn over(checks: Vec<Check>) -> Self {
        let pass = !checks.is_empty() && checks.iter().all(|check| check.status == Status::Passed);
        Self {
            verdict: if pass { "pass" } else { "fail" },
            checks,
        }
    }

    /// Whether the verdict is a pass.
    pub fn passed(&self) -> bool {
        self.verdict == "pass"
    }

    /// Number of checks with the given status.
    pub fn count(&self, status: Status) -> usize {
        self.checks
            .iter()
            .filter(|check| check.status == status)
            .count()
    }
}

/// One check of each status, for tests.
#[cfg(test)]
pub(crate) fn sample() -> Verdict {
    Verdict::over(vec![
        Check::equals("bits/1750-none", "State words that differ", 0.0, 0.0)
            .detail("240000 words and 600000 duty codes compared"),
        Check::at_most(
            "step/1750-square",
            "Greatest one-step defect over its bound, with a title that takes more than one line",
            1.7,
            1.0,
        ),
        Check::untested(
            "cycles",
            "Instructions of a PWM task",
            "the emulator does not count instructions: it was started without -icount, and its own log holds nothing about them",
        ),
    ])
}
