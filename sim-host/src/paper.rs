//! The paper's claims and its errata, as data: S.-C. Chang, "On controlling a chaotic vehicle
//! dynamic system by using dither".

use serde::{Deserialize, Serialize};

/// A claim of the paper, in this project's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Claim {
    /// Number.
    pub id: &'static str,
    /// What the paper says.
    pub says: &'static str,
    /// Where it says so.
    pub place: &'static str,
}

/// All claims that are judged.
pub const CLAIMS: [Claim; 8] = [
    Claim {
        id: "C1",
        says: "period-2 motion below 1645 rpm (region I)",
        place: "Figs 6, 7",
    },
    Claim {
        id: "C2",
        says: "chaos, with a positive largest Lyapunov exponent, from 1645 to 1825 rpm (region II)",
        place: "Figs 6, 7",
    },
    Claim {
        id: "C3",
        says: "period-3 motion from 1825 to 1855 rpm (region III)",
        place: "Figs 6, 7",
    },
    Claim {
        id: "C4",
        says: "chaos, with a positive largest Lyapunov exponent, above 1855 rpm (region IV)",
        place: "Figs 6, 7",
    },
    Claim {
        id: "C5",
        says: "at 1750 rpm a square dither that grows from 0 to 0.14 V turns chaos into periodic motion",
        place: "Fig 8",
    },
    Claim {
        id: "C6",
        says: "at 1750 rpm a square dither of 0.1 V gives period-one motion",
        place: "Figs 9 to 12",
    },
    Claim {
        id: "C7",
        says: "at 1750 rpm a sine dither of 0.8 to 1.2 V gives period-one motion",
        place: "Fig 13",
    },
    Claim {
        id: "C8",
        says: "at 1750 rpm a sine dither of 1.0 V from 3 s on: chaos before, periodic motion after",
        place: "Figs 14 to 17",
    },
];

/// Edges of the paper's regions I to IV, rpm.
pub const REGION_EDGES_RPM: [f64; 3] = [1645.0, 1825.0, 1855.0];

/// Whether chaos begins (or else ends) at an edge of the regions with rising speed.
pub fn chaos_begins_at(edge_rpm: f64) -> bool {
    edge_rpm != REGION_EDGES_RPM[1]
}

/// How far a claim was found to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reproduced {
    /// It holds within the measurement's uncertainty, or an edge is within 1 % of the paper's.
    Yes,
    /// It holds in part: the detail says which.
    InPart,
    /// It does not hold.
    No,
    /// It could not be judged.
    Untested,
}

impl Reproduced {
    /// The verdict in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Yes => "reproduced",
            Self::InPart => "reproduced in part",
            Self::No => "not reproduced",
            Self::Untested => "untested",
        }
    }
}
