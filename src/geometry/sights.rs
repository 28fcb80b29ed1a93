//! What a correspondence sees: its depth and its place in the raw image of C2, in the numbers of whole images.

use super::EpipolarFrame;

/// An epipolar frame as whole images are seen through it: `f32`, and nothing left to be looked up.
///
/// Columns are stated to 6e-5 px and depths follow them to some 1e-7 of their value: a thousandth of what the noise of cameras
/// moves a point by. What a calibration is judged by is asked of [`EpipolarFrame`], in `f64`.
#[derive(Clone, Copy, Debug)]
pub struct Sights {
    /// From a ray of C1 to the column at infinity and the depth in the epipolar frame.
    along: [f32; 3],
    forward: [f32; 3],
    focal_px: f32,
    per_focal: f32,
    principal_px: [f32; 2],
    /// Focal length times base, pixel · metre.
    width_m: f32,
    /// From the epipolar frame to C2.
    cam2_from_epipolar: [[f32; 3]; 3],
    cam2: Lens,
}

/// The projection of C2.
#[derive(Clone, Copy, Debug)]
struct Lens {
    focal_px: [f32; 2],
    principal_px: [f32; 2],
    skew_px: f32,
    /// Coefficients of r², r⁴ and r⁶ above and below the line.
    radial: [f32; 3],
    rational: [f32; 3],
    tangential: [f32; 2],
    thin_prism: [f32; 4],
    /// Square of the radius up to which the distortion has an inverse, z = 1.
    max_r2: f32,
}

/// What a correspondence sees.
#[derive(Clone, Copy, Debug)]
pub struct Sighted {
    /// Depth, z in the frame of C1, metres; negative or infinite where the rays part.
    pub depth_m: f32,
    /// Change of the depth a column, metres; never negative.
    pub depth_per_column_m: f32,
    /// Length of the ray at z = 1: range a depth.
    pub range_per_depth: f32,
    /// Column and row of the raw image of C2, pixels; the column is NaN where the distortion cannot follow.
    pub cam2_px: [f32; 2],
}

