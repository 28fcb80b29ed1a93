//! The model: surfels, and merging of clouds.

use fringeflow::geometry::{Camera, Point3, Pose, Vector3};

use crate::registration::{OrganizedSurface, PoseCovariance, Reference, SurfacePoint};

use super::clean::{count_verdicts, is_wrong};
use super::index_map::IndexMap;
use super::merge::{Placement, merge};
use super::surfel::{Surfel, single};

/// Changes that a cloud made to the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Surfels added.
    pub added: usize,
    /// Surfels removed after contradictions.
    pub removed: usize,
}

/// Buffers of a merge and of a view, kept from cloud to cloud.
#[derive(Clone, Debug, Default)]
pub(super) struct FusionScratch {
    map: IndexMap,
    owners: Vec<u32>,
}

/// The model as camera 1 sees it, in the frame of the camera. Each pixel has the surfel nearest to its centre.
pub(super) struct ModelView<'a> {
    surfels: &'a [Surfel],
    map: &'a IndexMap,
    cam1_from_model: Pose,
}

impl Reference for ModelView<'_> {
    fn at(&self, column: isize, row: isize) -> Option<SurfacePoint> {
        let cam1_px = [u16::try_from(column).ok()?, u16::try_from(row).ok()?];
        let surfel = &self.surfels[self.map.foremost(cam1_px)?];
        Some(SurfacePoint {
            position_m: single(&(self.cam1_from_model * surfel.position()).coords),
            normal: Some(single(&(self.cam1_from_model.rotation * surfel.normal()))),
            sigma_m: surfel.noise_m() as f32,
            intensity: surfel.intensity as u8,
            cam1_px,
        })
    }
}

/// Surfels in the frame of C1 at the first cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    surfels: Vec<Surfel>,
    /// Covariance of the pose of each merged cloud, and number of the surfels that it first measured.
    clouds: Vec<(PoseCovariance, u32)>,
    centre: Point3,
}

impl Model {
    /// All surfels, including those measured in few clouds.
    #[must_use]
    pub fn surfels(&self) -> &[Surfel] {
        &self.surfels
    }

    /// Iterates over the reliable surfels: those measured in `min_support` clouds, or in all clouds that could have
    /// measured them if these are fewer.
    pub fn supported(&self, min_support: u32) -> impl Iterator<Item = &Surfel> {
        self.surfels.iter().filter(move |surfel| surfel.is_supported(min_support))
    }

    /// Number of merged clouds.
    #[must_use]
    pub fn clouds(&self) -> usize {
        self.clouds.len()
    }

    /// Mean position of the surfels, metres; the origin if there are none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        self.centre
    }

    /// Draws the supported surfels as camera 1 sees them, for [`Self::seen_from`].
    pub(super) fn draw(
        &self,
        camera: &Camera,
        model_from_cam1: &Pose,
        min_support: u32,
        FusionScratch { map, .. }: &mut FusionScratch,
    ) {
        map.draw(&self.surfels, camera, &model_from_cam1.inverse(), |surfel| surfel.is_supported(min_support));
    }

    /// The surface of the surfels drawn last, at this pose, with the model as it is.
    pub(super) fn seen_from<'a>(&'a self, model_from_cam1: &Pose, scratch: &'a FusionScratch) -> ModelView<'a> {
        ModelView { surfels: &self.surfels, map: &scratch.map, cam1_from_model: model_from_cam1.inverse() }
    }

    /// Covariance of the pose of the model: the mean over its surfels of the covariance of the cloud that first
    /// measured each surfel.
    ///
    /// Errors of poses do not average out in a surfel as noise does: a surfel is created where its first cloud placed
    /// it, and later clouds are registered to it. The mean of the covariances is never below the covariance of the
    /// mean.
    pub(super) fn covariance(&self) -> PoseCovariance {
        let add = |sum, (covariance, surfels): &(PoseCovariance, u32)| sum + covariance.0 * f64::from(*surfels);
        let sum = self.clouds.iter().fold(PoseCovariance::zero().0, add);
        PoseCovariance(sum / self.surfels.len().max(1) as f64)
    }

    /// Merges the surface of a cloud with its pose and covariance. `excess` is the ratio of the residuals of its
    /// registration to noise.
    pub(super) fn merge(
        &mut self,
        camera: &Camera,
        surface: &OrganizedSurface,
        model_from_cam1: &Pose,
        covariance: PoseCovariance,
        excess: f64,
        min_support: u32,
        FusionScratch { map, owners }: &mut FusionScratch,
    ) -> Merged {
        let placement = Placement {
            model_from_cam1: *model_from_cam1,
            covariance,
            excess: excess.max(1.0),
            pixel_per_m: 1.0 / camera.focal_px()[0],
            cloud: self.clouds.len() as u32,
        };
        map.draw(&self.surfels, camera, &model_from_cam1.inverse(), |_| true);
        let added = merge(&mut self.surfels, map, surface, &placement, owners);
        count_verdicts(&mut self.surfels, map, surface, &placement);
        self.clouds.push((covariance, added as u32));
        Merged { added, removed: self.clean(min_support) }
    }

    /// Removes wrong surfels, and returns their number.
    fn clean(&mut self, min_support: u32) -> usize {
        let Self { surfels, clouds, centre } = self;
        let (before, mut sum) = (surfels.len(), Vector3::zeros());
        surfels.retain(|surfel| {
            let is_wrong = is_wrong(surfel, min_support);
            if is_wrong {
                clouds[surfel.first_cloud as usize].1 -= 1;
            } else {
                sum += surfel.position().coords;
            }
            !is_wrong
        });
        *centre = Point3::from(sum / surfels.len().max(1) as f64);
        before - surfels.len()
    }
}
