//! Motion of the object of a dataset: field `motion` of `meta.json`.
//!
//! `x_v(k) = Rm[k]·x_obj + tm[k]` is the position of a point of the object at phase image k, in the frame of the
//! measurement volume. `t_ref`, counted in images, is the time of the ground truth; at this time `x_obj = x_v`.

use serde::{Deserialize, Serialize};

use fringeflow::calibration::Unit;
use fringeflow::geometry::{Pose, interpolate_pose};

use super::error::Problem;
use super::fields::{field_problem, raw_pose, rigid_pose};

/// Pose of the object in every phase image, relative to the time of the ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Time of the ground truth, counted in phase images: 1.5 is halfway between the images 1 and 2.
    pub reference: f64,
    /// Pose in every phase image, frame of the measurement volume, metres.
    pub poses: Vec<Pose>,
}

impl Motion {
    /// Returns the pose at a time, counted in phase images; frame of the measurement volume, metres. Between two images
    /// the object moves at constant velocity and rotates at a constant rate; before the first image and after the last
    /// one it stands still. Returns `None` if there are no images.
    #[must_use]
    pub fn pose_at(&self, image: f64) -> Option<Pose> {
        let last = self.poses.len().checked_sub(1)?;
        let image = image.clamp(0.0, last as f64);
        let before = self.poses.get(image.floor() as usize)?;
        let after = self.poses.get(image.ceil() as usize)?;
        Some(interpolate_pose(before, after, image.fract()))
    }

    /// Returns the `count` images (or all) whose middle is nearest to the time of the ground truth.
    pub(super) fn reference_images(&self, count: usize) -> std::ops::Range<usize> {
        let count = count.min(self.poses.len());
        let last = self.poses.len() - count;
        let start = (self.reference - (count as f64 - 1.0) / 2.0).round().clamp(0.0, last as f64) as usize;
        start..start + count
    }
}

/// The motion in `meta.json`, lengths in the unit of the file.
#[derive(Deserialize, Serialize)]
pub(super) struct RawMotion {
    t_ref: f64,
    #[serde(rename = "Rm")]
    rm: Vec<[[f64; 3]; 3]>,
    tm: Vec<[f64; 3]>,
}

/// The motion written to `meta.json`, with additional fields that readers ignore.
#[derive(Serialize)]
pub(super) struct WrittenMotion {
    model: &'static str,
    #[serde(flatten)]
    motion: RawMotion,
    /// Mean speeds over the sequence.
    mm_per_image: f64,
    deg_per_image: f64,
}

const MODEL: &str = "object moves rigidly: x_v(k) = Rm[k] x_obj + tm[k]; image k is taken at k; truth, Gray code, white and \
                     black at t_ref (x_obj = x_v there)";

impl RawMotion {
    /// Checks the motion of a dataset with this number of phase images. A dataset with motion needs a volume, since the
    /// motion is stated in its frame.
    pub(super) fn parse(&self, images: usize, has_volume: bool, unit: Unit) -> Result<Motion, Problem> {
        if !has_volume {
            return Err(field_problem(
                "motion",
                "is in the frame of the measurement volume; add field volume".to_owned(),
            ));
        }
        for (name, found) in [("motion.Rm", self.rm.len()), ("motion.tm", self.tm.len())] {
            if found != images {
                let what = format!("has {found} values; give one for each of the {images} values of phase_shift_rad");
                return Err(field_problem(name, what));
            }
        }
        let last = images.saturating_sub(1) as f64;
        if !(0.0..=last).contains(&self.t_ref) {
            let what = format!("is {}; it must lie between the first and the last image, 0 and {last}", self.t_ref);
            return Err(field_problem("motion.t_ref", what));
        }
        let pose = |(k, (r, t)): (usize, (&[[f64; 3]; 3], &[f64; 3]))| {
            rigid_pose(r, t, unit.in_metres()).map_err(|what| field_problem("motion.Rm", format!("value {k} {what}")))
        };
        let poses = self.rm.iter().zip(&self.tm).enumerate().map(pose).collect::<Result<_, _>>()?;
        Ok(Motion { reference: self.t_ref, poses })
    }
}

