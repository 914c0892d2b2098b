//! The questions of a verification, and the checks that answer them.

use plot::verdict::Check;

/// A question.
#[derive(Debug, PartialEq, Eq)]
pub struct Question {
    /// Name for links.
    pub id: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// The question itself.
    pub text: &'static str,
    /// Beginnings of the ids of its checks.
    checks: &'static [&'static str],
}

/// All questions, in the order of the matrix. The last is for all other checks.
pub const QUESTIONS: [Question; 8] = [
    Question {
        id: "bits",
        title: "Bits",
        text: "Are the results of the firmware and of the host's f32 program equal, bit for bit?",
        checks: &["bits", "model-software", "software-processor"],
    },
    Question {
        id: "one-step",
        title: "One step",
        text: "Does each step of the firmware differ from the host's f64 step by no more than the rounding bound?",
        checks: &["one-step"],
    },
    Question {
        id: "horizon",
        title: "Horizon",
        text: "Do free f32 and f64 runs separate at the time predicted from the Lyapunov exponent, and stay together without \
               chaos?",
        checks: &["horizon"],
    },
    Question {
        id: "invariants",
        title: "Invariants",
        text: "Do exponent, period, bounds and Poincar\u{e9} points of firmware and host agree?",
        checks: &["exponent", "period", "bounds", "poincare"],
    },
    Question {
        id: "suppression",
        title: "Suppression",
        text: "Is the regime without dither the paper's, and do dither and delayed feedback suppress the chaos?",
        checks: &[
            "region",
            "chaos",
            "before",
            "suppressed",
            "signal",
            "averaging",
        ],
    },
    Question {
        id: "budget",
        title: "Budget",
        text: "Do time, flash and RAM suffice?",
        checks: &["load", "jitter", "overruns", "flash", "ram"],
    },
    Question {
        id: "stack",
        title: "Stack",
        text: "Does the deepest stack fit, by analysis and by measurement?",
        checks: &["stack"],
    },
    Question {
        id: "other",
        title: "Other",
        text: "Other checks.",
        checks: &[""],
    },
];

/// The question that a check answers.
pub fn of(check: &Check) -> &'static Question {
    let begins = |question: &&Question| {
        question
            .checks
            .iter()
            .any(|name| check.id.starts_with(name))
    };
    let found = QUESTIONS.iter().find(begins);
    found.expect("the last question takes every check")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_has_a_question() {
        let question = |id: &str| of(&Check::equals(id, "title", 0.0, 0.0)).id;
        assert_eq!(
            question("suppressed-exponent-host/1750-sine"),
            "suppression"
        );
        assert_eq!(question("stack-bound/ecu"), "stack");
        assert_eq!(question("something-new"), "other");
    }
}
