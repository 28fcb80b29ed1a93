//! Rigs that are drawn: plausible scanners of many kinds, to judge a calibration by more than one.
//!
//! | | range |
//! |---|---|
//! | working distance | 200 to 600 mm |
//! | base of the cameras | 60 to 200 mm, and 0.2 to 0.5 of the distance |
//! | cameras: focal length | 1.5 to 2.8 image widths; of both within 3 %; fy within 0.1 % of fx |
//! | cameras: aim and roll | within 1.5° of the middle of the volume; within 1.5° |
//! | cameras: principal point | within 2.5 % of the image width of the middle |
//! | cameras: distortion | k1 −0.25 to 0.08, k2 −0.15 to 0.4, p1 and p2 within 0.001, k3 −0.2 to 0.2 |
//! | projector: image | 1280 × 800, 1024 × 768, 912 × 1140 or 1920 × 1080 |
//! | projector: place | −0.4 to 1.4 of the base, 25 to 70 mm above or below it, up to 20 mm before or behind it |
//! | projector: throw | its image is 1.4 to 1.8 times as wide as the volume |
//! | projector: principal point | within 2 % of the middle across, and 0 to 0.55 heights off it down |
//! | projector: distortion | k1 within 0.08, k2 within 0.1, p1 and p2 within 0.0006, k3 0 |
//! | volume | 0.6 of what C1 sees across and down, 0.12 to 0.22 of the distance deep |

use nalgebra::{Translation3, UnitQuaternion};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3};
use fringeflow_patterns::usual_fringes;

use super::projector_place::with_projector_at;
use super::rig::looking_at_centre;
use super::solid::MM_PER_M;
use super::{GivenRig, SimulationError};

/// Images of projectors, pixels.
const PROJECTORS_PX: [[usize; 2]; 4] = [[1280, 800], [1024, 768], [912, 1140], [1920, 1080]];
/// Share of the view of C1 that the volume takes.
const VOLUME_SHARE: f64 = 0.6;

struct Draw(ChaCha8Rng);

impl Draw {
    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.0.random::<f64>()
    }

    fn within(&mut self, most: f64) -> f64 {
        self.between(-most, most)
    }

    fn camera(&mut self, focal_px: f64, size_px: [usize; 2]) -> Camera {
        let principal = size_px.map(|size| (size as f64 - 1.0) / 2.0 + self.within(0.025) * size_px[0] as f64);
        let k = [
            self.between(-0.25, 0.08),
            self.between(-0.15, 0.4),
            self.within(0.001),
            self.within(0.001),
            self.within(0.2),
        ];
        let focal = [focal_px, focal_px * (1.0 + self.within(0.001))];
        Camera::new(focal, principal, Distortion::from_opencv(&k), size_px)
    }

    fn projector(&mut self, focal_px: f64, size_px: [usize; 2]) -> Camera {
        let [w, h] = size_px.map(|size| size as f64);
        let principal = [(w - 1.0) / 2.0 + self.within(0.02) * w, (h - 1.0) / 2.0 + self.between(0.0, 0.55) * h];
        let k = [self.within(0.08), self.within(0.1), self.within(0.0006), self.within(0.0006)];
        Camera::new([focal_px, focal_px * (1.0 + self.within(0.001))], principal, Distortion::from_opencv(&k), size_px)
    }

    /// A small rotation in any direction.
    fn turn(&mut self, most_deg: f64) -> UnitQuaternion<f64> {
        let most = most_deg.to_radians();
        UnitQuaternion::new(Vector3::new(self.within(most), self.within(most), self.within(most)))
    }
}

