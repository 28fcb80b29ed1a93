//! A surface seen by camera 1: at most one point per pixel, with its normal where the surface is smooth.

use fringeflow::geometry::{Point3, Vector3};

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, frame of C1, metres.
    pub position_m: [f32; 3],
    /// Unit normal towards C1; `None` at edges, and if too few points are near.
    pub normal: Option<[f32; 3]>,
    /// Standard deviation along the ray, metres.
    pub sigma_m: f32,
    /// Mean grey level.
    pub intensity: u8,
    /// Pixel of C1: column, row.
    pub cam1_px: [u16; 2],
}

impl SurfacePoint {
    /// Position in the frame of C1, metres.
    #[must_use]
    pub fn position(&self) -> Point3 {
        Point3::from(self.position_m.map(f64::from))
    }

    /// Normal in the frame of C1.
    #[must_use]
    pub fn unit_normal(&self) -> Option<Vector3> {
        self.normal.map(|normal| Vector3::from(normal.map(f64::from)))
    }
}

/// The points of a surface, addressed by their pixel of C1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OrganizedSurface {
    size_px: [usize; 2],
    /// Index of the point of each pixel, row by row, or [`NONE`].
    indices: Vec<u32>,
    points: Vec<SurfacePoint>,
    /// Stride of the columns and rows with normals.
    normal_step_px: usize,
}

/// Returns the stride of columns and rows that keeps about `count` of `points` points; at least 1.
pub(super) fn grid_step(points: usize, count: usize) -> usize {
    ((points as f64 / count.max(1) as f64).sqrt().round() as usize).max(1)
}

/// A pixel without a point.
const NONE: u32 = u32::MAX;

impl OrganizedSurface {
    /// Creates a surface from points with their normals. Of two points at one pixel, the later one stays.
    pub(crate) fn new(size_px: [usize; 2], points: impl IntoIterator<Item = SurfacePoint>) -> Self {
        let [width, height] = size_px;
        let points = points.into_iter();
        let storage = Vec::with_capacity(points.size_hint().0);
        let mut surface = Self { size_px, indices: vec![NONE; width * height], points: storage, normal_step_px: 1 };
        for point in points {
            let [u, v] = point.cam1_px.map(usize::from);
            let is_measured = point.position_m[2] > 0.0 && point.sigma_m.is_finite();
            if u < width && v < height && is_measured {
                surface.indices[v * width + u] = surface.points.len() as u32;
                surface.points.push(point);
            }
        }
        surface
    }

    /// Sets the normals of points, by index. They stand in every `step_px`-th column and row.
    pub(super) fn set_normals(&mut self, step_px: usize, normals: impl IntoIterator<Item = (u32, [f32; 3])>) {
        self.normal_step_px = step_px;
        for (index, normal) in normals {
            self.points[index as usize].normal = Some(normal);
        }
    }

    /// Stride of the columns and rows with normals.
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

    /// Returns the point of a pixel, or `None` if the pixel has none or is outside the image.
    #[must_use]
    pub fn at(&self, column: isize, row: isize) -> Option<&SurfacePoint> {
        let index = self.point_index(usize::try_from(column).ok()?, usize::try_from(row).ok()?)?;
        Some(&self.points[index as usize])
    }

    /// Returns the index of the point of a pixel, or `None` if the pixel has none or is outside the image.
    pub(super) fn point_index(&self, column: usize, row: usize) -> Option<u32> {
        let [width, height] = self.size_px;
        let index = (column < width && row < height).then(|| self.indices[row * width + column])?;
        (index != NONE).then_some(index)
    }

    /// Iterates over the points of a row by column. A row outside the image has none.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = Option<&SurfacePoint>> {
        let width = self.size_px[0];
        let indices = self.indices.get(row * width..(row + 1) * width).unwrap_or_default();
        indices.iter().map(|&index| self.points.get(index as usize))
    }

    /// Mean of the points in the frame of C1, metres; the origin if there are none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        let sum: Vector3 = self.points.iter().map(|p| p.position().coords).sum();
        Point3::from(sum / self.points.len().max(1) as f64)
    }
}
