//! The epipolar frame of C2: a virtual, distortion-free camera at the centre of C2 whose rows are epipolar lines
//! (paper, section 2.1).
//!
//! In: a rig. Out: the row and the columns of the epipolar line of any ray of C1. Cost: a matrix times a vector per
//! ray.
//!
//! In this frame the search for a correspondence runs along a row, and inverse depth is linear in the column. The
//! distortion of C2 is undone once per image instead of once per candidate. C1 is not resampled: each of its raw pixels
//! has a row (a real number) of its own.

use nalgebra::{Matrix3, Rotation3};

use super::{Camera, Pixel, Point3, Rig, Vector3};

/// Least cosine between a viewing ray of C2 and the axis of the epipolar frame; below it (75°) the frame would stretch
/// the image beyond use.
const MIN_COSINE: f64 = 0.26;

/// Virtual camera with the centre of C2 and rows along the base.
#[derive(Clone, Debug, PartialEq)]
pub struct EpipolarFrame {
    pub(super) focal_px: f64,
    pub(super) principal_px: Pixel,
    width_px: usize,
    height_px: usize,
    pub(super) epipolar_from_cam2: Rotation3<f64>,
    pub(super) epipolar_from_cam1: Rotation3<f64>,
    /// Position of C1's centre along the rows, metres, signed.
    pub(super) base_m: f64,
    pub(super) cam2: Camera,
}

/// The epipolar line of one pixel of C1: a row, and the column as a function of inverse depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpipolarLine {
    /// Row in the epipolar frame, pixels.
    pub row_px: f64,
    /// Column of a point at infinite depth, pixels.
    pub column_at_infinity_px: f64,
    /// Column per inverse depth, pixel · metre.
    pub column_per_inverse_depth: f64,
}

/// Why a rig has no epipolar frame.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EpipolarError {
    /// The two cameras have the same centre.
    #[error("cameras 1 and 2 are {base_m:e} m apart, too close together to triangulate; check T2 and the unit")]
    NoBase {
        /// Length of the base, metres.
        base_m: f64,
    },
    /// C2 looks along the base.
    #[error(
        "camera 2 looks along the base (to {angle_deg:.0}°), so epipolar lines do not cross its image; check R2 and T2"
    )]
    LooksAlongBase {
        /// Smallest angle between a viewing ray of C2 and the base, degrees.
        angle_deg: f64,
    },
    /// The distortion of C2 has no inverse at its border.
    #[error("the distortion D2 has no inverse at pixel ({u_px}, {v_px}) of camera 2")]
    NotInvertible {
        /// Column, pixels.
        u_px: f64,
        /// Row, pixels.
        v_px: f64,
    },
}

impl EpipolarFrame {
    /// The epipolar frame of a rig. It holds the whole image of C2 at its own scale.
    ///
    /// # Errors
    /// No base, C2 looking along the base, or a distortion without inverse.
    pub fn new(rig: &Rig) -> Result<Self, EpipolarError> {
        let base = rig.cam2_from_cam1.translation.vector;
        let base_m = base.norm();
        if base_m.is_nan() || base_m < 1e-6 {
            return Err(EpipolarError::NoBase { base_m });
        }
        let epipolar_from_cam2 = rows_along(&(base / base_m));
        let [fx, fy] = rig.cam2.focal_px();
        let mut frame = Self {
            focal_px: (fx * fy).sqrt(),
            principal_px: Pixel::origin(),
            width_px: 0,
            height_px: 0,
            epipolar_from_cam1: epipolar_from_cam2 * rig.cam2_from_cam1.rotation.to_rotation_matrix(),
            base_m: (epipolar_from_cam2 * base).x,
            epipolar_from_cam2,
            cam2: rig.cam2,
        };
        frame.fit_to_image()?;
        Ok(frame)
    }

    /// Sets principal point and size so that the image of C2 just fits.
    fn fit_to_image(&mut self) -> Result<(), EpipolarError> {
        let (mut min, mut max) =
            (Pixel::new(f64::INFINITY, f64::INFINITY), Pixel::new(f64::NEG_INFINITY, f64::NEG_INFINITY));
        for pixel in border(&self.cam2) {
            let ray = self.cam2.ray(&pixel).ok_or(EpipolarError::NotInvertible { u_px: pixel.x, v_px: pixel.y })?;
            let a = self.epipolar_from_cam2 * ray;
            if a.z < MIN_COSINE * a.norm() {
                return Err(EpipolarError::LooksAlongBase { angle_deg: (a.z / a.norm()).asin().to_degrees().max(0.0) });
            }
            let (x, y) = (self.focal_px * a.x / a.z, self.focal_px * a.y / a.z);
            (min, max) = (Pixel::new(min.x.min(x), min.y.min(y)), Pixel::new(max.x.max(x), max.y.max(y)));
        }
        self.principal_px = Pixel::new(-min.x.floor(), -min.y.floor());
        self.width_px = (max.x - min.x.floor()).ceil() as usize + 1;
        self.height_px = (max.y - min.y.floor()).ceil() as usize + 1;
        Ok(())
    }

