//! Outcomes of the pixels of camera 1 (C1).

use bytemuck::{CheckedBitPattern, NoUninit};

/// How the correspondence of a pixel of C1 was found, or why the pixel has none.
///
/// Pixels with one of the first five outcomes have a point. Exported clouds contain the code of the outcome as `stage`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, NoUninit, CheckedBitPattern)]
#[repr(u8)]
pub enum Outcome {
    /// Decided by Gray code (reference methods only).
    GrayCode = 0,
    /// Reference correspondence: one candidate passes the test (paper, 2.2.1), and the whole image agrees.
    Reference = 1,
    /// One candidate or none passes the test; its neighbours confirm it (paper, 2.2.2).
    Unique = 2,
    /// One of several candidates, chosen along the epipolar direction by Eq. (2) (paper, 2.2.2).
    AlongEpipolar = 3,
    /// One of several candidates, chosen with neighbours along and across the epipolar direction (paper, 2.2.3), or
    /// with the surface around it.
    AcrossEpipolar = 4,
    /// No phase: the modulation is too low, a sample is saturated, or the samples are no sinusoid.
    Invalid = 16,
    /// The ray or the point misses the measurement volume, or the epipolar segment lies outside the image of C2.
    OutsideVolume = 17,
    /// No point of the epipolar segment has the phase of the pixel.
    NoCandidate = 18,
    /// All candidates fail the back-projection test.
    RejectedByDelta = 19,
    /// Candidates remain, but nothing decides between them.
    Ambiguous = 20,
    /// Contradicts other correspondences: by monotony, or by another fringe order at the same point of C2.
    Contradicted = 21,
}

impl Outcome {
    /// All outcomes, those with a point first.
    pub const ALL: [Self; 11] = [
        Self::GrayCode,
        Self::Reference,
        Self::Unique,
        Self::AlongEpipolar,
        Self::AcrossEpipolar,
        Self::Invalid,
        Self::OutsideVolume,
        Self::NoCandidate,
        Self::RejectedByDelta,
        Self::Ambiguous,
        Self::Contradicted,
    ];

    /// Returns the outcome with this code; `None` for an unknown code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|outcome| *outcome as u8 == code)
    }

    /// Whether the pixel has a point.
    #[must_use]
    #[inline(always)]
    pub fn is_found(self) -> bool {
        (self as u8) < Self::Invalid as u8
    }

    /// Name in reports and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::GrayCode => "gray_code",
            Self::Reference => "reference",
            Self::Unique => "unique",
            Self::AlongEpipolar => "along_epipolar",
            Self::AcrossEpipolar => "across_epipolar",
            Self::Invalid => "invalid",
            Self::OutsideVolume => "outside_volume",
            Self::NoCandidate => "no_candidate",
            Self::RejectedByDelta => "rejected_by_delta",
            Self::Ambiguous => "ambiguous",
            Self::Contradicted => "contradicted",
        }
    }
}

/// Number of pixels of C1 by outcome; the sum is the number of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutcomeCounts([u64; Outcome::ALL.len()]);

impl OutcomeCounts {
    /// Counts the outcomes of an image.
    #[must_use]
    pub fn from_outcomes(outcomes: &[Outcome]) -> Self {
        // Four sets of counters, used in turn: neighbours mostly have the same outcome, and consecutive increments of
        // one counter would have to wait for each other.
        let mut by_code = [[0_u64; 256]; 4];
        let (fours, rest) = outcomes.as_chunks();
        for four in fours.iter().map(<[Outcome; 4]>::as_slice).chain([rest]) {
            four.iter().zip(&mut by_code).for_each(|(&outcome, counts)| counts[outcome as usize] += 1);
        }
        Self(Outcome::ALL.map(|o| by_code.iter().map(|counts| counts[o as usize]).sum()))
    }

    /// Counts by the code of the outcome, as messages hold them.
    #[must_use]
    pub fn from_codes(by_code: &[u64]) -> Self {
        Self(Outcome::ALL.map(|outcome| by_code.get(outcome as usize).copied().unwrap_or_default()))
    }

    /// Number of pixels with an outcome.
    #[must_use]
    pub fn get(&self, outcome: Outcome) -> u64 {
        self.iter().find(|&(o, _)| o == outcome).map_or(0, |(_, n)| n)
    }

    /// Percentage of unique correspondences (puc; paper, 2.2.1): points whose pixel had no other candidate to choose
    /// from, among all points. `None` without points, and for Gray code, which has no candidates.
    #[must_use]
    pub fn unique_percent(&self) -> Option<f64> {
        let unique = self.get(Outcome::Reference) + self.get(Outcome::Unique);
        let points = unique + self.get(Outcome::AlongEpipolar) + self.get(Outcome::AcrossEpipolar);
        (points > 0).then(|| 100.0 * unique as f64 / points as f64)
    }

    /// All outcomes with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (Outcome, u64)> + '_ {
        Outcome::ALL.into_iter().zip(self.0)
    }
}
