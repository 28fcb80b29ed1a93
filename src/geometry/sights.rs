//! Many correspondences of one rig at once: their depths and their places in the raw image of C2.

use crate::simd::{self, Kernel, Lanes, Level};

use super::EpipolarFrame;

/// Correspondences: a ray of C1 and a place in the epipolar frame each.
#[derive(Clone, Debug, Default)]
pub struct Sights {
    /// Rays of C1, x at z = 1.
    pub ray_x: Vec<f32>,
    /// Rays of C1, y at z = 1.
    pub ray_y: Vec<f32>,
    /// Rows of the epipolar frame, pixels.
    pub row_px: Vec<f32>,
    /// Columns of the epipolar frame, pixels.
    pub column_px: Vec<f32>,
}

/// What they see.
#[derive(Clone, Debug, Default)]
pub struct Sighted {
    /// Depths, z in the frame of C1, metres; negative or infinite where the rays part.
    pub depth_m: Vec<f64>,
    /// Lengths of the rays at z = 1: ranges a depth.
    pub range_per_depth: Vec<f64>,
    /// Change of the depth a column, metres; never negative.
    pub depth_per_column_m: Vec<f64>,
    /// Columns of the raw image of C2, pixels; NaN where the distortion cannot follow.
    pub cam2_u_px: Vec<f64>,
    /// Rows of the raw image of C2, pixels.
    pub cam2_v_px: Vec<f64>,
}

impl Sights {
    /// Forgets all.
    pub fn clear(&mut self) {
        [&mut self.ray_x, &mut self.ray_y, &mut self.row_px, &mut self.column_px].into_iter().for_each(Vec::clear);
    }

    /// Takes a correspondence.
    #[inline]
    pub fn push(&mut self, ray: [f32; 2], row_px: f32, column_px: f32) {
        self.ray_x.push(ray[0]);
        self.ray_y.push(ray[1]);
        self.row_px.push(row_px);
        self.column_px.push(column_px);
    }
}

impl EpipolarFrame {
    /// What correspondences see: of each the depth as [`super::EpipolarLine`] has it, and the place in C2 as
    /// [`Self::cam2_pixel`] has it.
    pub fn look(&self, sights: &Sights, sighted: &mut Sighted) {
        let count = sights.column_px.len();
        let Sighted { depth_m, range_per_depth, depth_per_column_m, cam2_u_px, cam2_v_px } = &mut *sighted;
        for plane in [depth_m, range_per_depth, depth_per_column_m, cam2_u_px, cam2_v_px] {
            plane.resize(count, 0.0);
        }
        simd::run(Level::in_use(), Look { frame: self, sights, sighted });
    }
}

struct Look<'a> {
    frame: &'a EpipolarFrame,
    sights: &'a Sights,
    sighted: &'a mut Sighted,
}

