//! Why a computation has no result.

/// Why a trajectory, an orbit or a branch could not be computed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The trajectory leaves all bounds.
    #[error("the trajectory diverges after {time_s} s")]
    Diverges {
        /// Time from its start, s.
        time_s: f64,
    },
    /// More steps or mode transitions than a trajectory of that length may take.
    #[error("the trajectory takes too many steps: {time_s} s of it needed {steps}")]
    TooManySteps {
        /// Time reached, s.
        time_s: f64,
        /// Steps taken.
        steps: usize,
    },
    /// A boundary is touched, not crossed: the trajectory has no derivative there.
    #[error("the trajectory grazes the boundary of a mode after {time_s} s")]
    Grazes {
        /// Time from its start, s.
        time_s: f64,
    },
    /// Newton's method does not converge.
    #[error(
        "Newton's method does not converge: the last correction is {correction:.1e} of the solution's size"
    )]
    NotConverged {
        /// Size of the last correction, in the solution's scales.
        correction: f64,
    },
    /// The linear equations of a correction have no unique solution.
    #[error("the equations are singular")]
    Singular,
    /// The solution is at rest.
    #[error("the solution is an equilibrium, not a periodic orbit")]
    AtRest,
    /// The start does not return near itself.
    #[error("no periodic orbit near the start: it does not return within {longest_s} s")]
    NoReturn {
        /// Length of the trajectory that was searched, s.
        longest_s: f64,
    },
}
