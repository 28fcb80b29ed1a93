//! A thinned model for display: at most one surfel per voxel.

use std::collections::HashSet;

use super::model::Model;
use super::surfel::Surfel;

/// Side of the smallest voxels, metres.
const MIN_VOXEL_M: f64 = 5e-5;
/// Factor from one voxel size to the next: about 30 % fewer points.
const VOXEL_GROWTH: f64 = 1.2;

/// A selection of the surfels of a model.
#[derive(Clone, Debug)]
pub struct Thinned<'a> {
    /// Side of the voxels, metres; 0 if all surfels are included.
    pub voxel_m: f64,
    /// The surfels, in the order of the model.
    pub surfels: Vec<&'a Surfel>,
}

impl Model {
    /// Returns at most `limit` of the supported surfels. The voxels are the smallest that suffice. The search starts at
    /// `least_m`, the size that sufficed for the previous model.
    #[must_use]
    pub fn thinned(&self, min_support: u32, limit: usize, least_m: f64) -> Thinned<'_> {
        let all: Vec<&Surfel> = self.supported(min_support).collect();
        if all.len() <= limit {
            return Thinned { voxel_m: 0.0, surfels: all };
        }
        let mut voxel_m = least_m.max(MIN_VOXEL_M);
        loop {
            if let Some(surfels) = one_per_voxel(&all, voxel_m, limit) {
                return Thinned { voxel_m, surfels };
            }
            voxel_m *= VOXEL_GROWTH;
        }
    }
}

/// Returns the first surfel in each voxel, or `None` if there are more than `limit`.
fn one_per_voxel<'a>(all: &[&'a Surfel], voxel_m: f64, limit: usize) -> Option<Vec<&'a Surfel>> {
    let mut occupied = HashSet::with_capacity(limit);
    let mut surfels = Vec::with_capacity(limit);
    for &surfel in all {
        let voxel: [i64; 3] = surfel.position().coords.map(|x| (x / voxel_m).floor() as i64).into();
        if occupied.insert(voxel) {
            if surfels.len() == limit {
                return None;
            }
            surfels.push(surfel);
        }
    }
    Some(surfels)
}
