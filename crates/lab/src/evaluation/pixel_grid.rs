//! A cloud organized by the pixels of C1.

use fringeflow::cloud::{Cloud, CloudPoint};
use fringeflow::geometry::{Pixel, Point3};

use super::{EDGE_TOLERANCE_PX, EvaluationError, TOLERANCE_PX};

/// The points of a cloud by their pixel of C1.
pub(super) struct PixelGrid<'a> {
    width: usize,
    height: usize,
    points: Vec<Option<&'a CloudPoint>>,
}

impl<'a> PixelGrid<'a> {
    pub(super) fn new(cloud: &'a Cloud, [width, height]: [usize; 2]) -> Result<Self, EvaluationError> {
        let mut points = vec![None; width * height];
        for point in &cloud.points {
            let [u, v] = point.cam1_px;
            if usize::from(u) >= width || usize::from(v) >= height {
                return Err(EvaluationError::OutsideImage { u, v, width, height });
            }
            points[usize::from(v) * width + usize::from(u)] = Some(point);
        }
        Ok(Self { width, height, points })
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    pub(super) fn get(&self, pixel: usize) -> Option<&'a CloudPoint> {
        self.points[pixel]
    }

    /// Returns the index of the pixel whose centre is closest to a point of C1, clamped to the image.
    pub(super) fn index_of(&self, cam1_px: &Pixel) -> usize {
        let clamp = |x: f64, size: usize| x.round_ties_even().clamp(0.0, size as f64 - 1.0) as usize;
        clamp(cam1_px.y, self.height) * self.width + clamp(cam1_px.x, self.width)
    }

    /// Centre of a pixel.
    pub(super) fn centre(&self, pixel: usize) -> Pixel {
        Pixel::new((pixel % self.width) as f64, (pixel / self.width) as f64)
    }

    /// Whether a point of C2 lies near the true correspondence of the pixel or of one of its eight neighbours.
    pub(super) fn is_explained(&self, pixel: usize, cam2_px: &Pixel, truth: impl Fn(usize) -> Option<Pixel>) -> bool {
        let (u, v) = (pixel % self.width, pixel / self.width);
        let rows = v.saturating_sub(1)..=(v + 1).min(self.height - 1);
        let columns = u.saturating_sub(1)..=(u + 1).min(self.width - 1);
        rows.flat_map(|row| columns.clone().map(move |column| row * self.width + column))
            .filter_map(truth)
            .any(|q| (cam2_px - q).norm() <= EDGE_TOLERANCE_PX)
    }
}

/// Converts a stored image point to a [`Pixel`].
pub(super) fn pixel(stored: [f32; 2]) -> Pixel {
    Pixel::from(stored.map(f64::from))
}

/// Whether a point of C2 agrees with the reference; false if the reference is NaN.
pub(super) fn is_close(cam2_px: &Pixel, reference: [f32; 2]) -> bool {
    (cam2_px - pixel(reference)).norm() <= TOLERANCE_PX
}

/// Converts a stored 3D point to a [`Point3`] in metres. Its unit is `unit_m` metres.
pub(super) fn point(stored: [f32; 3], unit_m: f64) -> Point3 {
    Point3::from(stored.map(|x| f64::from(x) * unit_m))
}