impl EpipolarFrame {
    /// What is needed to look at whole images.
    #[must_use]
    pub fn sights(&self) -> Sights {
        let to_frame = self.epipolar_from_cam1.matrix();
        let back = self.epipolar_from_cam2.matrix().transpose();
        let row = |matrix: &nalgebra::Matrix3<f64>, i: usize| [0, 1, 2].map(|j| matrix[(i, j)] as f32);
        let (camera, lens) = (&self.cam2, self.cam2.distortion());
        Sights {
            along: row(to_frame, 0),
            forward: row(to_frame, 2),
            focal_px: self.focal_px as f32,
            per_focal: (1.0 / self.focal_px) as f32,
            principal_px: [self.principal_px.x as f32, self.principal_px.y as f32],
            width_m: (self.focal_px * self.base_m) as f32,
            cam2_from_epipolar: [0, 1, 2].map(|i| row(&back, i)),
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

impl Sights {
    /// What the correspondence of a ray of C1 (x and y at z = 1) with a place in the epipolar frame (pixels) sees: the depth as
    /// [`super::EpipolarLine`] has it, and the place in C2 as [`EpipolarFrame::cam2_pixel`] has it.
    #[inline(always)]
    #[must_use]
    pub fn look(&self, [x, y]: [f32; 2], column_px: f32, row_px: f32) -> Sighted {
        let (along, forward, to) = (&self.along, &self.forward, &self.cam2_from_epipolar);
        let a_x = along[0] * x + along[1] * y + along[2];
        let a_z = forward[0] * x + forward[1] * y + forward[2];
        let right_px = column_px - self.principal_px[0];
        // The column from that at infinity, and the columns an inverse depth, both times a_z.
        let depth_m = self.width_m / (right_px * a_z - self.focal_px * a_x);
        let (right, down) = (right_px * self.per_focal, (row_px - self.principal_px[1]) * self.per_focal);
        let d_z = to[2][0] * right + to[2][1] * down + to[2][2];
        let per_z = 1.0 / d_z;
        let ideal_x = (to[0][0] * right + to[0][1] * down + to[0][2]) * per_z;
        let ideal_y = (to[1][0] * right + to[1][1] * down + to[1][2]) * per_z;
        let cam2_px = self.cam2.place_px(ideal_x, ideal_y);
        let is_seen = (d_z > 0.0) & (a_z > 1e-6) & (ideal_x * ideal_x + ideal_y * ideal_y <= self.cam2.max_r2);
        Sighted {
            depth_m,
            depth_per_column_m: (depth_m * depth_m * a_z / self.width_m).abs(),
            range_per_depth: (x * x + y * y + 1.0).sqrt(),
            cam2_px: [if is_seen { cam2_px[0] } else { f32::NAN }, cam2_px[1]],
        }
    }
}

impl Lens {
    /// The pixel of a ray at z = 1.
    #[inline(always)]
    fn place_px(&self, x: f32, y: f32) -> [f32; 2] {
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
    use crate::geometry::{Camera, Distortion, Pixel, Pose, Rig, Vector3};

    #[test]
    fn a_correspondence_sees_what_the_frame_says() {
        let lens =
            Distortion::from_opencv(&[-0.15, 0.2, -0.002, 0.0016, 0.03, 0.01, -0.02, 0.005, 1e-3, 2e-4, -1e-3, 3e-4]);
        let camera = Camera::new([1850.0, 1852.0], [320.0, 250.0], lens, [640, 512]).with_skew(0.4);
        let cam2_from_cam1 = Pose::new(Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.38, -0.02));
        let rig = Rig {
            cam1: camera.clone(),
            cam2: camera.clone(),
            projector: camera,
            cam2_from_cam1,
            projector_from_cam1: Pose::identity(),
        };
        let frame = EpipolarFrame::new(&rig).unwrap();
        let sights = frame.sights();
        for i in 0..100 {
            let (u, v) = (f64::from(i * 37 % 640), f64::from(i * 91 % 512));
            let ray = rig.cam1.ray(&Pixel::new(u, v)).unwrap();
            let (x, y) = (ray.x as f32, ray.y as f32);
            let line = frame.line(&Vector3::new(f64::from(x), f64::from(y), 1.0)).unwrap();
            let column_px = line.column_of_depth(0.26 + 0.001 * f64::from(i)) as f32;
            let row_px = line.row_px as f32;
            let sighted = sights.look([x, y], column_px, row_px);
            let depth_m = line.depth_of_column(f64::from(column_px));
            // Far below the 20 micrometres that the best rig of the field repeats itself within.
            assert!((f64::from(sighted.depth_m) - depth_m).abs() < 2e-7, "{} {depth_m}", sighted.depth_m);
            assert!((f64::from(sighted.range_per_depth) / ray.norm() - 1.0).abs() < 1e-6);
            let per_column_m = (line.depth_of_column(f64::from(column_px) + 1e-3) - depth_m).abs() / 1e-3;
            assert!((f64::from(sighted.depth_per_column_m) / per_column_m - 1.0).abs() < 1e-4);
            let raw = frame.cam2_pixel(&Pixel::new(f64::from(column_px), f64::from(row_px))).unwrap();
            let [cam2_u_px, cam2_v_px] = sighted.cam2_px.map(f64::from);
            assert!(
                (raw.x - cam2_u_px).abs() < 3e-4 && (raw.y - cam2_v_px).abs() < 3e-4,
                "{raw} {cam2_u_px} {cam2_v_px}"
            );
        }
    }

    #[test]
    fn rays_that_the_lens_cannot_follow_have_no_place() {
        let lens = Distortion::from_opencv(&[-0.2, 0.0, 0.0, 0.0]);
        let camera = Camera::new([800.0, 800.0], [320.0, 256.0], lens, [640, 512]);
        let rig = Rig {
            cam1: camera.clone(),
            cam2: camera.clone(),
            projector: camera,
            cam2_from_cam1: Pose::new(Vector3::new(-0.1, 0.0, 0.0), Vector3::zeros()),
            projector_from_cam1: Pose::identity(),
        };
        let sights = EpipolarFrame::new(&rig).unwrap().sights();
        assert!(sights.look([0.1, 0.0], 200.0, 256.0).cam2_px[0].is_finite());
        assert!(sights.look([0.1, 0.0], 9000.0, 256.0).cam2_px[0].is_nan());
    }
}
