//! Quality of a cloud: completeness, completeness error, false positive correspondences (paper, section 3) and 3D
//! error.
//!
//! In: a cloud and a truth. Out: [`Scores`], and a [`Judgement`] for each pixel of C1. The truth is the exact truth of
//! a rendered scene, the Gray-code reference of a captured scene, or another cloud.
//!
//! A point is correct if its correspondence lies within [`TOLERANCE_PX`] of that of the reference. At silhouettes a
//! pixel sees two surfaces. So a point within [`EDGE_TOLERANCE_PX`] of the true correspondence of one of the eight
//! neighbours is tolerated: it counts neither as complete nor as false.

mod against_captured;
mod against_cloud;
mod against_rendered;
mod frames;
mod gray_reference;
mod interior;
mod moved_truth;
mod pixel_grid;
mod reference_data;
mod reliability;
mod scores;
mod simulated_dataset;
mod trajectory;

pub use against_captured::against_captured;
pub use against_cloud::against_cloud;
pub use against_rendered::{against_rendered, against_rendered_at};
pub use frames::Frames;
pub use gray_reference::{GrayReferenceError, cgc, egc};
pub use reference_data::{gray_reference_data, limit_to_gray_code};
pub use reliability::{ReliabilityPart, reliability};
pub use scores::Scores;
pub use simulated_dataset::SimulatedDatasetError;
pub use trajectory::{StatedPose, TrajectoryScores, against_trajectory};

/// Largest distance in C2 between a correct point and the reference, pixels.
pub const TOLERANCE_PX: f64 = 2.0;
/// Largest distance in C2 to the correspondence of a neighbouring pixel, pixels.
pub const EDGE_TOLERANCE_PX: f64 = 3.0;
/// Largest back-projection residual of a captured reference, rad. Above it the Gray code itself is wrong.
pub const MAX_REFERENCE_RESIDUAL_RAD: f32 = 0.15;

/// Judgement of a pixel of C1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Judgement {
    /// Neither a point nor a reference.
    Nothing,
    /// The point agrees with the reference.
    Correct,
    /// The point disagrees with the reference. It counts as a false positive.
    Wrong,
    /// The pixel has a point but no true correspondence. It counts as a false positive.
    Stray,
    /// The point disagrees with the reference, but a neighbour or the Gray-code reference explains it.
    Tolerated,
    /// The reference has no point.
    Missed,
    /// The point has no truth to judge it by.
    Unjudged,
}

impl Judgement {
    /// All judgements; those with a point come first.
    pub const ALL: [Self; 7] =
        [Self::Correct, Self::Wrong, Self::Stray, Self::Tolerated, Self::Unjudged, Self::Missed, Self::Nothing];

    /// Name in legends.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Correct => "correct",
            Self::Wrong => "wrong",
            Self::Stray => "stray",
            Self::Tolerated => "tolerated",
            Self::Missed => "missed",
            Self::Unjudged => "unjudged",
        }
    }

    /// Whether the point counts as a false positive correspondence.
    #[must_use]
    pub fn is_false(self) -> bool {
        matches!(self, Self::Wrong | Self::Stray)
    }
}

/// The scores of a cloud, and the judgement of each pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// Scores of the cloud.
    pub scores: Scores,
    /// Judgements, one per pixel of C1.
    pub judgements: Vec<Judgement>,
}

/// Why a cloud cannot be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EvaluationError {
    /// The reference is empty.
    #[error("the reference has no correspondence to compare with; check the truth or the Gray code")]
    NoReference,
    /// A point lies outside the image.
    #[error("a point of the cloud belongs to pixel ({u}, {v}), outside the {width} × {height} pixels of camera 1")]
    OutsideImage {
        /// Column.
        u: u16,
        /// Row.
        v: u16,
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
    },
    /// An array of the truth does not have the size of the image.
    #[error("the truth covers {found} pixels, but the image of camera 1 has {expected}; use the truth of these images")]
    Size {
        /// Pixels of the truth.
        found: usize,
        /// Pixels of the image.
        expected: usize,
    },
}

#[cfg(test)]
mod test_cloud {
    use fringeflow::cloud::{Cloud, CloudPoint};

    /// Creates a cloud of points (pixel of C1, point in C2, depth in metres).
    pub(super) fn cloud(points: &[([u16; 2], [f32; 2], f32)]) -> Cloud {
        let point = |&(cam1_px, cam2_px, depth_m): &([u16; 2], [f32; 2], f32)| CloudPoint {
            position_m: [0.0, 0.0, depth_m],
            cam1_px,
            cam2_px,
            candidates: 1,
            confidence: 1.0,
            ..CloudPoint::default()
        };
        Cloud { points: points.iter().map(point).collect() }
    }
}