/// Draws a rig with camera images of this size. The same seed gives the same rig.
///
/// # Errors
/// The measurement volume is not valid, which images of a usable size do not lead to.
pub fn drawn_rig(seed: u64, size_px: [usize; 2], period_px: f64) -> Result<GivenRig, SimulationError> {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed ^ 0x7269_6773));
    let distance_mm = draw.between(200.0, 600.0);
    let base_mm = draw.between(60.0_f64.max(0.2 * distance_mm), 200.0_f64.min(0.5 * distance_mm));
    let focal_px = draw.between(1.5, 2.8) * size_px[0] as f64;
    let cam1 = draw.camera(focal_px, size_px);
    let focal2_px = focal_px * (1.0 + draw.within(0.03));
    let cam2 = draw.camera(focal2_px, size_px);
    // The frame of the volume: x right, y down, z away from the sensor, its origin in the middle.
    let eye = |x_mm: f64, y_mm: f64, z_mm: f64| Point3::new(x_mm, y_mm, z_mm - distance_mm) / MM_PER_M;
    let aimed = |eye: Point3, lens: &Camera, draw: &mut Draw| {
        let pose = looking_at_centre(eye, 0.0);
        let middle = [(lens.width_px() as f64 - 1.0) / 2.0, (lens.height_px() as f64 - 1.0) / 2.0];
        let ray = lens.ray(&Pixel::from(middle)).unwrap_or_else(Vector3::z);
        let to_ray = UnitQuaternion::rotation_between(&Vector3::z(), &ray).unwrap_or_default();
        Pose::from_parts(Translation3::identity(), draw.turn(1.5) * to_ray) * pose
    };
    let (first, second) =
        (eye(-base_mm / 2.0, draw.within(3.0), 0.0), eye(base_mm / 2.0, draw.within(3.0), draw.within(3.0)));
    let (cam1_from_volume, cam2_from_volume) = (aimed(first, &cam1, &mut draw), aimed(second, &cam2, &mut draw));
    let half = size_px.map(|size| VOLUME_SHARE / 2.0 * size as f64 / focal_px * distance_mm / MM_PER_M);
    let depth_m = draw.between(0.12, 0.22) * distance_mm / MM_PER_M;
    let corner = Point3::new(half[0], half[1], depth_m / 2.0);
    let volume = MeasurementVolume::new(cam1_from_volume, -corner, corner)?;
    let projector_px = PROJECTORS_PX[(draw.between(0.0, 4.0) as usize).min(3)];
    let side = draw.within(1.0).signum();
    let place_mm = [(draw.between(-0.4, 1.4) - 0.5) * base_mm, side * draw.between(25.0, 70.0), draw.within(20.0)];
    // The narrower direction decides how far the image is spread.
    let spread = draw.between(1.4, 1.8);
    let across = (2.0 * half[0] / projector_px[0] as f64).max(2.0 * half[1] / projector_px[1] as f64);
    let projector = draw.projector(distance_mm / MM_PER_M / (across * spread), projector_px);
    let projector_eye = eye(place_mm[0], place_mm[1], place_mm[2]);
    let upright = looking_at_centre(projector_eye, 0.0) * cam1_from_volume.inverse();
    let rig = Rig {
        cam1,
        cam2,
        projector,
        cam2_from_cam1: cam2_from_volume * cam1_from_volume.inverse(),
        projector_from_cam1: upright,
    };
    let at = cam1_from_volume * projector_eye;
    let rig = with_projector_at(&rig, &volume, (at.coords * MM_PER_M).into())?;
    let pattern: FringePattern = usual_fringes(period_px);
    Ok(GivenRig { rig, volume, pattern })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_rigs_see_and_light_their_volume() {
        for seed in 0..200 {
            let GivenRig { rig, volume, .. } = drawn_rig(seed, [640, 512], 16.0).unwrap();
            let (min, max) = (volume.min(), volume.max());
            // The corners in the middle plane; a rig need not see all of those before and behind it.
            for (x, y) in [(min.x, min.y), (max.x, min.y), (min.x, max.y), (max.x, max.y)] {
                let corner = volume.cam1_from_volume() * Point3::new(x, y, 0.0);
                let seen = [
                    rig.cam1.project(&corner).is_some_and(|pixel| rig.cam1.sees(&pixel)),
                    rig.project_projector(&corner).is_some_and(|pixel| rig.projector.sees(&pixel)),
                ];
                assert_eq!(seen, [true; 2], "seed {seed}: {corner}, {:?}", rig.project_projector(&corner));
            }
            for lens in [&rig.cam1, &rig.cam2, &rig.projector] {
                let (w, h) = (lens.width_px() as f64 - 0.5, lens.height_px() as f64 - 0.5);
                let corners = [(-0.5, -0.5), (w, -0.5), (-0.5, h), (w, h)];
                assert!(corners.iter().all(|&(u, v)| lens.ray(&Pixel::new(u, v)).is_some()), "seed {seed}: {lens:?}");
            }
        }
    }
}
