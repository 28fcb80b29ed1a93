//! A tilted plane before a small rig, whose phases and correspondences are known in closed form.

use super::ReferenceMatch;
use crate::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3};
use crate::phase::AbsolutePhase;

/// The rig and its plane `normal · x = distance` in the frame of C1.
pub(crate) struct Scene {
    pub(crate) rig: Rig,
    normal: Vector3,
    distance_m: f64,
}

pub(crate) const PATTERN: FringePattern = FringePattern { period_px: 16.0, sign: -1.0, offset_rad: 0.7 };
const SIZE: [usize; 2] = [200, 160];

impl Scene {
    pub(crate) fn new() -> Self {
        let d = Distortion::from_opencv(&[-0.12, 0.1, -0.001, 0.0008, 0.0]);
        let camera = Camera::new([600.0, 601.0], [99.0, 80.0], d, SIZE);
        let projector = Camera::new([900.0, 900.0], [320.0, 240.0], Distortion::default(), [640, 480]);
        let rig = Rig {
            cam1: camera,
            cam2: camera,
            projector,
            cam2_from_cam1: Pose::new(Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.36, -0.02)),
            projector_from_cam1: Pose::new(Vector3::new(-0.045, 0.0, 0.005), Vector3::new(0.0, 0.15, 0.0)),
        };
        Self { rig, normal: Vector3::new(0.2, -0.1, 1.0), distance_m: 0.3 }
    }

    pub(crate) fn cam1_columns(&self) -> AbsolutePhase {
        self.cam1(|lit_by| lit_by.x)
    }

    pub(crate) fn cam1_rows(&self) -> AbsolutePhase {
        self.cam1(|lit_by| lit_by.y)
    }

    pub(crate) fn cam2_columns(&self) -> AbsolutePhase {
        self.cam2(|lit_by| lit_by.x)
    }

    pub(crate) fn cam2_rows(&self) -> AbsolutePhase {
        self.cam2(|lit_by| lit_by.y)
    }

    /// Point of C1's pixel number `i` at a depth.
    pub(crate) fn point(&self, i: usize, depth_m: f64) -> Point3 {
        Point3::from(self.rig.cam1.ray(&pixel(i)).unwrap() * depth_m)
    }

    /// A volume whose border cuts the plane in half.
    pub(crate) fn half_of_the_plane(&self) -> MeasurementVolume {
        let (min, max) = (Point3::new(-1.0, -1.0, 0.01), Point3::new(0.0, 1.0, 1.0));
        MeasurementVolume::new(Pose::identity(), min, max).unwrap()
    }

    /// Number of matches, and the greatest distance between one and its true point in C2.
    pub(crate) fn worst_error_px(&self, found: &[Option<ReferenceMatch>]) -> (usize, f64) {
        let error = |(i, found): (usize, &Option<ReferenceMatch>)| {
            let found = (*found)?;
            let truth = self.meet(&self.rig.cam1.ray(&pixel(i)).unwrap(), &Point3::origin());
            assert!((truth.z - found.depth_m).abs() < 1e-4, "{} {}", truth.z, found.depth_m);
            assert_eq!(found.order, self.turns(&truth, |p| p.x).unwrap().floor() as i16);
            Some((self.rig.project_cam2(&truth).unwrap() - found.cam2_px).norm())
        };
        let errors: Vec<f64> = found.iter().enumerate().filter_map(error).collect();
        (errors.len(), errors.iter().copied().fold(0.0, f64::max))
    }

    fn cam1(&self, axis: fn(&Pixel) -> f64) -> AbsolutePhase {
        let turns = |i| self.turns(&self.meet(&self.rig.cam1.ray(&pixel(i))?, &Point3::origin()), axis);
        absolute(turns)
    }

    fn cam2(&self, axis: fn(&Pixel) -> f64) -> AbsolutePhase {
        let cam1_from_cam2 = self.rig.cam2_from_cam1.inverse();
        let turns = |i| {
            let direction = cam1_from_cam2.rotation * self.rig.cam2.ray(&pixel(i))?;
            self.turns(&self.meet(&direction, &self.rig.centre_of_cam2()), axis)
        };
        absolute(turns)
    }

    /// Where a ray meets the plane, frame of C1.
    fn meet(&self, direction: &Vector3, from: &Point3) -> Point3 {
        from + direction * ((self.distance_m - self.normal.dot(&from.coords)) / self.normal.dot(direction))
    }

    fn turns(&self, point: &Point3, axis: fn(&Pixel) -> f64) -> Option<f64> {
        Some(PATTERN.phase_turns(axis(&self.rig.project_projector(point)?)))
    }
}

fn pixel(i: usize) -> Pixel {
    Pixel::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64)
}

fn absolute(turns: impl Fn(usize) -> Option<f64>) -> AbsolutePhase {
    let values: Vec<Option<f64>> = (0..SIZE[0] * SIZE[1]).map(turns).collect();
    AbsolutePhase {
        width: SIZE[0],
        height: SIZE[1],
        turns: values.iter().map(|t| t.unwrap_or(0.0) as f32).collect(),
        valid: values.iter().map(Option::is_some).collect(),
    }
}
