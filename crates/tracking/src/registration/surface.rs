//! A surface seen by camera 1: at most one point per pixel, with its normal where the surface is smooth.
//!
//! What every step needs of a pixel lies together; the other properties are planes of the image. A surface keeps its
//! memory from cloud to cloud.

use std::borrow::Borrow;

use fringeflow::cloud::{CloudPoint, MeasuredPixel, Normals, PointImage};
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
        point_of(self.position_m)
    }

    /// Normal in the frame of C1.
    #[must_use]
    pub fn unit_normal(&self) -> Option<Vector3> {
        self.normal.map(|normal| point_of(normal).coords)
    }
}

/// A point from single precision.
pub(crate) fn point_of([x, y, z]: [f32; 3]) -> Point3 {
    Point3::new(f64::from(x), f64::from(y), f64::from(z))
}

/// The points of a surface, addressed by their pixel of C1.
#[derive(Clone, Debug, Default)]
pub struct OrganizedSurface {
    points: PointImage,
    intensity: Vec<u8>,
    /// Unit normals towards C1; the first component is NaN if there is none.
    normals: [Vec<f32>; 3],
    count: usize,
    centre: Point3,
}

impl OrganizedSurface {
    /// Replaces the surface by the points of a cloud of C1 with images of `size_px` (width, height), without normals.
    ///
    /// Skips points outside the image, and points that are not in front of the camera. Of two points at one pixel, the
    /// later one stays.
    pub fn organize(&mut self, cloud: impl IntoIterator<Item: Borrow<CloudPoint>>, size_px: [usize; 2]) {
        self.clear(size_px);
        let (mut sum, mut count) = (Vector3::zeros(), 0_usize);
        for point in cloud {
            let point = point.borrow();
            if let Some(index) = self.points.put(point) {
                self.intensity[index] = point.intensity;
                count += 1;
                sum += point_of(point.position_m).coords;
            }
        }
        self.count = count;
        self.centre = Point3::from(sum / count.max(1) as f64);
    }

    /// Removes all points.
    fn clear(&mut self, size_px: [usize; 2]) {
        let Self { points, intensity, normals, .. } = self;
        points.clear(size_px);
        let pixels = points.pixels.len();
        intensity.resize(pixels, 0);
        normals.iter_mut().for_each(|plane| plane.resize(pixels, f32::NAN));
        normals[0].fill(f32::NAN);
    }

    /// Computes the normals of all points that have one.
    pub fn compute_normals(&mut self, normals: &mut Normals) {
        normals.compute(&self.points, &mut self.normals);
    }

    /// Width and height of the image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        self.points.size_px
    }

    /// Number of points.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// All depths, row by row, metres; NaN for pixels without a point.
    pub(crate) fn depths_m(&self) -> impl Iterator<Item = f32> {
        self.points.pixels.iter().map(|&[_, _, depth_m, _]| depth_m)
    }

    /// Returns the point of a pixel, or `None` if the pixel has none or is outside the image.
    #[inline]
    pub(crate) fn at(&self, column: isize, row: isize) -> Option<SurfacePoint> {
        self.point(self.index(column, row)?, [column as u16, row as u16])
    }

    /// Number of points with a normal.
    pub(crate) fn normal_count(&self) -> usize {
        let has_normal = |(depth, normal): &(f32, &f32)| !depth.is_nan() && !normal.is_nan();
        self.depths_m().zip(&self.normals[0]).filter(has_normal).count()
    }

    /// Iterates over the points of a row, from left to right.
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = SurfacePoint> {
        let width = self.points.size_px[0];
        (0..width).filter_map(move |column| self.point(row * width + column, [column as u16, row as u16]))
    }

    /// Returns the depth of a pixel, metres, or `None` if the pixel has no point or is outside the image.
    pub(crate) fn depth_at(&self, column: isize, row: isize) -> Option<f32> {
        self.measured_at(column, row).map(|[_, _, depth_m, _]| depth_m)
    }

    /// Returns position and standard deviation of a pixel, as [`Self::at`], but reads no more than them.
    #[inline]
    pub(super) fn measured_at(&self, column: isize, row: isize) -> Option<MeasuredPixel> {
        let pixel @ [_, _, depth_m, _] = self.points.pixels[self.index(column, row)?];
        (!depth_m.is_nan()).then_some(pixel)
    }

    /// Returns a normal towards C1 from the points two pixels beside a pixel, or from its `own` point in the place of a
    /// missing one. It has any length, and 0 if too many are missing.
    pub(super) fn rough_normal(&self, [column, row]: [isize; 2], own: Vector3) -> Vector3 {
        let place = |[x, y, z, _]: MeasuredPixel| point_of([x, y, z]).coords;
        let beside = |columns: isize, rows: isize| self.measured_at(column + columns, row + rows).map_or(own, place);
        (beside(0, 2) - beside(0, -2)).cross(&(beside(2, 0) - beside(-2, 0)))
    }

    /// Starts to load what [`Self::measured_at`] reads into the cache.
    pub(super) fn prefetch(&self, [column, row]: [isize; 2]) {
        if let Some(index) = self.index(column, row) {
            fringeflow_simd::prefetch(&self.points.pixels, index);
        }
    }

    fn index(&self, column: isize, row: isize) -> Option<usize> {
        let [width, height] = self.points.size_px;
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < width && row < height).then_some(row * width + column)
    }

    #[inline]
    fn point(&self, index: usize, cam1_px: [u16; 2]) -> Option<SurfacePoint> {
        let [x, y, z, sigma_m] = self.points.pixels[index];
        let [a, b, c] = &self.normals;
        (!z.is_nan()).then(|| SurfacePoint {
            position_m: [x, y, z],
            normal: (!a[index].is_nan()).then(|| [a[index], b[index], c[index]]),
            sigma_m,
            intensity: self.intensity[index],
            cam1_px,
        })
    }

    /// Mean of the points in the frame of C1, metres; the origin if there are none.
    #[must_use]
    pub fn centre(&self) -> Point3 {
        self.centre
    }
}
