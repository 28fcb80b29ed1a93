//! Points that both cameras see under one column of the projector, from phase and Gray code.
//!
//! In: both cameras, and the column at each pixel of each. Out: pairs of image points. Along the epipolar line of a pixel of
//! C1 the column in C2 passes its column where the same point is seen; a pixel for which it does so more than once is left
//! out. No projector is needed. Cost: for each pixel some thousand looks at C2.

use fringeflow::geometry::{Camera, Pixel, Point3, Pose, Vector3};
use fringeflow_dataset::GreyImage;
use nalgebra::Vector2;
use rayon::prelude::*;

use super::ScanPoint;
use crate::images::{Coordinates, PatternOrder};

/// Distance of the pixels of C1 that are looked at, pixels.
const STRIDE_PX: usize = 6;
/// Distances from C1 that are looked at, in lengths of the base.
const DISTANCES: [f64; 2] = [0.7, 30.0];
/// Looks along an epipolar line.
const LOOKS: usize = 4000;
/// Neighbouring looks are at most this far apart in C2, pixels.
const FAR_PX: f64 = 2.0;
/// Columns of neighbouring looks differ by at most this much on one surface, pixels of the projector.
const STEEP_PX: f64 = 6.0;

/// The projector's columns in the images of both cameras.
pub struct ScanColumns {
    sizes_px: [[usize; 2]; 2],
    cameras: [Coordinates; 2],
}

impl ScanColumns {
    /// Decodes the columns of a scene at rest. `images` are those of each camera in the order of the patterns; `None` if
    /// they have different sizes.
    #[must_use]
    pub fn decode(images: &[Vec<GreyImage>; 2], order: &PatternOrder) -> Option<Self> {
        let decode = |camera: usize| {
            let first = images[camera].first()?;
            Some(([first.width, first.height], Coordinates::decode(&images[camera], order, order.columns())?))
        };
        let ((size1, cam1), (size2, cam2)) = (decode(0)?, decode(1)?);
        Some(Self { sizes_px: [size1, size2], cameras: [cam1, cam2] })
    }

    /// Width and height of the images of both cameras, pixels.
    #[must_use]
    pub fn sizes_px(&self) -> [[usize; 2]; 2] {
        self.sizes_px
    }

    fn at(&self, camera: usize, u: usize, v: usize) -> Option<f64> {
        self.cameras[camera].at(v * self.sizes_px[camera][0] + u).map(|(column_px, _)| column_px)
    }

    /// The column at an image point of C2, between the pixels of its row.
    fn in_cam2(&self, pixel: &Pixel) -> Option<f64> {
        let [width, height] = self.sizes_px[1];
        let (u, v) = (pixel.x.floor(), pixel.y.round());
        if u < 0.0 || v < 0.0 || u + 1.0 >= width as f64 || v >= height as f64 {
            return None;
        }
        let (a, b) = (self.at(1, u as usize, v as usize)?, self.at(1, u as usize + 1, v as usize)?);
        ((a - b).abs() <= STEEP_PX).then(|| a + (b - a) * (pixel.x - u))
    }
}

/// Finds the points.
#[must_use]
pub fn common_points(cam1: &Camera, cam2: &Camera, cam2_from_cam1: &Pose, columns: &ScanColumns) -> Vec<ScanPoint> {
    let [width, height] = columns.sizes_px[0];
    let rows: Vec<usize> = (0..height).step_by(STRIDE_PX).collect();
    let found = rows.par_iter().map(|&v| {
        let pixels = (0..width).step_by(STRIDE_PX);
        let points = pixels.filter_map(|u| {
            let column_px = columns.at(0, u, v)?;
            let cam1_px = Pixel::new(u as f64, v as f64);
            let ray = cam1.ray(&cam1_px)?;
            let cam2_px = crossing(cam2, cam2_from_cam1, &ray, column_px, columns)?;
            Some(ScanPoint { cam1_px, cam2_px, column_px })
        });
        points.collect::<Vec<_>>()
    });
    found.collect::<Vec<_>>().concat()
}

/// The only place along a ray where C2 sees a column.
fn crossing(
    cam2: &Camera,
    cam2_from_cam1: &Pose,
    ray: &Vector3,
    column_px: f64,
    columns: &ScanColumns,
) -> Option<Pixel> {
    let base_m = cam2_from_cam1.translation.vector.norm();
    let [near, far] = DISTANCES.map(|distance| 1.0 / (distance * base_m));
    let mut found = None;
    let mut last: Option<(Pixel, f64)> = None;
    for look in 0..LOOKS {
        // Evenly in inverse distance, which is about evenly in the image of C2.
        let inverse = far + (near - far) * look as f64 / (LOOKS - 1) as f64;
        let here = cam2
            .project(&(cam2_from_cam1 * Point3::from(ray / inverse)))
            .and_then(|pixel| Some((pixel, columns.in_cam2(&pixel)? - column_px)));
        if let (Some((a, before)), Some((b, now))) = (last, here) {
            let step: Vector2<f64> = b - a;
            let is_one_surface = step.norm() <= FAR_PX && (now - before).abs() <= STEEP_PX;
            if is_one_surface && before.signum() != now.signum() {
                if found.is_some() {
                    return None;
                }
                found = Some(a + step * (before / (before - now)));
            }
        }
        last = here;
    }
    found
}
