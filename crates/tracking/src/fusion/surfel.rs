//! A surfel: a small piece of surface, the average of many measurements.

use fringeflow::geometry::{Point3, Vector3};

use crate::registration::{ReferencePoint, point_of};

use super::clean::Verdict;

/// A measurement to merge into a surfel, in the frame of the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement {
    pub(super) position: Point3,
    pub(super) normal: Vector3,
    /// Standard deviation along the ray, metres.
    pub(super) sigma_m: f64,
    pub(super) intensity: u8,
    /// Variance along the normal caused by the pose of its cloud, m².
    pub(super) pose_variance: f64,
    /// Index of its cloud among the merged clouds.
    pub(super) cloud: u32,
}

/// A piece of surface in the frame of the model. It fills one line of the cache: a model has up to millions, and a merge
/// visits them all.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Surfel {
    position_m: [f32; 3],
    normal: [f32; 3],
    /// Sum of the weights `1/σ²`, 1/m².
    weight: f32,
    /// `Σ w r²`, where r are the distances of the measurements along the normal from their mean.
    scatter: f32,
    /// Mean variance along the normal caused by the poses of its clouds, m².
    pose_variance: f32,
    /// Mean grey level.
    pub intensity: f32,
    /// Number of clouds that measured it.
    pub support: u32,
    /// Number of clouds that could have measured it: it lay in the image of C1, faced the camera, and nothing hid it.
    pub seen: u32,
    /// Number of clouds that measured a surface behind it.
    pub contradictions: u32,
    /// Index of the cloud that first measured it, among the merged clouds.
    pub(super) first_cloud: u32,
    measurements: u32,
}

impl Surfel {
    pub(super) fn new(m: &Measurement) -> Self {
        Self {
            position_m: single(&m.position.coords),
            normal: single(&m.normal),
            weight: weight(m) as f32,
            scatter: 0.0,
            pose_variance: m.pose_variance as f32,
            intensity: f32::from(m.intensity),
            support: 1,
            seen: 1,
            contradictions: 0,
            first_cloud: m.cloud,
            measurements: 1,
        }
    }

    /// Mean position of its measurements, weighted by their noise, metres.
    #[must_use]
    pub fn position(&self) -> Point3 {
        point_of(self.position_m)
    }

    /// Mean normal of length 1, pointing away from the object.
    #[must_use]
    pub fn normal(&self) -> Vector3 {
        point_of(self.normal).coords
    }

    /// The surfel as a point that clouds are registered to, expected at a pixel.
    pub(super) fn reference_point(&self, cam1_px: [u16; 2]) -> ReferencePoint {
        let (position_m, normal, sigma_m) = (self.position_m, self.normal, self.noise_variance().sqrt() as f32);
        ReferencePoint { position_m, normal, sigma_m, cam1_px }
    }

    /// Adds a measurement to the running means (West 1979, "Updating mean and variance estimates").
    pub(super) fn add(&mut self, m: &Measurement) {
        let (old_position, old_normal, old_weight) = (self.position(), self.normal(), f64::from(self.weight));
        let new_weight = weight(m);
        let total = old_weight + new_weight;
        let share = new_weight / total;
        let off = m.position - old_position;
        let distance = off.dot(&old_normal);
        self.scatter += (old_weight * share * distance * distance) as f32;
        self.position_m = single(&(old_position + off * share).coords);
        let normal = old_normal + (m.normal - old_normal) * share;
        self.normal = single(&normal.try_normalize(0.0).unwrap_or(old_normal));
        self.intensity += (f32::from(m.intensity) - self.intensity) * share as f32;
        self.pose_variance += (m.pose_variance as f32 - self.pose_variance) * share as f32;
        self.weight = total as f32;
        self.measurements += 1;
    }

    /// Number of measurements; a cloud may have several.
    pub(super) fn measurements(&self) -> u32 {
        self.measurements
    }

    /// Counts what a cloud shows.
    pub(super) fn judge(&mut self, verdict: Verdict) {
        self.support += u32::from(verdict == Verdict::Measured);
        self.seen += u32::from(verdict != Verdict::NotVisible);
        self.contradictions += u32::from(verdict == Verdict::Contradicted);
    }

    /// Whether at least `min_support` clouds measured it, or all that could have measured it if these are fewer.
    #[must_use]
    pub fn is_supported(&self, min_support: u32) -> bool {
        self.support >= min_support.min(self.seen)
    }

    /// Standard deviation of its position, metres. It contains the noise of the mean, enlarged if the measurements
    /// scatter more, and the error of the poses of the clouds, which does not shrink with more measurements.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        let excess = f64::from(self.scatter) / f64::from(self.measurements.saturating_sub(1).max(1));
        (excess.max(1.0) / f64::from(self.weight) + f64::from(self.pose_variance)).sqrt()
    }

    /// Variance of its position by noise alone, m².
    pub(super) fn noise_variance(&self) -> f64 {
        1.0 / f64::from(self.weight)
    }
}

/// A vector in single precision.
fn single(v: &Vector3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Smallest standard deviation of a measurement, metres: the resolution of single precision at arm's length.
const MIN_SIGMA_M: f64 = 1e-7;

fn weight(m: &Measurement) -> f64 {
    1.0 / m.sigma_m.max(MIN_SIGMA_M).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(z: f64, cloud: u32) -> Measurement {
        Measurement {
            position: Point3::new(0.0, 0.0, z),
            normal: -Vector3::z(),
            sigma_m: 1e-3,
            intensity: 100,
            pose_variance: 0.0,
            cloud,
        }
    }

    #[test]
    fn means_get_better_with_the_root_of_their_number() {
        let mut surfel = Surfel::new(&measured(0.3, 0));
        for cloud in 1..16 {
            surfel.add(&Measurement { sigma_m: 1e-3, ..measured(0.3, cloud) });
        }
        assert_eq!((surfel.measurements(), surfel.support), (16, 1), "a cloud counts when it is judged");
        assert!((surfel.sigma_m() - 2.5e-4).abs() < 1e-9, "{}", surfel.sigma_m());
    }

    #[test]
    fn scatter_beyond_noise_makes_a_surfel_less_certain() {
        let mut surfel = Surfel::new(&measured(0.3, 0));
        for cloud in 1..16 {
            surfel.add(&measured(if cloud % 2 == 0 { 0.3 } else { 0.31 }, cloud));
        }
        assert!((surfel.position().z - 0.305).abs() < 1e-7);
        // Deviations of 5 mm to either side, 16 measurements.
        assert!((surfel.sigma_m() - 5e-3 / 15.0_f64.sqrt()).abs() < 1e-6, "{}", surfel.sigma_m());
    }

    #[test]
    fn errors_of_poses_do_not_average_out() {
        let posed = |cloud| Measurement { pose_variance: 1e-8, ..measured(0.3, cloud) };
        let mut surfel = Surfel::new(&posed(0));
        for cloud in 1..1000 {
            surfel.add(&posed(cloud));
        }
        assert!((surfel.sigma_m() - (1e-6 / 1000.0 + 1e-8_f64).sqrt()).abs() < 1e-9);
    }
}
