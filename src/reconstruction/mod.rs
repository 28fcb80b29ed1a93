//! The chain from the images of one sequence to a point cloud, by the proposed method (PA).
//!
//! In: N images a camera. Out: the cloud, the decision about every pixel of C1, and the figures behind it. What depends
//! on the rig alone (segment table, epipolar frame) is held; the images come and go.

use std::sync::Arc;

use fringeflow_base::grey::GreyLevels;
use fringeflow_base::limits::MAX_IMAGES;

use crate::cloud::Cloud;
use crate::correspondence::{Confidence, MatchError, MatchSettings, Matches, Outcome, SegmentTable};
use crate::geometry::{EpipolarError, FringePattern, Rig};
use crate::phase::{PhaseMap, PhaseShifts, Validity, usual_extra_images};
use crate::prior::{Moment, Prior};
use crate::worker::{CloudWorker, CorrespondenceWorker, Correspondences, ImagesError, PhasePair, PhaseWorker};

/// How images become a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// What makes a phase trustworthy.
    pub validity: Validity,
    /// Images of a window beyond a cycle, that compensate motion; `None` for as many as are usual, 0 for none.
    pub extra_images: Option<usize>,
    /// How correspondences are found.
    pub matching: MatchSettings,
}

impl Settings {
    /// Image pairs of a window of N steps.
    #[must_use]
    pub fn window_images(&self, steps: usize) -> usize {
        let extra = self.extra_images.unwrap_or(usual_extra_images(steps));
        steps.saturating_add(extra).min(MAX_IMAGES)
    }
}

/// Turns image sequences of one rig into clouds: the three workers, one after the other.
#[derive(Clone, Debug)]
pub struct Reconstructor {
    phase: PhaseWorker,
    correspondence: CorrespondenceWorker,
    cloud: CloudWorker,
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
    #[error(transparent)]
    Images(#[from] ImagesError),
    /// The phases cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
}

impl Reconstructor {
    /// A reconstructor for a rig, its pattern and segment table, and one cycle of shifts.
    ///
    /// # Errors
    /// The rig has no epipolar frame.
    pub fn new(
        rig: &Rig,
        pattern: &FringePattern,
        table: SegmentTable,
        shifts: &PhaseShifts,
        settings: Settings,
    ) -> Result<Self, EpipolarError> {
        let table = Arc::new(table);
        Ok(Self {
            phase: PhaseWorker::new(rig, pattern, shifts, settings.validity),
            correspondence: CorrespondenceWorker::new(Arc::clone(&table), shifts, settings.matching),
            cloud: CloudWorker::new(rig, table)?,
        })
    }

    /// The segment table it works with.
    #[must_use]
    pub fn table(&self) -> &SegmentTable {
        self.correspondence.table()
    }

    /// Reconstructs one window: images of C1 and of C2, grey levels row by row, in the order of their times, of which the
    /// first shows step `first_step` of the cycle. With more images than a cycle has, motion is compensated, and the cloud is
    /// that of the centre of the window; what is known of it beforehand helps.
    ///
    /// # Errors
    /// Images that do not fit, or that have nothing in common.
    pub fn reconstruct(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        known: Option<(&Prior, Moment)>,
    ) -> Result<Reconstruction, ReconstructionError> {
        let (mut maps, mut found, mut cloud) = (PhasePair::default(), Correspondences::default(), Cloud::default());
        self.phase.step(first_step, cam1, cam2, known, &mut maps)?;
        self.correspondence.step(&maps, &mut found)?;
        self.cloud.step(&found, &mut cloud);
        let mut matches = found.matches;
        account_for_lost_points(&cloud, &mut matches, maps.cam1.width);
        Ok(Reconstruction { cloud, cam1: maps.cam1, cam2: maps.cam2, matches })
    }
}

/// A match whose rays meet nowhere before the cameras has no point: it lies outside the volume, and is counted there.
fn account_for_lost_points(cloud: &Cloud, matches: &mut Matches, width: usize) {
    let mut points =
        cloud.points.iter().map(|p| usize::from(p.cam1_px[1]) * width + usize::from(p.cam1_px[0])).peekable();
    for (i, outcome) in matches.outcomes.iter_mut().enumerate().filter(|(_, o)| o.is_found()) {
        if points.next_if_eq(&i).is_none() {
            *outcome = Outcome::OutsideVolume;
            matches.chosen.clear(i);
            matches.confidence[i] = Confidence::NONE;
        }
    }
}
