//! Which surfel camera 1 would see where: the model, drawn into its image.
//!
//! Four cells a pixel, so that neighbouring surfels seldom fall into one. Of two in a cell the nearer stays, or on one
//! surface the better measured: always taking the nearer would draw the model towards the camera, by the noise of its worst.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Pixel, Point3, Pose, Vector3};

use crate::registration::{OrganizedSurface, SurfacePoint};

use super::surfel::Surfel;

/// Cells along each side of a pixel.
const CELLS: usize = 2;
/// Depth by which surfels of one surface may differ within a pixel or two, as a share of the depth; what is further hides
/// or is hidden.
const SAME_SURFACE_SHARE: f64 = 0.01;

/// Where camera 1 sees a surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Image point.
    pub(super) pixel: Pixel,
    /// Depth, metres.
    pub(super) depth_m: f64,
}

/// The model as camera 1 sees it from a pose.
pub(super) struct IndexMap {
    width: usize,
    height: usize,
    /// Surfel of every cell, or [`NONE`].
    cells: Vec<u32>,
    /// Where each surfel is seen; `None` for those beyond the image, or turned away.
    seen: Vec<Option<Seen>>,
}

const NONE: u32 = u32::MAX;

impl IndexMap {
    /// Draws the surfels that are wanted.
    pub(super) fn draw(
        surfels: &[Surfel],
        camera: &Camera,
        cam1_from_model: &Pose,
        wanted: impl Fn(&Surfel) -> bool + Sync,
    ) -> Self {
        let [width, height] = [camera.width_px() * CELLS, camera.height_px() * CELLS];
        let look = |surfel: &Surfel| look_at(surfel, camera, cam1_from_model).filter(|_| wanted(surfel));
        let seen: Vec<Option<Seen>> = surfels.par_iter().with_min_len(1024).map(look).collect();
        let mut map = Self { width, height, cells: vec![NONE; width * height], seen };
        for place in 0..map.seen.len() {
            let Some((cell, depth_m)) = map.seen[place].and_then(|s| Some((map.cell_of(&s.pixel)?, s.depth_m))) else {
                continue;
            };
            let before = map.cells[cell] as usize;
            let is_before = map.seen(before).is_none_or(|other| {
                let is_same_surface = (depth_m - other.depth_m).abs() <= SAME_SURFACE_SHARE * depth_m;
                if is_same_surface { surfels[place].weight > surfels[before].weight } else { depth_m < other.depth_m }
            });
            if is_before {
                map.cells[cell] = place as u32;
            }
        }
        map
    }

    /// Where a surfel is seen.
    pub(super) fn seen(&self, place: usize) -> Option<&Seen> {
        self.seen.get(place)?.as_ref()
    }

    /// The surfels in the cells that lie within a pixel of an image point, and where they are seen.
    pub(super) fn around(&self, pixel: &Pixel) -> impl Iterator<Item = (usize, &Seen)> {
        let inside = |x: f64, length: usize| {
            let first = ((x - 0.5) * CELLS as f64).round() as isize;
            let [first, end] = [first, first.saturating_add(2 * CELLS as isize)].map(|cell| cell.max(0) as usize);
            first.min(length)..end.min(length)
        };
        let (columns, rows) = (inside(pixel.x, self.width), inside(pixel.y, self.height));
        let cells = rows.flat_map(move |row| &self.cells[row * self.width..][columns.clone()]);
        cells.filter(|&&place| place != NONE).filter_map(|&place| Some((place as usize, self.seen(place as usize)?)))
    }

    /// Whether a surface stands before a place that is seen.
    pub(super) fn hides(&self, seen: &Seen) -> bool {
        self.around(&seen.pixel).any(|(_, other)| other.depth_m < seen.depth_m * (1.0 - SAME_SURFACE_SHARE))
    }

    /// The surface that camera 1 sees, in its own frame: of each pixel the surfel next to its centre.
    pub(super) fn surface(&self, surfels: &[Surfel], cam1_from_model: &Pose) -> OrganizedSurface {
        let [width, height] = [self.width / CELLS, self.height / CELLS];
        let of_row = |v: usize| {
            let points = (0..width).filter_map(|u| {
                let place = self.nearest(&Pixel::new(u as f64, v as f64))?;
                Some(point(&surfels[place], cam1_from_model, [u, v]))
            });
            points.collect::<Vec<SurfacePoint>>()
        };
        let rows: Vec<Vec<SurfacePoint>> = (0..height).into_par_iter().map(of_row).collect();
        OrganizedSurface::new([width, height], rows.concat())
    }

    /// The surfel of the foremost surface that is seen next to a pixel's centre.
    fn nearest(&self, pixel: &Pixel) -> Option<usize> {
        let distance = |seen: &Seen| (seen.pixel - pixel).norm_squared();
        let mut best: Option<(usize, &Seen)> = None;
        for (place, seen) in self.around(pixel) {
            let is_better = best.is_none_or(|(_, other)| {
                let is_same_surface = (seen.depth_m - other.depth_m).abs() <= SAME_SURFACE_SHARE * seen.depth_m;
                if is_same_surface { distance(seen) < distance(other) } else { seen.depth_m < other.depth_m }
            });
            if is_better {
                best = Some((place, seen));
            }
        }
        best.map(|(place, _)| place)
    }

    fn cell_of(&self, pixel: &Pixel) -> Option<usize> {
        let cell = |x: f64| (x + 0.5) * CELLS as f64;
        let (u, v) = (cell(pixel.x), cell(pixel.y));
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then_some(v as usize * self.width + u as usize)
    }
}

fn look_at(surfel: &Surfel, camera: &Camera, cam1_from_model: &Pose) -> Option<Seen> {
    let place = cam1_from_model * surfel.position;
    let is_towards = (cam1_from_model.rotation * surfel.normal).dot(&place.coords) < 0.0;
    let pixel = is_towards.then(|| camera.project(&place))??;
    camera.sees(&pixel).then_some(Seen { pixel, depth_m: place.z })
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
