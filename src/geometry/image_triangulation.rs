//! Triangulation of whole images: depth and raw image point in C2 of every correspondence (paper, section 2.1).
//!
//! In: a ray of C1 and a point of the epipolar frame. Out: a [`TriangulatedPixel`]. Cost: some seventy operations in
//! `f32`, free of branches, so that the compiler vectorizes loops of it.

use super::EpipolarFrame;

/// An [`EpipolarFrame`] in `f32`, for triangulating whole images.
///
/// Columns are exact to 6e-5 px and depths to some 1e-7 of their value. That is a thousandth of the error that camera
/// noise causes. Calibration is judged in `f64`, by [`EpipolarFrame`] itself.
#[derive(Clone, Copy, Debug)]
pub struct ImageTriangulation {
    /// x and z axes of the epipolar frame in the frame of C1.
    epipolar_x: [f32; 3],
    epipolar_z: [f32; 3],
    focal_px: f32,
    per_focal: f32,
    principal_px: [f32; 2],
    /// Focal length times base, pixel · metre.
    focal_times_base: f32,
    /// Rotation from the epipolar frame to C2.
    cam2_from_epipolar: [[f32; 3]; 3],
    cam2: Lens,
}

/// Intrinsic parameters of C2.
#[derive(Clone, Copy, Debug)]
struct Lens {
    focal_px: [f32; 2],
    principal_px: [f32; 2],
    skew_px: f32,
    /// Coefficients of r², r⁴ and r⁶ in numerator and denominator.
    radial: [f32; 3],
    rational: [f32; 3],
    tangential: [f32; 2],
    thin_prism: [f32; 4],
    /// Square of the largest invertible radius, z = 1.
    max_r2: f32,
}

/// Where a correspondence lies.
#[derive(Clone, Copy, Debug)]
pub struct TriangulatedPixel {
    /// Depth, z in the frame of C1, metres; negative or infinite where the rays diverge.
    pub depth_m: f32,
    /// Change of the depth per column, metres; never negative.
    pub depth_per_column_m: f32,
    /// Length of the ray at z = 1: range per depth.
    pub range_per_depth: f32,
    /// Column and row in the raw image of C2, pixels; the column is NaN where the distortion folds back.
    pub cam2_px: [f32; 2],
}

impl EpipolarFrame {
    /// This frame in `f32`, for triangulating whole images.
    #[must_use]
    pub fn image_triangulation(&self) -> ImageTriangulation {
        let epipolar_from_cam1 = self.epipolar_from_cam1.matrix();
        let cam2_from_epipolar = self.epipolar_from_cam2.matrix().transpose();
        let row = |matrix: &nalgebra::Matrix3<f64>, i: usize| [0, 1, 2].map(|j| matrix[(i, j)] as f32);
        let (camera, lens) = (&self.cam2, self.cam2.distortion());
        ImageTriangulation {
            epipolar_x: row(epipolar_from_cam1, 0),
            epipolar_z: row(epipolar_from_cam1, 2),
            focal_px: self.focal_px as f32,
            per_focal: (1.0 / self.focal_px) as f32,
            principal_px: [self.principal_px.x as f32, self.principal_px.y as f32],
            focal_times_base: (self.focal_px * self.base_m) as f32,
            cam2_from_epipolar: [0, 1, 2].map(|i| row(&cam2_from_epipolar, i)),
            cam2: Lens {
                focal_px: camera.focal_px().map(|px| px as f32),
                principal_px: camera.principal_px().map(|px| px as f32),
                skew_px: camera.skew_px() as f32,
                radial: lens.radial.map(|k| k as f32),
                rational: lens.rational.map(|k| k as f32),
                tangential: lens.tangential.map(|k| k as f32),
                thin_prism: lens.thin_prism.map(|k| k as f32),
                max_r2: camera.max_ideal_radius().powi(2) as f32,
            },
        }
    }
}

