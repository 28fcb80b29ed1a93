//! The chain from the images of one window to a point cloud, by the proposed method (PA; paper, sections 2.1 to 2.3).
//!
//! In: N or more images per camera. Out: the cloud, the outcome of every pixel of C1, and statistics. Segment table and
//! epipolar frame depend on the rig alone and are kept from window to window. Cost: that of the three workers.

use std::sync::Arc;

use fringeflow_base::grey::GreyLevels;
use fringeflow_base::limits::MAX_IMAGES;

use crate::cloud::Cloud;
use crate::correspondence::{Confidence, MatchError, MatchSettings, Matches, Outcome, SegmentTable};
use crate::geometry::{EpipolarError, FringePattern, Rig};
use crate::phase::{PhaseMap, PhaseShifts, Validity, usual_extra_images};
use crate::prior::{Moment, Prior};
use crate::worker::{CloudWorker, CorrespondenceWorker, Correspondences, ImagesError, PhasePair, PhaseWorker};

/// Settings of the reconstruction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// When a phase is valid.
    pub validity: Validity,
    /// Images of a window beyond one cycle, which compensate motion; `None` for the usual number, 0 for none.
    pub extra_images: Option<usize>,
    /// Settings of the search for correspondences.
    pub matching: MatchSettings,
}

impl Settings {
    /// Image pairs in a window of an N-step pattern.
    #[must_use]
    pub fn window_images(&self, steps: usize) -> usize {
        let extra = self.extra_images.unwrap_or(usual_extra_images(steps));
        steps.saturating_add(extra).min(MAX_IMAGES)
    }
}

/// Turns windows of images of one rig into clouds: runs the three workers one after the other.
///
/// ```
/// use std::f64::consts::TAU;
///
/// use fringeflow::correspondence::SegmentTable;
/// use fringeflow::geometry::{
///     Camera, Distortion, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3,
/// };
/// use fringeflow::phase::PhaseShifts;
/// use fringeflow::reconstruction::{Reconstructor, Settings};
/// use fringeflow_base::grey::GreyLevels;
///
/// // Two cameras and a projector in a row look at a wall 0.3 m away.
/// let camera = Camera::new([400.0, 400.0], [63.5, 31.5], Distortion::default(), [128, 64]);
/// let projector = Camera::new([800.0, 800.0], [255.5, 127.5], Distortion::default(), [512, 256]);
/// let rig = Rig {
///     cam1: camera.clone(),
///     cam2: camera.clone(),
///     projector,
///     cam2_from_cam1: Pose::translation(-0.04, 0.0, 0.0),
///     projector_from_cam1: Pose::translation(-0.015, 0.0, 0.0),
/// };
/// let pattern = FringePattern { period_px: 16.0, sign: 1.0, offset_rad: 0.0 };
/// let (min, max) = (Point3::new(-0.1, -0.1, -0.01), Point3::new(0.1, 0.1, 0.01));
/// let volume = MeasurementVolume::new(Pose::translation(0.0, 0.0, 0.3), min, max)?;
///
/// // The images of a camera at `centre`: fringes of the projector on the wall, four phase shifts.
/// let shifts_rad = [0.0, 0.25, 0.5, 0.75].map(|turns| turns * TAU);
/// let images = |centre: Vector3| {
///     shifts_rad.map(|shift_rad| {
///         let grey = |pixel: usize| {
///             let ray = camera.ray(&Pixel::new((pixel % 128) as f64, (pixel / 128) as f64)).unwrap();
///             let lit_by = rig.project_projector(&Point3::from(centre + ray * 0.3)).unwrap();
///             (100.0 + 60.0 * (TAU * pattern.phase_turns(lit_by.x) + shift_rad).cos()).round() as u8
///         };
///         (0..128 * 64).map(grey).collect::<Vec<u8>>()
///     })
/// };
/// let (cam1, cam2) = (images(Vector3::zeros()), images(rig.centre_of_cam2().coords));
/// let levels = [&cam1, &cam2].map(|images| images.each_ref().map(|image| GreyLevels::eight_bit(image)));
///
/// let table = SegmentTable::build(&rig, &volume, &pattern)?;
/// let shifts = PhaseShifts::new(&shifts_rad)?;
/// let mut reconstructor = Reconstructor::new(&rig, &pattern, table, &shifts, Settings::default())?;
/// let cloud = reconstructor.reconstruct(0, &levels[0], &levels[1], None)?.cloud;
/// assert!(cloud.points.len() > 4000, "{} points", cloud.points.len());
/// assert!(cloud.points.iter().all(|point| (point.position_m[2] - 0.3).abs() < 1e-3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Reconstructor {
    phase: PhaseWorker,
    correspondence: CorrespondenceWorker,
    cloud: CloudWorker,
}

/// Result of one window.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// The points.
    pub cloud: Cloud,
    /// Decoded phase of C1.
    pub cam1: PhaseMap,
    /// Decoded phase of C2.
    pub cam2: PhaseMap,
    /// Outcome of each pixel of C1, and the statistics of δ.
    pub matches: Matches,
}

/// Why a window yields no cloud.
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

    /// Its segment table.
    #[must_use]
    pub fn table(&self) -> &SegmentTable {
        self.correspondence.table()
    }

    /// Reconstructs one window: images of C1 and C2, grey levels row by row, in order of time. The first image shows
    /// step `first_step` of the cycle.
    ///
    /// A window of more images than a cycle is compensated for motion, with the help of `prior` if there is one. Its
    /// cloud is that at the centre of the window.
    ///
    /// # Errors
    /// The images do not fit rig, shifts or each other, or cannot be matched.
    pub fn reconstruct(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        prior: Option<(&Prior, Moment)>,
    ) -> Result<Reconstruction, ReconstructionError> {
        let maps = self.decode(first_step, cam1, cam2, prior)?;
        let (mut found, mut cloud) = (Correspondences::default(), Cloud::default());
        self.correspondence.step(&maps, &mut found)?;
        self.cloud.step(&found, &mut cloud);
        let mut matches = found.matches;
        mark_missing_points(&cloud, &mut matches, maps.cam1.width);
        Ok(Reconstruction { cloud, cam1: maps.cam1, cam2: maps.cam2, matches })
    }

    /// The first stage of [`Self::reconstruct`] alone: the decoded phase of both cameras.
    ///
    /// # Errors
    /// The images do not fit rig, shifts or each other.
    pub fn decode(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        prior: Option<(&Prior, Moment)>,
    ) -> Result<PhasePair, ImagesError> {
        let mut maps = PhasePair::default();
        self.phase.step(first_step, cam1, cam2, prior, &mut maps)?;
        Ok(maps)
    }
}

/// Marks matches without a point as outside the volume: their rays do not intersect in front of the cameras.
fn mark_missing_points(cloud: &Cloud, matches: &mut Matches, width: usize) {
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
