//! Samples the points of a surface for a level, and divides them into tiles.

use fringeflow::geometry::Point3;

use super::surface::SurfacePoint;

/// Tiles along the longer side of the visible surface. Errors within a tile may depend on each other (see
/// [`super::equations`]). A tile should be larger than the range of that dependence, but there must be many tiles.
const TILES_ACROSS: usize = 16;

/// The points of a surface that have a normal, on a regular grid of pixels. See [`super::Normals::sample`].
#[derive(Clone, Debug)]
pub struct SampledPoints {
    /// Row by row.
    pub(super) points: Vec<SurfacePoint>,
    /// Stride of the columns and rows of the grid.
    pub(super) step_px: usize,
    /// Mean of all points of the surface in the frame of C1, metres.
    pub(super) centre: Point3,
}

impl Default for SampledPoints {
    fn default() -> Self {
        Self { points: Vec::new(), step_px: 1, centre: Point3::origin() }
    }
}

/// Returns the stride of columns and rows that keeps about `count` of `points` points; at least 1.
pub(super) fn grid_step(points: usize, count: usize) -> usize {
    ((points as f64 / count.max(1) as f64).sqrt().round() as usize).max(1)
}

impl SampledPoints {
    /// Mean of all points of the surface in the frame of C1, metres; the origin if there are none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        self.centre
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
    use crate::registration::tests::{bowl, camera, sample_of};

    #[test]
    fn tiles_hold_about_the_wanted_number_and_no_point_twice() {
        let sampled = sample_of(&camera(), 0.0, 1, bowl);
        for count in [100, 600, 100_000] {
            let tiles = sampled.tiles(count);
            let mut pixels: Vec<[u16; 2]> = tiles.concat().iter().map(|p| p.cam1_px).collect();
            let expected = count.min(sampled.points.len());
            assert!(pixels.len() * 2 > expected && pixels.len() < expected * 2, "{} of {expected}", pixels.len());
            pixels.sort_unstable();
            pixels.dedup();
            assert_eq!(pixels.len(), tiles.concat().len());
        }
    }
}
