//! A surface seen by camera 1: at most one point per pixel, with its normal where the surface is smooth.

use fringeflow::cloud::Cloud;
use fringeflow::geometry::{Point3, Vector3};

use super::normals::normals;

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, frame of C1, metres.
    pub position_m: [f32; 3],
    /// Normal towards C1, length 1; `None` at edges and where too few points are near.
    pub normal: Option<[f32; 3]>,
    /// Standard deviation along the ray, metres.
    pub sigma_m: f32,
    /// Mean grey level.
    pub intensity: u8,
    /// Pixel of C1: column, row.
    pub cam1_px: [u16; 2],
}

impl SurfacePoint {
    /// The position, frame of C1, metres.
    #[must_use]
    pub fn position(&self) -> Point3 {
        Point3::from(self.position_m.map(f64::from))
    }

    /// The normal, frame of C1.
    #[must_use]
    pub fn unit_normal(&self) -> Option<Vector3> {
        self.normal.map(|normal| Vector3::from(normal.map(f64::from)))
    }
}

/// Points by their pixel of C1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OrganizedSurface {
    size_px: [usize; 2],
    /// Index of the point of every pixel, row by row, or [`NONE`].
    places: Vec<u32>,
    points: Vec<SurfacePoint>,
    /// Normals were computed in every `normal_step_px`-th column and row.
    normal_step_px: usize,
}

/// Stride of columns and rows that keeps about `count` of `points` points; at least 1.
pub(super) fn grid_step(points: usize, count: usize) -> usize {
    ((points as f64 / count.max(1) as f64).sqrt().round() as usize).max(1)
}

/// A pixel without a point.
const NONE: u32 = u32::MAX;

impl OrganizedSurface {
    /// A cloud of C1 with images of `size_px` (width, height), and the normals from its pixel grid.
    ///
    /// Points outside the image are left out, as are those that do not lie in front of the camera.
    #[must_use]
    pub fn from_cloud(cloud: &Cloud, size_px: [usize; 2]) -> Self {
        let mut surface = Self::without_normals(cloud, size_px);
        surface.compute_normals(1);
        surface
    }

    /// [`Self::from_cloud`] with normals of about `count` points only, on a regular grid of pixels: enough for a
    /// registration, in part of the time.
    #[must_use]
    pub fn sampled(cloud: &Cloud, size_px: [usize; 2], count: usize) -> Self {
        let mut surface = Self::without_normals(cloud, size_px);
        let step_px = grid_step(surface.points.len(), count);
        surface.compute_normals(step_px);
        surface
    }

    fn without_normals(cloud: &Cloud, size_px: [usize; 2]) -> Self {
        let points = cloud.points.iter().map(|p| SurfacePoint {
            position_m: p.position_m,
            normal: None,
            sigma_m: p.sigma_m,
            intensity: p.intensity,
            cam1_px: p.cam1_px,
        });
        Self::new(size_px, points)
    }

    fn compute_normals(&mut self, step_px: usize) {
        self.normal_step_px = step_px;
        for (index, normal) in normals(self, step_px).into_iter().flatten() {
            self.points[index as usize].normal = Some(normal);
        }
    }

    /// Points with their normals; of two at a pixel the later one stays.
    pub(crate) fn new(size_px: [usize; 2], points: impl IntoIterator<Item = SurfacePoint>) -> Self {
        let [width, height] = size_px;
        let points = points.into_iter();
        let scratch = Vec::with_capacity(points.size_hint().0);
        let mut surface = Self { size_px, places: vec![NONE; width * height], points: scratch, normal_step_px: 1 };
        for point in points {
            let [u, v] = point.cam1_px.map(usize::from);
            let is_measured = point.position_m[2] > 0.0 && point.sigma_m.is_finite();
            if u < width && v < height && is_measured {
                surface.places[v * width + u] = surface.points.len() as u32;
                surface.points.push(point);
            }
        }
        surface
    }

    /// Columns and rows from one normal to the next.
    pub(super) fn normal_step_px(&self) -> usize {
        self.normal_step_px
    }

    /// Width and height of the image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// All points.
    #[must_use]
    pub fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// The point of a pixel; `None` where there is none or outside the image.
    #[must_use]
    pub fn at(&self, column: isize, row: isize) -> Option<&SurfacePoint> {
        let place = self.place(usize::try_from(column).ok()?, usize::try_from(row).ok()?)?;
        Some(&self.points[place as usize])
    }

    /// Index of the point of a pixel; `None` where there is none or outside the image.
    pub(super) fn place(&self, column: usize, row: usize) -> Option<u32> {
        let [width, height] = self.size_px;
        let place = (column < width && row < height).then(|| self.places[row * width + column])?;
        (place != NONE).then_some(place)
    }

    /// The points of a row by column; none outside the image.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = Option<&SurfacePoint>> {
        let width = self.size_px[0];
        let places = self.places.get(row * width..(row + 1) * width).unwrap_or_default();
        places.iter().map(|&place| self.points.get(place as usize))
    }

    /// Mean of the points, frame of C1, metres; the origin for none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        let sum: Vector3 = self.points.iter().map(|p| p.position().coords).sum();
        Point3::from(sum / self.points.len().max(1) as f64)
    }
}