    /// Columns of the frame, pixels.
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Rows of the frame, pixels.
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Epipolar line of a ray of C1 (direction with `z = 1`); `None` where the whole ray is behind the frame.
    #[must_use]
    pub fn line(&self, ray_cam1: &Vector3) -> Option<EpipolarLine> {
        let a = self.epipolar_from_cam1 * ray_cam1;
        (a.z > 1e-6).then(|| EpipolarLine {
            row_px: self.focal_px * a.y / a.z + self.principal_px.y,
            column_at_infinity_px: self.focal_px * a.x / a.z + self.principal_px.x,
            column_per_inverse_depth: self.focal_px * self.base_m / a.z,
        })
    }

    /// Raw image point of C2 at a point of the frame; `None` beyond the radius at which the distortion folds back.
    #[must_use]
    pub fn cam2_pixel(&self, place: &Pixel) -> Option<Pixel> {
        let offset = (place - self.principal_px) / self.focal_px;
        let ray = self.epipolar_from_cam2.inverse() * Vector3::new(offset.x, offset.y, 1.0);
        self.cam2.project(&Point3::from(ray))
    }
}

impl EpipolarLine {
    /// Column of the point at a depth (z in the frame of C1, metres).
    #[must_use]
    pub fn column_of_depth(&self, depth_m: f64) -> f64 {
        self.column_at_infinity_px + self.column_per_inverse_depth / depth_m
    }

    /// Depth (z in the frame of C1, metres) of the point seen at a column; infinite or negative where the rays diverge.
    #[must_use]
    pub fn depth_of_column(&self, column_px: f64) -> f64 {
        self.column_per_inverse_depth / (column_px - self.column_at_infinity_px)
    }
}

/// Rotation into a frame whose x axis is the base and whose z axis is as close to the optical axis as possible.
///
/// x points like the image axis closest to the base, so rows run in the same sense as in the raw image.
fn rows_along(base: &Vector3) -> Rotation3<f64> {
    let along = if base.x.abs() >= base.y.abs() { base.x } else { base.y };
    let x = if along < 0.0 { -base } else { *base };
    let axis = Vector3::z() - x * x.z;
    let z = axis.try_normalize(1e-9).unwrap_or_else(Vector3::y);
    let y = z.cross(&x);
    Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]))
}

/// Points along the border of an image, eight pixels apart, corners included.
fn border(camera: &Camera) -> impl Iterator<Item = Pixel> {
    let (right, bottom) = (camera.width_px() as f64 - 1.0, camera.height_px() as f64 - 1.0);
    let steps = camera.width_px().max(camera.height_px()) / 8 + 1;
    (0..=steps).flat_map(move |i| {
        let t = i as f64 / steps as f64;
        [(t * right, 0.0), (t * right, bottom), (0.0, t * bottom), (right, t * bottom)].map(|(u, v)| Pixel::new(u, v))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, rig};

    fn rig(translation: Vector3, turn: Vector3) -> Rig {
        rig::tests::rig(Pose::new(translation, turn), &[-0.15, 0.2, -0.002, 0.0016])
    }

    #[test]
    fn a_point_of_the_scene_lies_on_its_line_at_its_depth() {
        let toed_in = (Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.38, -0.02));
        let stacked = (Vector3::new(0.002, -0.1, 0.01), Vector3::new(-0.3, 0.0, 0.0));
        for (translation, turn) in [toed_in, stacked] {
            let rig = rig(translation, turn);
            let frame = EpipolarFrame::new(&rig).unwrap();
            for (u, v, depth) in [(100.0, 80.0, 0.29), (320.0, 256.0, 0.31), (500.0, 400.0, 0.33)] {
                let ray = rig.cam1.ray(&Pixel::new(u, v)).unwrap();
                let line = frame.line(&ray).unwrap();
                let column = line.column_of_depth(depth);
                let seen = rig.project_cam2(&Point3::from(ray * depth)).unwrap();
                let raw = frame.cam2_pixel(&Pixel::new(column, line.row_px)).unwrap();
                assert!((raw - seen).norm() < 1e-6, "{raw} {seen}");
                assert!((line.depth_of_column(column) - depth).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn rigs_without_a_base_or_looking_along_it_are_refused() {
        let same_place = rig(Vector3::zeros(), Vector3::zeros());
        assert!(matches!(EpipolarFrame::new(&same_place), Err(EpipolarError::NoBase { .. })));
        let behind = rig(Vector3::new(0.0, 0.0, 0.1), Vector3::zeros());
        assert!(matches!(EpipolarFrame::new(&behind), Err(EpipolarError::LooksAlongBase { .. })));
    }
}