impl Kernel for Look<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { frame, sights, sighted } = self;
        let count = sights.column_px.len();
        let (ray_x, ray_y) = (&sights.ray_x[..count], &sights.ray_y[..count]);
        let (row_px, column_px) = (&sights.row_px[..count], &sights.column_px[..count]);
        let (depth_m, depth_per_column_m) = (&mut sighted.depth_m[..count], &mut sighted.depth_per_column_m[..count]);
        let range_per_depth = &mut sighted.range_per_depth[..count];
        let (u_px, v_px) = (&mut sighted.cam2_u_px[..count], &mut sighted.cam2_v_px[..count]);
        let to_frame = frame.epipolar_from_cam1.matrix();
        let (along, forward) = (to_frame.row(0), to_frame.row(2));
        let (along, forward) = ([along[0], along[1], along[2]], [forward[0], forward[1], forward[2]]);
        let (focal_px, centre) = (frame.focal_px, [frame.principal_px.x, frame.principal_px.y]);
        let (per_focal, width_m) = (1.0 / focal_px, focal_px * frame.base_m);
        let back = frame.epipolar_from_cam2.matrix().transpose();
        let row = |i: usize| [back[(i, 0)], back[(i, 1)], back[(i, 2)]];
        let (to_x, to_y, to_z) = (row(0), row(1), row(2));
        let cam2 = &frame.cam2;
        let ([fx, fy], [cx, cy], skew) = (cam2.focal_px(), cam2.principal_px(), cam2.skew_px());
        let (lens, max_radius) = (*cam2.distortion(), cam2.max_ideal_radius());
        let ([k1, k2, k3], [k4, k5, k6]) = (lens.radial, lens.rational);
        let ([p1, p2], [s1, s2, s3, s4]) = (lens.tangential, lens.thin_prism);
        for i in 0..count {
            let (x, y) = (f64::from(ray_x[i]), f64::from(ray_y[i]));
            let (column, row) = (f64::from(column_px[i]), f64::from(row_px[i]));
            let a_x = along[0] * x + along[1] * y + along[2];
            let a_z = forward[0] * x + forward[1] * y + forward[2];
            // The column at infinity and the columns an inverse depth, both times a_z.
            let off = (column - centre[0]) * a_z - focal_px * a_x;
            let depth = width_m / off;
            depth_m[i] = depth;
            range_per_depth[i] = (x * x + y * y + 1.0).sqrt();
            depth_per_column_m[i] = (depth * depth * a_z / width_m).abs();
            let (right, down) = ((column - centre[0]) * per_focal, (row - centre[1]) * per_focal);
            let d_z = to_z[0] * right + to_z[1] * down + to_z[2];
            let per_z = 1.0 / d_z;
            let ideal_x = (to_x[0] * right + to_x[1] * down + to_x[2]) * per_z;
            let ideal_y = (to_y[0] * right + to_y[1] * down + to_y[2]) * per_z;
            let r2 = ideal_x * ideal_x + ideal_y * ideal_y;
            let rho = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
            let (xx, yy, xy) = (ideal_x * ideal_x, ideal_y * ideal_y, ideal_x * ideal_y);
            let lens_x = ideal_x * rho + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx) + r2 * (s1 + s2 * r2);
            let lens_y = ideal_y * rho + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy + r2 * (s3 + s4 * r2);
            let is_seen = (d_z > 0.0) & (r2 <= max_radius * max_radius) & (a_z > 1e-6);
            u_px[i] = if is_seen { fx * lens_x + skew * lens_y + cx } else { f64::NAN };
            v_px[i] = fy * lens_y + cy;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Camera, Distortion, Pixel, Pose, Rig, Vector3};
    use super::*;

    #[test]
    fn many_at_once_are_each_by_itself() {
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
        let (mut sights, mut sighted) = (Sights::default(), Sighted::default());
        for i in 0..100 {
            let (u, v) = (f64::from(i * 37 % 640), f64::from(i * 91 % 512));
            let ray = rig.cam1.ray(&Pixel::new(u, v)).unwrap();
            let line = frame.line(&ray).unwrap();
            let column_px = line.column_of_depth(0.26 + 0.001 * f64::from(i));
            sights.push([ray.x as f32, ray.y as f32], line.row_px as f32, column_px as f32);
        }
        frame.look(&sights, &mut sighted);
        for i in 0..100 {
            let ray = Vector3::new(f64::from(sights.ray_x[i]), f64::from(sights.ray_y[i]), 1.0);
            let line = frame.line(&ray).unwrap();
            let column_px = f64::from(sights.column_px[i]);
            let depth_m = line.depth_of_column(column_px);
            assert!((sighted.depth_m[i] - depth_m).abs() < 1e-12, "{} {depth_m}", sighted.depth_m[i]);
            assert_eq!(sighted.range_per_depth[i], ray.norm());
            let per_column_m = (line.depth_of_column(column_px + 1e-3) - depth_m).abs() / 1e-3;
            assert!((sighted.depth_per_column_m[i] / per_column_m - 1.0).abs() < 1e-4);
            let raw = frame.cam2_pixel(&Pixel::new(column_px, f64::from(sights.row_px[i]))).unwrap();
            assert!((raw.x - sighted.cam2_u_px[i]).abs() < 1e-9 && (raw.y - sighted.cam2_v_px[i]).abs() < 1e-9);
        }
    }
}
