//! Projects the model into the image of camera 1, to find the surfels that the camera would see at each place.
//!
//! Each pixel has four cells, so that neighbouring surfels seldom share one. If two surfels of different surfaces share
//! a cell, the nearer one stays. On one surface the better measured one stays: the nearer one would pull the model
//! towards the camera by the noise of its worst surfels.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Pixel, Point3, Pose, Vector3};

use crate::registration::{OrganizedSurface, SurfacePoint};

use super::surfel::Surfel;

/// Cells along each side of a pixel.
const CELLS: usize = 2;
/// Largest depth difference of surfels of one surface within a pixel or two, as a share of the depth. With a larger
/// difference, one hides the other.
const SAME_SURFACE_SHARE: f64 = 0.01;

/// A surfel in the image of camera 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    /// Image point.
    pub(super) pixel: Pixel,
    /// Depth, metres.
    pub(super) depth_m: f64,
}

/// The model in the image of camera 1 at a pose.
pub(super) struct IndexMap {
    width: usize,
    height: usize,
    /// Index of the surfel in each cell, or [`NONE`].
    cells: Vec<u32>,
    /// Projection of each surfel; `None` if it is outside the image, turned away, or not wanted.
    projections: Vec<Option<Projection>>,
}

const NONE: u32 = u32::MAX;

impl IndexMap {
    /// Projects the surfels that pass `is_wanted`.
    pub(super) fn draw(
        surfels: &[Surfel],
        camera: &Camera,
        cam1_from_model: &Pose,
        is_wanted: impl Fn(&Surfel) -> bool + Sync,
    ) -> Self {
        let [width, height] = [camera.width_px() * CELLS, camera.height_px() * CELLS];
        let project = |surfel: &Surfel| project(surfel, camera, cam1_from_model).filter(|_| is_wanted(surfel));
        let projections: Vec<Option<Projection>> = surfels.par_iter().with_min_len(1024).map(project).collect();
        let mut map = Self { width, height, cells: vec![NONE; width * height], projections };
        for index in 0..map.projections.len() {
            let Some((cell, depth_m)) = map.projections[index].and_then(|p| Some((map.cell_at(&p.pixel)?, p.depth_m)))
            else {
                continue;
            };
            let other = map.cells[cell] as usize;
            let replaces_other = map.projection(other).is_none_or(|seen| {
                let is_same_surface = (depth_m - seen.depth_m).abs() <= SAME_SURFACE_SHARE * depth_m;
                if is_same_surface { surfels[index].weight > surfels[other].weight } else { depth_m < seen.depth_m }
            });
            if replaces_other {
                map.cells[cell] = index as u32;
            }
        }
        map
    }

    /// Returns the projection of a surfel, or `None` if it has none.
    pub(super) fn projection(&self, index: usize) -> Option<&Projection> {
        self.projections.get(index)?.as_ref()
    }

    /// Iterates over the surfels in the cells within a pixel of an image point, with their projections.
    pub(super) fn surfels_near(&self, pixel: &Pixel) -> impl Iterator<Item = (usize, &Projection)> {
        let inside = |x: f64, length: usize| {
            let first = ((x - 0.5) * CELLS as f64).round() as isize;
            let [first, end] = [first, first.saturating_add(2 * CELLS as isize)].map(|cell| cell.max(0) as usize);
            first.min(length)..end.min(length)
        };
        let (columns, rows) = (inside(pixel.x, self.width), inside(pixel.y, self.height));
        let cells = rows.flat_map(move |row| &self.cells[row * self.width..][columns.clone()]);
        cells.filter(|&&i| i != NONE).filter_map(|&i| Some((i as usize, self.projection(i as usize)?)))
    }

    /// Whether another surface lies in front of a projected surfel.
    pub(super) fn is_hidden(&self, seen: &Projection) -> bool {
        let limit_m = seen.depth_m * (1.0 - SAME_SURFACE_SHARE);
        self.surfels_near(&seen.pixel).any(|(_, other)| other.depth_m < limit_m)
    }

    /// Returns the visible surface in the frame of camera 1: for each pixel the surfel nearest to its centre.
    pub(super) fn surface(&self, surfels: &[Surfel], cam1_from_model: &Pose) -> OrganizedSurface {
        let [width, height] = [self.width / CELLS, self.height / CELLS];
        let row_points = |v: usize| {
            let points = (0..width).filter_map(|u| {
                let index = self.foremost(&Pixel::new(u as f64, v as f64))?;
                Some(point(&surfels[index], cam1_from_model, [u, v]))
            });
            points.collect::<Vec<SurfacePoint>>()
        };
        let rows: Vec<Vec<SurfacePoint>> = (0..height).into_par_iter().map(row_points).collect();
        OrganizedSurface::new([width, height], rows.concat())
    }

    /// Returns the surfel of the foremost surface that is nearest to the centre of a pixel.
    fn foremost(&self, pixel: &Pixel) -> Option<usize> {
        let distance = |seen: &Projection| (seen.pixel - pixel).norm_squared();
        let mut best: Option<(usize, &Projection)> = None;
        for (index, seen) in self.surfels_near(pixel) {
            let is_better = best.is_none_or(|(_, other)| {
                let is_same_surface = (seen.depth_m - other.depth_m).abs() <= SAME_SURFACE_SHARE * seen.depth_m;
                if is_same_surface { distance(seen) < distance(other) } else { seen.depth_m < other.depth_m }
            });
            if is_better {
                best = Some((index, seen));
            }
        }
        best.map(|(index, _)| index)
    }

    fn cell_at(&self, pixel: &Pixel) -> Option<usize> {
        let cell = |x: f64| (x + 0.5) * CELLS as f64;
        let (u, v) = (cell(pixel.x), cell(pixel.y));
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then_some(v as usize * self.width + u as usize)
    }
}

fn project(surfel: &Surfel, camera: &Camera, cam1_from_model: &Pose) -> Option<Projection> {
    let position = cam1_from_model * surfel.position;
    let faces_camera = (cam1_from_model.rotation * surfel.normal).dot(&position.coords) < 0.0;
    let pixel = faces_camera.then(|| camera.project(&position))??;
    camera.sees(&pixel).then_some(Projection { pixel, depth_m: position.z })
}

fn point(surfel: &Surfel, cam1_from_model: &Pose, pixel: [usize; 2]) -> SurfacePoint {
    let single = |x: f64| x as f32;
    let position: Point3 = cam1_from_model * surfel.position;
    let normal: Vector3 = cam1_from_model.rotation * surfel.normal;
    SurfacePoint {
        position_m: position.coords.map(single).into(),
        normal: Some(normal.map(single).into()),
        sigma_m: surfel.noise_m() as f32,
        intensity: surfel.intensity as u8,
        cam1_px: pixel.map(|c| c as u16),
    }
}
