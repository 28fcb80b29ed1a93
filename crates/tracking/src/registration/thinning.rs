//! The points that a cloud is registered to, and their division into levels and tiles.

use fringeflow::geometry::{Point3, Vector3};

use super::surface::{OrganizedSurface, point_of};

/// Tiles along the longer side of the visible surface. Errors within a tile may depend on each other (see
/// [`super::equations`]). A tile should be larger than the range of that dependence, but there must be many tiles.
const TILES_ACROSS: usize = 16;

/// A point of the reference, with the plane through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferencePoint {
    /// Position in the frame of the reference, metres.
    pub position_m: [f32; 3],
    /// Unit normal of the surface.
    pub normal: [f32; 3],
    /// Standard deviation by noise, metres.
    pub sigma_m: f32,
    /// Pixel of C1 at which the point is expected: column, row. It selects the tile.
    pub cam1_px: [u16; 2],
}

impl ReferencePoint {
    pub(super) fn position(&self) -> Point3 {
        point_of(self.position_m)
    }

    pub(super) fn normal(&self) -> Vector3 {
        point_of(self.normal).coords
    }
}

/// A sample of the points of a surface that clouds are registered to.
#[derive(Clone, Debug, Default)]
pub struct SampledPoints {
    /// Spread over the surface, in any order.
    pub points: Vec<ReferencePoint>,
}

impl SampledPoints {
    /// Samples about `count` of the points of a surface that have a normal. The frame of the reference is that of the
    /// surface.
    #[must_use]
    pub fn of_surface(surface: &OrganizedSurface, count: usize) -> Self {
        let [width, height] = surface.size_px();
        let point = |pixel: usize| {
            let point = surface.at((pixel % width) as isize, (pixel / width) as isize)?;
            let (position_m, sigma_m, cam1_px) = (point.position_m, point.sigma_m, point.cam1_px);
            Some(ReferencePoint { position_m, normal: point.normal?, sigma_m, cam1_px })
        };
        let pixels = Thinning { total: width * height, run: run_length(surface.count(), count) };
        Self { points: pixels.indices().filter_map(point).collect() }
    }

    /// Returns about `count` of the points, by tile of the image. Tiles without points are skipped.
    pub(super) fn tiles(&self, count: usize) -> Vec<Vec<ReferencePoint>> {
        let [columns, rows] = [0, 1].map(|axis| {
            let range = self.points.iter().map(|p| usize::from(p.cam1_px[axis]));
            let (first, last) = range.fold((usize::MAX, 0), |(first, last), c| (first.min(c), last.max(c)));
            first.min(last)..last + 1
        });
        let side = columns.len().max(rows.len()).div_ceil(TILES_ACROSS);
        let across = columns.len().div_ceil(side);
        let mut tiles = vec![Vec::new(); across * rows.len().div_ceil(side)];
        let thinning = Thinning { total: self.points.len(), run: run_length(self.points.len(), count) };
        for point in thinning.indices().map(|index| &self.points[index]) {
            let [u, v] = point.cam1_px.map(usize::from);
            tiles[(v - rows.start) / side * across + (u - columns.start) / side].push(*point);
        }
        tiles.retain(|tile| !tile.is_empty());
        tiles
    }
}

/// A selection of one item of each run of items. Which one of a run differs from run to run without a pattern: items
/// lie row by row, and a regular stride would select columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thinning {
    /// Number of items.
    pub(crate) total: usize,
    /// Length of a run, at least 1.
    pub(crate) run: usize,
}

impl Thinning {
    /// Number of runs.
    pub(crate) fn runs(&self) -> usize {
        self.total.div_ceil(self.run)
    }

    /// Index of the item selected from a run: multiplicative hashing (Knuth, "The Art of Computer Programming", 6.4).
    pub(crate) fn index(&self, run: usize) -> usize {
        let first = run * self.run;
        let length = self.run.min(self.total - first);
        let fraction = (run as u32).wrapping_mul(0x9E37_79B1);
        first + ((u64::from(fraction) * length as u64) >> 32) as usize
    }

    fn indices(self) -> impl Iterator<Item = usize> {
        (0..self.runs()).map(move |run| self.index(run))
    }
}

/// Returns the length of the runs that keep about `count` of a number of items; at least 1.
pub(crate) fn run_length(items: usize, count: usize) -> usize {
    ((items as f64 / count.max(1) as f64).round() as usize).max(1)
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
