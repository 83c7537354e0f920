//! Claims of the papers: their number, ours, and whether ours agrees.

use serde::Serialize;

/// Number of a paper beside ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Statement that the number is about.
    pub says: String,
    /// Number of the paper, where it prints one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<f64>,
    /// Number of ours.
    pub ours: f64,
    /// True where ours bears the statement out; `None` for a number that stands beside others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holds: Option<bool>,
}

impl Claim {
    /// A number of ours that stands for itself.
    #[must_use]
    pub fn number(says: impl Into<String>, ours: f64) -> Self {
        Self { says: says.into(), paper: None, ours, holds: None }
    }

    /// This number beside the paper's.
    #[must_use]
    pub fn beside(self, paper: f64) -> Self {
        Self { paper: Some(paper), ..self }
    }

    /// This number, judged.
    #[must_use]
    pub fn holds(self, holds: bool) -> Self {
        Self { holds: Some(holds), ..self }
    }
}

/// Outcome of a figure's claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Claims that were judged.
    pub judged: usize,
    /// Claims that came out.
    pub met: usize,
}

impl Verdict {
    /// Outcome of claims.
    #[must_use]
    pub fn of(claims: &[Claim]) -> Self {
        let judged = claims.iter().filter_map(|c| c.holds);
        Self { judged: judged.clone().count(), met: judged.filter(|holds| *holds).count() }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.judged, self.met) {
            (0, _) => write!(f, "nothing to judge"),
            (all, met) if all == met => write!(f, "comes out"),
            (_, 0) => write!(f, "does not come out"),
            (all, met) => write!(f, "comes out in {met} of {all}"),
        }
    }
}
