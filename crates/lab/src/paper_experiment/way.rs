//! The ways to find correspondences that the experiment compares.

use fringeflow::correspondence::ResolutionMethod;
use serde::Serialize;

/// A way to find correspondences (paper, Table 2). The proposed algorithm is there twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// The proposed algorithm as the paper describes it (section 2.2).
    PaPaper,
    /// The proposed algorithm as this program runs it by default.
    PaProduct,
    /// Full Gray code with epipolar lines.
    Egc,
    /// Full Gray code in two fringe directions.
    Cgc,
}

impl Way {
    /// All ways.
    pub const ALL: [Self; 4] = [Self::PaPaper, Self::PaProduct, Self::Egc, Self::Cgc];

    /// Name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PaPaper => "pa_paper",
            Self::PaProduct => "pa_product",
            Self::Egc => "egc",
            Self::Cgc => "cgc",
        }
    }

    /// Name in tables.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::PaPaper => "PA, paper's way",
            Self::PaProduct => "PA, product's way",
            Self::Egc => "EGC",
            Self::Cgc => "CGC",
        }
    }

    /// The method that resolves ambiguities; `None` with Gray code.
    #[must_use]
    pub fn resolution(self) -> Option<ResolutionMethod> {
        match self {
            Self::PaPaper => Some(ResolutionMethod::Paper),
            Self::PaProduct => Some(ResolutionMethod::Moments),
            Self::Egc | Self::Cgc => None,
        }
    }
}
