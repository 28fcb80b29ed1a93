//! Projects the model into the image of camera 1, to find the surfels that the camera would see at each place.
//!
//! Each pixel has four cells, so that neighbouring surfels seldom share one. If two surfels of different surfaces share
//! a cell, the nearer one stays. On one surface the better measured one stays: the nearer one would pull the model
//! towards the camera by the noise of its worst surfels.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Pose};
use fringeflow_simd::prefetch;

use super::surfel::Surfel;

/// Cells along each side of a pixel.
const CELLS: usize = 2;
/// Largest depth difference of surfels of one surface within a pixel or two, as a share of the depth. With a larger
/// difference, one hides the other.
const SAME_SURFACE_SHARE: f32 = 0.01;

/// A surfel in the image of camera 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    /// Image point: column, row.
    pub(super) pixel: [f32; 2],
    /// Depth, metres; NaN if the surfel is outside the image, turned away, or not wanted.
    pub(super) depth_m: f32,
}

impl Projection {
    const NONE: Self = Self { pixel: [0.0; 2], depth_m: f32::NAN };

    /// Square of the distance from an image point, pixels².
    pub(super) fn square_distance(&self, [u, v]: [f32; 2]) -> f32 {
        let [x, y] = [self.pixel[0] - u, self.pixel[1] - v];
        x * x + y * y
    }
}

/// The model in the image of camera 1 at a pose. Its memory lives from cloud to cloud.
#[derive(Clone, Debug, Default)]
pub(super) struct IndexMap {
    width: usize,
    height: usize,
    /// Index of the surfel in each cell, or [`NONE`].
    cells: Vec<u32>,
    /// Projection of each surfel.
    projections: Vec<Projection>,
}

const NONE: u32 = u32::MAX;

impl IndexMap {
    /// Projects the surfels that pass `is_wanted`, instead of those before.
    pub(super) fn draw(
        &mut self,
        surfels: &[Surfel],
        camera: &Camera,
        cam1_from_model: &Pose,
        is_wanted: impl Fn(&Surfel) -> bool + Sync,
    ) {
        [self.width, self.height] = [camera.width_px() * CELLS, camera.height_px() * CELLS];
        self.cells.clear();
        self.cells.resize(self.width * self.height, NONE);
        let project = |surfel: &Surfel| {
            let seen = is_wanted(surfel).then(|| project(surfel, camera, cam1_from_model)).flatten();
            seen.unwrap_or(Projection::NONE)
        };
        surfels.par_iter().with_min_len(1024).map(project).collect_into_vec(&mut self.projections);
        for (index, projection) in self.projections.iter().enumerate() {
            let Some(cell) = self.cell_at(projection) else { continue };
            let other = self.cells[cell];
            let replaces_other = other == NONE || {
                let (depth_m, other_depth_m) = (projection.depth_m, self.projections[other as usize].depth_m);
                let is_same_surface = (depth_m - other_depth_m).abs() <= SAME_SURFACE_SHARE * depth_m;
                if is_same_surface {
                    surfels[index].weight > surfels[other as usize].weight
                } else {
                    depth_m < other_depth_m
                }
            };
            if replaces_other {
                self.cells[cell] = index as u32;
            }
        }
    }

    /// Returns the projection of a surfel, or `None` if it has none.
    pub(super) fn projection(&self, index: usize) -> Option<&Projection> {
        self.projections.get(index).filter(|seen| !seen.depth_m.is_nan())
    }

    /// Calls `visit` for each surfel in the cells within a pixel of an image point, with its projection.
    #[inline]
    pub(super) fn visit_near<'a>(&'a self, [u, v]: [f32; 2], mut visit: impl FnMut(usize, &'a Projection)) {
        let inside = |x: f32, length: usize| {
            let first = rounded((x - 0.5) * CELLS as f32);
            let end = first.saturating_add(2 * CELLS as isize);
            (first.max(0) as usize).min(length)..(end.max(0) as usize).min(length)
        };
        let (columns, rows) = (inside(u, self.width), inside(v, self.height));
        for row in rows {
            for &index in &self.cells[row * self.width..][columns.clone()] {
                if index != NONE {
                    visit(index as usize, &self.projections[index as usize]);
                }
            }
        }
    }

    /// Starts to load the surfels of a pixel into the cache.
    #[inline]
    pub(super) fn prefetch_at(&self, [column, row]: [usize; 2], surfels: &[Surfel]) {
        for row in row * CELLS..(row + 1) * CELLS {
            for &index in self.cells.iter().skip(row * self.width + column * CELLS).take(CELLS) {
                prefetch(surfels, index as usize);
                prefetch(&self.projections, index as usize);
            }
        }
    }

    /// Whether another surface lies in front of a projected surfel.
    pub(super) fn is_hidden(&self, seen: &Projection) -> bool {
        let limit_m = seen.depth_m * (1.0 - SAME_SURFACE_SHARE);
        let mut is_hidden = false;
        self.visit_near(seen.pixel, |_, other| is_hidden |= other.depth_m < limit_m);
        is_hidden
    }

    /// Returns the surfel of the foremost surface that is nearest to the centre of a pixel of the image.
    pub(super) fn foremost(&self, [u, v]: [u16; 2]) -> Option<usize> {
        if usize::from(u) * CELLS >= self.width || usize::from(v) * CELLS >= self.height {
            return None;
        }
        let pixel = [f32::from(u), f32::from(v)];
        let mut best: Option<(usize, &Projection)> = None;
        self.visit_near(pixel, |index, seen| {
            let is_better = best.is_none_or(|(_, other)| {
                let is_same_surface = (seen.depth_m - other.depth_m).abs() <= SAME_SURFACE_SHARE * seen.depth_m;
                if is_same_surface {
                    seen.square_distance(pixel) < other.square_distance(pixel)
                } else {
                    seen.depth_m < other.depth_m
                }
            });
            if is_better {
                best = Some((index, seen));
            }
        });
        best.map(|(index, _)| index)
    }

    /// Returns the cell of a projection, or `None` if it has none.
    fn cell_at(&self, seen: &Projection) -> Option<usize> {
        let cell = |x: f32| (x + 0.5) * CELLS as f32;
        let [u, v] = [cell(seen.pixel[0]), cell(seen.pixel[1])];
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        (inside && !seen.depth_m.is_nan()).then_some(v as usize * self.width + u as usize)
    }
}

/// Returns the nearest integer, as [`f32::round`] does, but without the call of a function.
pub(super) fn rounded(x: f32) -> isize {
    let whole = x as isize;
    let rest = x - whole as f32;
    whole.saturating_add(isize::from(rest >= 0.5)).saturating_sub(isize::from(rest <= -0.5))
}

fn project(surfel: &Surfel, camera: &Camera, cam1_from_model: &Pose) -> Option<Projection> {
    let position = cam1_from_model * surfel.position();
    let faces_camera = (cam1_from_model.rotation * surfel.normal()).dot(&position.coords) < 0.0;
    let pixel = faces_camera.then(|| camera.project(&position))??;
    camera.sees(&pixel).then_some(Projection { pixel: [pixel.x as f32, pixel.y as f32], depth_m: position.z as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_as_by_the_standard_library() {
        let next = |x: f32| [x.next_down(), x, x.next_up()];
        for x in (-9_i16..=9).flat_map(|k| next(f32::from(k) / 2.0)).chain([1e6, -1e30, 1e30]) {
            assert_eq!(rounded(x), x.round() as isize, "{x}");
        }
    }
}
