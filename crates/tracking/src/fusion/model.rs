//! The model: surfels, and merging of clouds.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Point3, Pose, Vector3};
use fringeflow_simd::prefetch;

use crate::registration::{
    OrganizedSurface, PoseCovariance, ReferencePoint, SampledPoints, Thinning, run_length, with_matrix,
};

use super::clean::is_wrong;
use super::depth_map::{DepthMap, project};
use super::merge::{Claims, Placement, merge};
use super::surfel::Surfel;

/// Changes that a cloud made to the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Surfels added.
    pub added: usize,
    /// Surfels removed after contradictions.
    pub removed: usize,
}

/// The surfel of the run this many runs ahead is loaded into the cache.
const AHEAD: usize = 8;

/// Buffers of a merge, kept from cloud to cloud.
#[derive(Debug, Default)]
pub(super) struct FusionScratch {
    map: DepthMap,
    claims: Claims,
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

    /// Samples about `count` of the supported surfels that face camera 1 and lie where a surface has points, hidden or
    /// not, spread evenly over the model.
    pub(super) fn sample(
        &self,
        camera: &Camera,
        model_from_cam1: &Pose,
        surface: &OrganizedSurface,
        min_support: u32,
        count: usize,
    ) -> SampledPoints {
        let cam1_from_model = with_matrix(&model_from_cam1.inverse());
        let sample = |run: usize| -> Vec<ReferencePoint> {
            let thinning = Thinning { total: self.surfels.len(), run };
            let seen = |run: usize| {
                // The selected surfels lie apart in memory.
                prefetch(&self.surfels, thinning.index(thinning.runs().min(run + AHEAD + 1) - 1));
                let surfel = &self.surfels[thinning.index(run)];
                let seen = surfel.is_supported(min_support).then(|| project(surfel, camera, &cam1_from_model))??;
                let [column, row] = seen.nearest_px();
                surface.depth_at(column, row)?;
                Some(surfel.reference_point([column as u16, row as u16]))
            };
            (0..thinning.runs()).into_par_iter().filter_map(seen).collect()
        };
        // A first sample tells their share of all surfels.
        let run = run_length(self.surfels.len(), count);
        let seen = sample(run).len() * run;
        SampledPoints { points: sample(run_length(seen, count)) }
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
        FusionScratch { map, claims }: &mut FusionScratch,
    ) -> Merged {
        let placement = Placement {
            model_from_cam1: with_matrix(model_from_cam1),
            cam1_from_model: with_matrix(&model_from_cam1.inverse()),
            covariance,
            excess: excess.max(1.0),
            pixel_per_m: 1.0 / camera.focal_px()[0],
            cloud: self.clouds.len() as u32,
        };
        map.draw(&self.surfels, camera, &placement.cam1_from_model);
        let added = merge(&mut self.surfels, map, surface, &placement, claims);
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
