//! The verdict as a JUnit file, for CI systems.

use crate::text::{limit, measured};
use crate::verdict::{Check, Status, Verdict};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

/// One test suite with one test case a check: title as its name, id as its class name.
pub fn document(title: &str, verdict: &Verdict) -> String {
    let mut suite = TestSuite::new(title);
    suite.add_test_cases(verdict.checks.iter().map(test_case));
    let skipped = verdict.count(Status::Untested).to_string();
    suite.extra.insert("skipped".into(), skipped.into());
    let mut report = Report::new(title);
    report.add_test_suite(suite);
    report.to_string().expect("a string takes every report")
}

fn test_case(check: &Check) -> TestCase {
    let figures = format!("measured {}, limit {}", measured(check), limit(check));
    let mut status = match check.status {
        Status::Passed => TestCaseStatus::success(),
        Status::Failed => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Status::Untested => TestCaseStatus::skipped(),
    };
    match check.status {
        Status::Passed => {}
        Status::Failed => {
            status.set_message(&figures).set_type("limit");
            status.set_description(format!("{figures}\n{}", check.detail));
        }
        Status::Untested => {
            status.set_message(&check.detail);
        }
    }
    let mut case = TestCase::new(&check.title, status);
    case.set_classname(&check.id);
    if check.status == Status::Passed {
        case.set_system_out(format!("{figures}\n{}", check.detail));
    }
    case
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::sample;

    #[test]
    fn counts_and_texts_are_those_of_the_verdict() {
        let verdict = sample();
        let xml = document("Verification", &verdict);
        let report = quick_junit::Report::deserialize_from_str(&xml).unwrap();
        assert_eq!(report.tests, verdict.checks.len());
        assert_eq!(report.failures, verdict.count(Status::Failed));
        assert_eq!(report.errors, 0);
        let suite = &report.test_suites[0];
        assert_eq!(suite.disabled, verdict.count(Status::Untested));
        assert_eq!(
            xml.matches("<skipped").count(),
            verdict.count(Status::Untested)
        );
        assert_eq!(
            xml.matches("<failure").count(),
            verdict.count(Status::Failed)
        );
        assert!(xml.contains("measured 1.7, limit &lt;= 1"), "{xml}");
        for (case, check) in suite.test_cases.iter().zip(&verdict.checks) {
            assert_eq!(case.name.as_str(), check.title);
            assert_eq!(case.classname.as_deref(), Some(check.id.as_str()));
        }
    }
}
