//! The chain from the images of one sequence to a point cloud, by the proposed method (PA).
//!
//! In: N images a camera. Out: the cloud, the decision about every pixel of C1, and the figures behind it. What depends
//! on the rig alone (segment table, epipolar frame) is held; the images come and go.

use crate::cloud::{Cloud, TriangulationInput, triangulate};
use crate::correspondence::{MatchError, MatchSettings, Matches, Outcome, SegmentTable, match_phases};
use crate::geometry::{EpipolarError, EpipolarFrame, Rig};
use crate::phase::{PhaseMap, PhaseShifts, Validity, decode};

/// How images become a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// What makes a phase trustworthy.
    pub validity: Validity,
    /// How correspondences are found.
    pub matching: MatchSettings,
}

/// Turns image sequences of one rig into clouds.
#[derive(Clone, Debug)]
pub struct Reconstructor {
    table: SegmentTable,
    frame: EpipolarFrame,
    shifts: PhaseShifts,
    settings: Settings,
    cam1_px: [usize; 2],
    cam2_px: [usize; 2],
}

/// What one sequence yielded.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// The points.
    pub cloud: Cloud,
    /// Decoded phase of C1.
    pub cam1: PhaseMap,
    /// Decoded phase of C2.
    pub cam2: PhaseMap,
    /// What became of each pixel of C1, and the statistics of δ.
    pub matches: Matches,
}

/// Why a sequence yields no cloud.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReconstructionError {
    /// The images of a camera do not fit the rig or the shifts.
    #[error(
        "camera {camera}: got {images} images, of {pixels:?} pixels each; expected {steps} images of {expected} pixels"
    )]
    Images {
        /// 1 or 2.
        camera: u8,
        /// Number of images.
        images: usize,
        /// Pixels of each.
        pixels: Vec<usize>,
        /// Number of shifts.
        steps: usize,
        /// Pixels that the rig's camera has.
        expected: usize,
    },
    /// The phases cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
}

impl Reconstructor {
    /// A reconstructor for a rig, its segment table, and a sequence of shifts.
    ///
    /// # Errors
    /// The rig has no epipolar frame.
    pub fn new(rig: &Rig, table: SegmentTable, shifts: PhaseShifts, settings: Settings) -> Result<Self, EpipolarError> {
        Ok(Self {
            table,
            frame: EpipolarFrame::new(rig)?,
            shifts,
            settings,
            cam1_px: [rig.cam1.width_px(), rig.cam1.height_px()],
            cam2_px: [rig.cam2.width_px(), rig.cam2.height_px()],
        })
    }

    /// The segment table it works with.
    #[must_use]
    pub fn table(&self) -> &SegmentTable {
        &self.table
    }

    /// Reconstructs one sequence: the images of C1 and of C2, grey levels row by row, in the order of the shifts.
    ///
    /// # Errors
    /// Images that do not fit, or that have nothing in common.
    pub fn reconstruct(&self, cam1: &[&[u8]], cam2: &[&[u8]]) -> Result<Reconstruction, ReconstructionError> {
        let cam1 = self.decode(1, cam1, self.cam1_px)?;
        let cam2 = self.decode(2, cam2, self.cam2_px)?;
        let mut matches = match_phases(&cam1, &cam2, &self.table, &self.settings.matching)?;
        let input = TriangulationInput {
            cam1: &cam1,
            cam2_noise_grey: cam2.fit.noise_grey,
            shifts: &self.shifts,
            table: &self.table,
            frame: &self.frame,
        };
        let cloud = triangulate(&matches, input);
        account_for_lost_points(&cloud, &mut matches, cam1.width);
        Ok(Reconstruction { cloud, cam1, cam2, matches })
    }

    fn decode(&self, camera: u8, images: &[&[u8]], size_px: [usize; 2]) -> Result<PhaseMap, ReconstructionError> {
        let [width, height] = size_px;
        decode(images, width, height, &self.shifts, &self.settings.validity).ok_or_else(|| {
            ReconstructionError::Images {
                camera,
                images: images.len(),
                pixels: images.iter().map(|i| i.len()).collect(),
                steps: self.shifts.steps(),
                expected: width * height,
            }
        })
    }
}

/// A match whose rays meet nowhere before the cameras has no point: it lies outside the volume, and is counted there.
fn account_for_lost_points(cloud: &Cloud, matches: &mut Matches, width: usize) {
    let mut points =
        cloud.points.iter().map(|p| usize::from(p.cam1_px[1]) * width + usize::from(p.cam1_px[0])).peekable();
    for (i, outcome) in matches.outcomes.iter_mut().enumerate().filter(|(_, o)| o.is_found()) {
        if points.next_if_eq(&i).is_none() {
            *outcome = Outcome::OutsideVolume;
            matches.chosen[i] = None;
        }
    }
}