impl ImageTriangulation {
    /// Triangulates a ray of C1 (x and y at z = 1) and a point of the epipolar frame (pixels).
    ///
    /// The depth equals [`super::EpipolarLine::depth_of_column`], the point in C2 [`EpipolarFrame::cam2_pixel`].
    #[inline(always)]
    #[must_use]
    pub fn triangulate(&self, [x, y]: [f32; 2], column_px: f32, row_px: f32) -> TriangulatedPixel {
        let (x_axis, z_axis, to) = (&self.epipolar_x, &self.epipolar_z, &self.cam2_from_epipolar);
        // Direction of the ray in the epipolar frame.
        let a_x = x_axis[0] * x + x_axis[1] * y + x_axis[2];
        let a_z = z_axis[0] * x + z_axis[1] * y + z_axis[2];
        let right_px = column_px - self.principal_px[0];
        // depth = columns per inverse depth / (column − column at infinity), both sides of the fraction times a_z.
        let depth_m = self.focal_times_base / (right_px * a_z - self.focal_px * a_x);
        // The same point as a ray of C2, and its raw image point.
        let (right, down) = (right_px * self.per_focal, (row_px - self.principal_px[1]) * self.per_focal);
        let d_z = to[2][0] * right + to[2][1] * down + to[2][2];
        let per_z = 1.0 / d_z;
        let ideal_x = (to[0][0] * right + to[0][1] * down + to[0][2]) * per_z;
        let ideal_y = (to[1][0] * right + to[1][1] * down + to[1][2]) * per_z;
        let cam2_px = self.cam2.distorted_px(ideal_x, ideal_y);
        let is_seen = (d_z > 0.0) & (a_z > 1e-6) & (ideal_x * ideal_x + ideal_y * ideal_y <= self.cam2.max_r2);
        TriangulatedPixel {
            depth_m,
            depth_per_column_m: (depth_m * depth_m * a_z / self.focal_times_base).abs(),
            range_per_depth: (x * x + y * y + 1.0).sqrt(),
            cam2_px: [if is_seen { cam2_px[0] } else { f32::NAN }, cam2_px[1]],
        }
    }
}

impl Lens {
    /// The raw pixel of a ray at z = 1, as [`super::Distortion::distort`] defines it.
    #[inline(always)]
    fn distorted_px(&self, x: f32, y: f32) -> [f32; 2] {
        let ([k1, k2, k3], [k4, k5, k6]) = (self.radial, self.rational);
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let (xx, yy, xy) = (x * x, y * y, x * y);
        let r2 = xx + yy;
        let rho = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let distorted_x = x * rho + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx) + r2 * (s1 + s2 * r2);
        let distorted_y = y * rho + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy + r2 * (s3 + s4 * r2);
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.principal_px);
        [fx * distorted_x + self.skew_px * distorted_y + cx, fy * distorted_y + cy]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pixel, Pose, Rig, Vector3, rig};

    #[test]
    fn single_precision_agrees_with_the_epipolar_frame() {
        let lens = [-0.15, 0.2, -0.002, 0.0016, 0.03, 0.01, -0.02, 0.005, 1e-3, 2e-4, -1e-3, 3e-4];
        let cam2_from_cam1 = Pose::new(Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.38, -0.02));
        let rig = rig::tests::rig(cam2_from_cam1, &lens);
        let rig = Rig { cam2: rig.cam2.with_skew(0.4), ..rig };
        let frame = EpipolarFrame::new(&rig).unwrap();
        let triangulation = frame.image_triangulation();
        for i in 0..100 {
            let (u, v) = (f64::from(i * 37 % 640), f64::from(i * 91 % 512));
            let ray = rig.cam1.ray(&Pixel::new(u, v)).unwrap();
            let (x, y) = (ray.x as f32, ray.y as f32);
            let line = frame.line(&Vector3::new(f64::from(x), f64::from(y), 1.0)).unwrap();
            let column_px = line.column_of_depth(0.26 + 0.001 * f64::from(i)) as f32;
            let row_px = line.row_px as f32;
            let found = triangulation.triangulate([x, y], column_px, row_px);
            let depth_m = line.depth_of_column(f64::from(column_px));
            // Far below the 20 micrometres to which the best rigs of the field repeat a measurement.
            assert!((f64::from(found.depth_m) - depth_m).abs() < 2e-7, "{} {depth_m}", found.depth_m);
            assert!((f64::from(found.range_per_depth) / ray.norm() - 1.0).abs() < 1e-6);
            let per_column_m = (line.depth_of_column(f64::from(column_px) + 1e-3) - depth_m).abs() / 1e-3;
            assert!((f64::from(found.depth_per_column_m) / per_column_m - 1.0).abs() < 1e-4);
            let raw = frame.cam2_pixel(&Pixel::new(f64::from(column_px), f64::from(row_px))).unwrap();
            let [cam2_u_px, cam2_v_px] = found.cam2_px.map(f64::from);
            assert!(
                (raw.x - cam2_u_px).abs() < 3e-4 && (raw.y - cam2_v_px).abs() < 3e-4,
                "{raw} {cam2_u_px} {cam2_v_px}"
            );
        }
    }

    #[test]
    fn rays_beyond_the_fold_of_the_lens_have_no_pixel() {
        let rig = rig::tests::rig(Pose::translation(-0.1, 0.0, 0.0), &[-0.2, 0.0, 0.0, 0.0]);
        let triangulation = EpipolarFrame::new(&rig).unwrap().image_triangulation();
        assert!(triangulation.triangulate([0.1, 0.0], 200.0, 256.0).cam2_px[0].is_finite());
        assert!(triangulation.triangulate([0.1, 0.0], 9000.0, 256.0).cam2_px[0].is_nan());
    }
}
