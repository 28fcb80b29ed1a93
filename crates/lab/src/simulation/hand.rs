//! A hand. In front of the measurement volume it hides and shadows objects behind it, and is never measured. There is
//! also a small one as an object.
//!
//! It reaches in from the right with spread fingers. Its frame is that of the object (x right, y up, z towards the
//! sensor), shifted so that the hand lies on z = 0; in front of the volume, [`GAP_MM`] before its near face. Lengths are
//! in millimetres.

use fringeflow::geometry::{MeasurementVolume, Point3, Pose};

use super::solid::{MM_PER_M, Material, PointMm, RoundCone, Solid, smooth_union};

/// A hand, in the frame of the object.
pub(super) struct Hand {
    /// Its origin in the frame of the object.
    origin: PointMm,
    bones: [RoundCone; 6],
}

/// Gap between the hand and the near face of the volume, millimetres.
const GAP_MM: f64 = 15.0;
/// Height of the axes of the fingers, and their radii at root and tip.
const AXIS_Z: f64 = 9.0;
const ROOT_RADIUS: f64 = 9.0;
const TIP_RADIUS: f64 = 6.5;
/// Roots and tips of the four fingers and the thumb, x and y.
const FINGERS: [([f64; 2], [f64; 2]); 5] = [
    ([62.0, 24.0], [14.0, 36.0]),
    ([58.0, 9.0], [4.0, 13.0]),
    ([59.0, -6.0], [8.0, -9.0]),
    ([64.0, -20.0], [20.0, -29.0]),
    ([82.0, 30.0], [52.0, 52.0]),
];
/// Both ends of the palm, x and y, and its radius.
const PALM: ([f64; 2], [f64; 2]) = ([78.0, 16.0], [80.0, -12.0]);
const PALM_RADIUS: f64 = 20.0;
/// Fillet between the fingers and the palm.
const WEB: f64 = 5.0;
/// Matt skin, an albedo of about 0.45.
const SKIN: Material = Material { brightness: 0.56, gloss: 0.0 };

impl Hand {
    /// Creates the hand in front of a volume.
    pub(super) fn in_front_of(volume: &MeasurementVolume, volume_from_object: &Pose) -> Self {
        let near_face = Point3::new(0.0, 0.0, volume.min().z - GAP_MM / MM_PER_M);
        Self::at(volume_from_object.inverse_transform_point(&near_face).coords * MM_PER_M)
    }

    /// Creates the hand with the origin of its frame at `origin`, in the frame of the object.
    pub(super) fn at(origin: PointMm) -> Self {
        let at = |[x, y]: [f64; 2], z: f64| PointMm::new(x, y, z);
        let finger = |(root, tip)| RoundCone::new((at(root, AXIS_Z), ROOT_RADIUS), (at(tip, AXIS_Z), TIP_RADIUS));
        let (low, high) = PALM;
        let palm = RoundCone::new((at(low, PALM_RADIUS), PALM_RADIUS), (at(high, PALM_RADIUS), PALM_RADIUS));
        let [a, b, c, d, thumb] = FINGERS.map(finger);
        Self { origin, bones: [palm, a, b, c, d, thumb] }
    }
}

impl Solid for Hand {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let p = point - self.origin;
        let [palm, fingers @ ..] = &self.bones;
        let fingers = fingers.iter().map(|finger| finger.distance(&p)).fold(f64::INFINITY, f64::min);
        smooth_union(palm.distance(&p), fingers, WEB)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        let (min, max) = (PointMm::new(-3.0, -42.0, 0.0), PointMm::new(102.0, 62.0, 2.0 * PALM_RADIUS + WEB));
        (self.origin + min, self.origin + max)
    }

    fn material(&self, _point: &PointMm) -> Material {
        SKIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::scene::volume_from_object;
    use crate::simulation::{Object, RigOptions, VirtualRig};

    #[test]
    fn it_lies_in_its_box_in_front_of_the_volume_and_its_field_is_a_lower_bound() {
        let rig = VirtualRig::new(&RigOptions::usual(0.11)).unwrap();
        let pose = volume_from_object(Object::Tooth);
        let hand = Hand::in_front_of(&rig.exact_volume, &pose);
        let near_z = pose.inverse_transform_point(&Point3::new(0.0, 0.0, rig.exact_volume.min().z)).z * MM_PER_M;
        let (min, max) = hand.bounds_mm();
        assert!((min.z - near_z - GAP_MM).abs() < 1e-9, "{} and {near_z}", min.z);
        let mut inside = 0;
        for i in 0..50_000 {
            let place = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_478_0]
                .map(|a: f64| (a * f64::from(i)).fract() * 1.4 - 0.2);
            let p = min + (max - min).component_mul(&PointMm::from(place));
            let in_box = (0..3).all(|axis| p[axis] >= min[axis] && p[axis] <= max[axis]);
            let here = hand.distance_mm(&p);
            inside += usize::from(here < 0.0);
            assert!(in_box || here > 0.0, "{p} outside the box");
            let step = PointMm::new(0.6, -0.48, 0.64) * 0.01;
            let there = hand.distance_mm(&(p + step));
            assert!(here < 0.0 || there < 0.0 || (there - here).abs() <= 0.01 * (1.0 + 1e-9), "{p}");
        }
        assert!(inside > 4000, "{inside} of 50000 points are in the hand");
    }
}
