//! The model: surfels, and merging of clouds.

use fringeflow::geometry::{Camera, Point3, Pose, Vector3};

use crate::registration::{OrganizedSurface, PoseCovariance};

use super::clean::{Verdict, clean};
use super::index_map::IndexMap;
use super::merge::{Placement, merge};
use super::surfel::Surfel;

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
    verdicts: Vec<Verdict>,
}

/// Surfels in the frame of C1 at the first cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    surfels: Vec<Surfel>,
    /// Covariance of the pose of each merged cloud.
    covariances: Vec<PoseCovariance>,
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
        self.covariances.len()
    }

    /// Mean position of the surfels, metres; the origin if there are none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        let sum: Vector3 = self.surfels.iter().map(|surfel| surfel.position.coords).sum();
        Point3::from(sum / self.surfels.len().max(1) as f64)
    }

    /// Writes the surface of supported surfels that camera 1 sees, in the frame of the camera.
    pub(super) fn view(
        &self,
        camera: &Camera,
        model_from_cam1: &Pose,
        min_support: u32,
        scratch: &mut FusionScratch,
        surface: &mut OrganizedSurface,
    ) {
        let cam1_from_model = model_from_cam1.inverse();
        scratch.map.draw(&self.surfels, camera, &cam1_from_model, |surfel| surfel.is_supported(min_support));
        scratch.map.write_surface(&self.surfels, &cam1_from_model, surface);
    }

    /// Covariance of the pose of the model: the mean over its surfels of the covariance of the cloud that first
    /// measured each surfel.
    ///
    /// Errors of poses do not average out in a surfel as noise does: a surfel is created where its first cloud placed
    /// it, and later clouds are registered to it. The mean of the covariances is never below the covariance of the
    /// mean.
    pub(super) fn covariance(&self) -> PoseCovariance {
        let mut surfels_of_cloud = vec![0_u32; self.covariances.len()];
        for surfel in &self.surfels {
            if let Some(count) = surfels_of_cloud.get_mut(surfel.first_cloud as usize) {
                *count += 1;
            }
        }
        let sum = self
            .covariances
            .iter()
            .zip(&surfels_of_cloud)
            .fold(PoseCovariance::zero().0, |sum, (covariance, &count)| sum + covariance.0 * f64::from(count));
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
        FusionScratch { map, owners, verdicts }: &mut FusionScratch,
    ) -> Merged {
        let placement = Placement {
            model_from_cam1: *model_from_cam1,
            covariance,
            excess: excess.max(1.0),
            pixel_per_m: 1.0 / camera.focal_px()[0],
            cloud: self.covariances.len() as u32,
        };
        map.draw(&self.surfels, camera, &model_from_cam1.inverse(), |_| true);
        let added = merge(&mut self.surfels, map, surface, &placement, owners);
        let removed = clean(&mut self.surfels, map, surface, &placement, min_support, verdicts);
        self.covariances.push(covariance);
        Merged { added, removed }
    }
}
