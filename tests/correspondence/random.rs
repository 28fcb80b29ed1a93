//! Random rigs and phase maps, the same in every run.

use std::f64::consts::TAU;

use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Point3, Pose, Rig, Vector3};
use fringeflow::phase::{Modulation, PhaseMap};

/// Generator of repeatable random numbers.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// The next number, in [0, 1).
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn camera(&mut self, size_px: [usize; 2], focal_px: f64, distorted: bool) -> Camera {
        let mut coefficient = |limit: f64| if distorted { self.between(-limit, limit) } else { 0.0 };
        let d = [coefficient(0.2), coefficient(0.3), coefficient(2e-3), coefficient(2e-3), 0.0];
        let [width, height] = size_px;
        Camera::new(
            [focal_px, 1.01 * focal_px],
            [0.5 * width as f64, 0.48 * height as f64],
            Distortion::from_opencv(&d),
            size_px,
        )
    }

    /// A rig with toed-in cameras, side by side or one above the other. The projector is inside or outside the base.
    pub(crate) fn rig(&mut self) -> (Rig, MeasurementVolume, FringePattern) {
        let distorted = self.next() < 0.5;
        let vertical = self.next() < 0.3;
        let base = if vertical { Vector3::y() } else { Vector3::x() } * self.between(0.06, 0.14);
        // Sometimes exactly at C1: then the back-projection phase does not change along a segment.
        let place = if self.next() < 0.1 { 0.0 } else { self.between(-0.6, 1.6) };
        let target = Point3::new(0.5 * base.x, 0.5 * base.y, 0.3);
        let off_base =
            Vector3::new(if vertical { self.between(-0.05, 0.05) } else { 0.0 }, self.between(-0.05, 0.05), 0.0);
        let rig = Rig {
            cam1: self.camera([96, 80], 270.0, distorted),
            cam2: self.camera([100, 84], 280.0, distorted),
            projector: self.camera([1024, 1024], 2400.0, distorted),
            cam2_from_cam1: looking_at(&Point3::from(base), &target),
            projector_from_cam1: looking_at(
                &Point3::from(if place == 0.0 { Vector3::zeros() } else { base * place + off_base }),
                &target,
            ),
        };
        let pose = Pose::translation(target.x, target.y, target.z);
        let half_depth = self.between(0.008, 0.03);
        let half = Vector3::new(0.05, 0.04, half_depth);
        let volume = MeasurementVolume::new(pose, Point3::from(-half), Point3::from(half)).unwrap();
        let sign = if self.next() < 0.5 { 1.0 } else { -1.0 };
        let pattern = FringePattern { period_px: self.between(8.0, 40.0), sign, offset_rad: self.between(0.0, TAU) };
        (rig, volume, pattern)
    }

    /// A phase map: a slope with a jump and holes, or noise.
    pub(crate) fn map(&mut self, width: usize, height: usize) -> PhaseMap {
        let (du, dv, noisy) = (self.between(-9000.0, 9000.0), self.between(-3000.0, 3000.0), self.next() < 0.3);
        let jump = self.between(0.0, width as f64) as usize;
        let phase = |i: usize, random: f64| {
            let (u, v) = (i % width, i / width);
            let step = if u > jump { 20_000.0 } else { 0.0 };
            if noisy { (random * 65536.0) as i64 as u16 } else { (u as f64 * du + v as f64 * dv + step) as i64 as u16 }
        };
        PhaseMap {
            width,
            height,
            phase: (0..width * height).map(|i| phase(i, self.next())).collect(),
            valid: (0..width * height).map(|_| self.next() < 0.97).collect(),
            modulation: vec![Modulation::from_grey(50.0); width * height],
            mean: vec![100; width * height],
            ..PhaseMap::default()
        }
    }
}

/// Pose `device_from_cam1` of a device at `centre` whose optical axis passes through `target`.
fn looking_at(centre: &Point3, target: &Point3) -> Pose {
    let z = (target - centre).normalize();
    let x = Vector3::y().cross(&z).normalize();
    let y = z.cross(&x);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&[
        x.transpose(),
        y.transpose(),
        z.transpose(),
    ]));
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    Pose::from_parts((rotation * -centre.coords).into(), rotation)
}
