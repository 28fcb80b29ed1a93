//! A model with fewer points, to be looked at: of each cube of space one surfel at most.

use std::collections::HashSet;

use super::model::Model;
use super::surfel::Surfel;

/// Side of the smallest cubes, metres.
const FINEST_M: f64 = 5e-5;
/// From one size of the cubes to the next: about 30 % fewer points.
const COARSER: f64 = 1.2;

/// Some surfels of a model.
#[derive(Clone, Debug)]
pub struct Thinned<'a> {
    /// Side of the cubes, metres; 0 where no surfel was left out.
    pub voxel_m: f64,
    /// The surfels, in the order of the model.
    pub surfels: Vec<&'a Surfel>,
}

impl Model {
    /// At most `limit` of the surfels that are supported: of the cubes that leave so few the smallest, from `least_m` on, the
    /// size that was enough for the model before.
    #[must_use]
    pub fn thinned(&self, min_support: u32, limit: usize, least_m: f64) -> Thinned<'_> {
        let all: Vec<&Surfel> = self.supported(min_support).collect();
        if all.len() <= limit {
            return Thinned { voxel_m: 0.0, surfels: all };
        }
        let mut voxel_m = least_m.max(FINEST_M);
        loop {
            if let Some(surfels) = one_a_cube(&all, voxel_m, limit) {
                return Thinned { voxel_m, surfels };
            }
            voxel_m *= COARSER;
        }
    }
}

/// The first surfel of every cube; `None` where they are more than the limit.
fn one_a_cube<'a>(all: &[&'a Surfel], voxel_m: f64, limit: usize) -> Option<Vec<&'a Surfel>> {
    let mut taken = HashSet::with_capacity(limit);
    let mut surfels = Vec::with_capacity(limit);
    for &surfel in all {
        let cube: [i64; 3] = surfel.position.coords.map(|x| (x / voxel_m).floor() as i64).into();
        if taken.insert(cube) {
            if surfels.len() == limit {
                return None;
            }
            surfels.push(surfel);
        }
    }
    Some(surfels)
}