impl WrittenMotion {
    pub(super) fn new(motion: &Motion, unit: Unit) -> Self {
        let (rm, tm) = motion.poses.iter().map(|pose| raw_pose(pose, unit.in_metres())).unzip();
        let mean = |amount: fn(&Pose, &Pose) -> f64| {
            let pairs = motion.poses.windows(2).map(|pair| amount(&pair[0], &pair[1]));
            pairs.sum::<f64>() / motion.poses.len().saturating_sub(1).max(1) as f64
        };
        Self {
            model: MODEL,
            motion: RawMotion { t_ref: motion.reference, rm, tm },
            mm_per_image: mean(|a, b| (b.translation.vector - a.translation.vector).norm() * 1e3),
            deg_per_image: mean(|a, b| a.rotation.angle_to(&b.rotation).to_degrees()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meta;
    use fringeflow::geometry::Vector3;

    fn motion() -> Motion {
        let pose = |k: f64| Pose::new(Vector3::new(0.001, -0.002, 0.0005) * k, Vector3::new(0.02, 0.1, -0.05) * k);
        Motion { reference: 1.5, poses: [-1.5, -0.5, 0.5, 1.5].map(pose).to_vec() }
    }

    /// Parses a description with this motion, changed by `change`.
    fn parsed(change: impl FnOnce(&mut serde_json::Value)) -> Result<Option<Motion>, Problem> {
        let mut meta = serde_json::json!({
            "image_size": [4, 4], "steps": 4, "phase_shift_rad": [0.0, 1.5, 3.0, 4.5],
            "period_px": 16.0, "phase_sign": 1.0, "phase_offset_rad": 0.0,
            "volume": {
                "R_v": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "T_v": [0, 0, 300], "min": [-1, -1, -1], "max": [1, 1, 1]
            },
            "motion": serde_json::to_value(WrittenMotion::new(&motion(), Unit::Millimetre)).unwrap(),
        });
        change(&mut meta);
        meta::parse(&meta.to_string())?.motion(Unit::Millimetre)
    }

    #[test]
    fn it_reads_back_as_written() {
        let (read, written) = (parsed(|_| ()).unwrap().unwrap(), motion());
        assert_eq!(read.reference, 1.5);
        assert_eq!(read.poses.len(), 4);
        for (a, b) in read.poses.iter().zip(&written.poses) {
            assert!((a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12);
        }
        assert_eq!(parsed(|meta| meta["motion"] = serde_json::Value::Null).unwrap(), None);
    }

    #[test]
    fn the_written_motion_states_its_speed() {
        let written = WrittenMotion::new(&motion(), Unit::Metre);
        assert!((written.mm_per_image - 5.25_f64.sqrt()).abs() < 1e-12, "{}", written.mm_per_image);
        let turn = Vector3::new(0.02, 0.1, -0.05).norm().to_degrees();
        assert!((written.deg_per_image - turn).abs() < 1e-9, "{}", written.deg_per_image);
    }

    #[test]
    fn between_two_images_it_is_even_and_beyond_them_at_rest() {
        let motion = motion();
        let middle = motion.pose_at(motion.reference).unwrap();
        assert!((middle.to_homogeneous() - Pose::identity().to_homogeneous()).amax() < 1e-12);
        let quarter = motion.pose_at(0.25).unwrap();
        assert!((quarter.rotation.scaled_axis() - Vector3::new(0.02, 0.1, -0.05) * -1.25).norm() < 1e-12);
        assert_eq!((motion.pose_at(-3.0), motion.pose_at(9.0)), (Some(motion.poses[0]), Some(motion.poses[3])));
        assert_eq!(Motion { reference: 0.0, poses: Vec::new() }.pose_at(0.0), None);
    }

    #[test]
    fn the_cycle_in_the_middle_is_found() {
        let of = |images: usize, reference: f64| Motion { reference, poses: vec![Pose::identity(); images] };
        assert_eq!(of(16, 7.5).reference_images(4), 6..10);
        assert_eq!(of(21, 10.0).reference_images(3), 9..12);
        assert_eq!(of(8, 0.0).reference_images(4), 0..4);
        assert_eq!(of(8, 7.0).reference_images(4), 4..8);
        assert_eq!(of(18, 8.5).reference_images(6), 6..12);
        assert_eq!(of(3, 1.0).reference_images(4), 0..3);
    }

    #[test]
    fn invalid_fields_are_refused_by_name() {
        let refused = |change: fn(&mut serde_json::Value)| parsed(change).unwrap_err().to_string();
        let short = refused(|meta| meta["motion"]["Rm"].as_array_mut().unwrap().truncate(3));
        assert!(short.contains("motion.Rm: has 3 values") && short.contains("4 values of phase_shift_rad"), "{short}");
        let short = refused(|meta| meta["motion"]["tm"].as_array_mut().unwrap().clear());
        assert!(short.contains("motion.tm: has 0 values"), "{short}");
        let turned = refused(|meta| meta["motion"]["Rm"][2][0][0] = 2.0.into());
        assert!(turned.contains("motion.Rm: value 2 is not a rotation"), "{turned}");
        let late = refused(|meta| meta["motion"]["t_ref"] = 3.1.into());
        assert!(late.contains("motion.t_ref: is 3.1") && late.contains("0 and 3"), "{late}");
        let lost = refused(|meta| meta["volume"] = serde_json::Value::Null);
        assert!(lost.contains("motion: is in the frame of the measurement volume; add field volume"), "{lost}");
        let missing = refused(|meta| drop(meta["motion"].as_object_mut().unwrap().remove("tm")));
        assert!(missing.contains("tm"), "{missing}");
    }
}
