//! Samples the points of a surface for a level, and divides them into tiles.

use super::surface::{OrganizedSurface, SurfacePoint, grid_step};

/// Tiles along the longer side of the visible surface. Errors within a tile may depend on each other (see
/// [`super::equations`]). A tile should be larger than the range of that dependence, but there must be many tiles.
const TILES_ACROSS: usize = 16;

/// The points of a surface that have a normal, on a regular grid of pixels.
pub(super) struct SampledPoints {
    points: Vec<SurfacePoint>,
    step_px: usize,
}

impl SampledPoints {
    pub(super) fn from_surface(surface: &OrganizedSurface) -> Self {
        let points = surface.points().iter().filter(|p| p.normal.is_some()).copied().collect();
        Self { points, step_px: surface.normal_step_px() }
    }

    /// Returns about `count` of the points, by tile of the image. Tiles without points are skipped.
    pub(super) fn tiles(&self, count: usize) -> Vec<Vec<SurfacePoint>> {
        let stride = grid_step(self.points.len(), count) * self.step_px;
        let [columns, rows] = [0, 1].map(|axis| {
            let range = self.points.iter().map(|p| usize::from(p.cam1_px[axis]));
            let (first, last) = range.fold((usize::MAX, 0), |(first, last), c| (first.min(c), last.max(c)));
            first.min(last)..last + 1
        });
        let side = columns.len().max(rows.len()).div_ceil(TILES_ACROSS);
        let across = columns.len().div_ceil(side);
        let mut tiles = vec![Vec::new(); across * rows.len().div_ceil(side)];
        for point in &self.points {
            let [u, v] = point.cam1_px.map(usize::from);
            if u.is_multiple_of(stride) && v.is_multiple_of(stride) {
                tiles[(v - rows.start) / side * across + (u - columns.start) / side].push(*point);
            }
        }
        tiles.retain(|tile| !tile.is_empty());
        tiles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::tests::{bowl, camera, surface_of};

    #[test]
    fn tiles_hold_about_the_wanted_number_and_no_point_twice() {
        let surface = surface_of(&camera(), 0.0, 1, bowl);
        for count in [100, 600, 100_000] {
            let tiles = SampledPoints::from_surface(&surface).tiles(count);
            let mut pixels: Vec<[u16; 2]> = tiles.concat().iter().map(|p| p.cam1_px).collect();
            let expected = count.min(surface.points().len());
            assert!(pixels.len() * 2 > expected && pixels.len() < expected * 2, "{} of {expected}", pixels.len());
            pixels.sort_unstable();
            pixels.dedup();
            assert_eq!(pixels.len(), tiles.concat().len());
        }
    }
}
