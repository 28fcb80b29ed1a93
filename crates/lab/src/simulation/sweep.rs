//! Motion of a hand-held scanner: a closed sweep over the object, with a tremor.
//!
//! In: a few amplitudes. Out: for each pose of a round, the pose of the object in the measurement volume relative to
//! rest. After the last pose, the round repeats. Moving the object is equivalent to moving the cameras.

use nalgebra::{Translation3, UnitQuaternion};

use fringeflow::geometry::{Point3, Pose, Vector3};

use super::tremor::{Tremor, angle};
use super::{SimulationError, check_range};

/// Options of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepOptions {
    /// Number of poses per round, one per image.
    pub poses: usize,
    /// Travel to either side along x, y and z of the measurement volume, millimetres.
    pub travel_mm: [f64; 3],
    /// Rotation to either side about x, y and z through the centre of the volume, degrees.
    pub turn_deg: [f64; 3],
    /// Root mean square of the tremor along each axis, millimetres.
    pub tremor_mm: f64,
    /// Root mean square of the tremor about each axis, degrees.
    pub tremor_deg: f64,
    /// Distance by which the object may leave the measurement volume, millimetres. Parts outside are seen, but not
    /// measured.
    pub outside_mm: f64,
    /// Seed of the tremor.
    pub seed: u64,
}

impl Default for SweepOptions {
    /// A gentle sweep: the object moves about 0.03 mm from image to image.
    fn default() -> Self {
        Self {
            poses: 240,
            travel_mm: [1.0, 0.9, 0.15],
            turn_deg: [0.12, 0.2, 0.3],
            tremor_mm: 0.01,
            tremor_deg: 0.01,
            outside_mm: 0.0,
            seed: 1,
        }
    }
}

/// Displacement of points of the object from one image to the next, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSpeed {
    /// Mean over the round.
    pub mean_mm: f64,
    /// Maximum.
    pub max_mm: f64,
}

/// A closed sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    options: SweepOptions,
    tremor: Tremor,
}

/// Bounds of the options. The measurement volume is 100 mm wide; the object may be larger.
const MAX_POSES: f64 = 10_000.0;
const MAX_TRAVEL_MM: f64 = 200.0;
const MAX_TURN_DEG: f64 = 45.0;
const MAX_OUTSIDE_MM: f64 = 400.0;

impl Sweep {
    /// Creates a sweep.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: an option is out of range.
    pub fn new(options: SweepOptions) -> Result<Self, SimulationError> {
        check_range("the number of poses of the sweep", options.poses as f64, 1.0, MAX_POSES, "")?;
        for travel in options.travel_mm {
            check_range("the travel of the sweep", travel, 0.0, MAX_TRAVEL_MM, "mm")?;
        }
        for turn in options.turn_deg {
            check_range("the rotation of the sweep", turn, 0.0, MAX_TURN_DEG, "°")?;
        }
        check_range("the distance of the sweep outside the volume", options.outside_mm, 0.0, MAX_OUTSIDE_MM, "mm")?;
        let tremor = Tremor::new(options.poses, options.tremor_mm, options.tremor_deg, options.seed)?;
        Ok(Self { options, tremor })
    }

    /// Number of poses per round.
    #[must_use]
    pub fn poses(&self) -> usize {
        self.options.poses
    }

    /// Pose of the object relative to rest, in the frame of the measurement volume, metres. `number` may exceed a
    /// round.
    #[must_use]
    pub fn pose(&self, number: usize) -> Pose {
        let angle = angle(number as f64, 1, self.poses());
        let course = [angle.cos(), angle.sin(), (2.0 * angle).sin()];
        let turning = [(angle + 1.0).sin(), (angle - 0.5).cos(), (2.0 * angle + 0.3).cos()];
        let [tremor, turning_tremor] = self.tremor.at(number as f64);
        let shift = Vector3::from_fn(|i, _| self.options.travel_mm[i] * 1e-3 * course[i] + tremor[i]);
        let turn = Vector3::from_fn(|i, _| self.options.turn_deg[i].to_radians() * turning[i] + turning_tremor[i]);
        Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
    }

    /// Returns the speed of points of the object. `points` are given at rest, in the frame of the measurement volume,
    /// metres.
    #[must_use]
    pub fn speed(&self, points: &[Point3]) -> SweepSpeed {
        let poses: Vec<Pose> = (0..=self.poses()).map(|number| self.pose(number)).collect();
        let step_mm = |pair: &[Pose], point: &Point3| (pair[1] * point - pair[0] * point).norm() * 1e3;
        let steps_mm: Vec<f64> =
            poses.windows(2).flat_map(|pair| points.iter().map(move |point| step_mm(pair, point))).collect();
        SweepSpeed {
            mean_mm: steps_mm.iter().sum::<f64>() / steps_mm.len().max(1) as f64,
            max_mm: steps_mm.iter().copied().fold(0.0, f64::max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Point3> {
        [[-0.04, -0.03, 0.0], [0.04, 0.03, 0.01], [0.0, 0.0, -0.01]].map(Point3::from).to_vec()
    }

    #[test]
    fn it_is_closed_and_smooth() {
        let sweep = Sweep::new(SweepOptions::default()).unwrap();
        let poses = sweep.poses();
        assert_eq!(sweep.pose(poses), sweep.pose(0));
        assert_eq!(sweep.pose(5 * poses + 17), sweep.pose(17));
        for number in 0..poses {
            for point in points() {
                let at = [number, number + 1, number + 2].map(|n| sweep.pose(n) * point);
                let bend_mm = (at[0].coords + at[2].coords - 2.0 * at[1].coords).norm() * 1e3;
                assert!(bend_mm < 0.03, "pose {number}: {bend_mm} mm off a straight line");
            }
        }
    }

    #[test]
    fn the_usual_sweep_moves_by_three_hundredths_of_a_millimetre() {
        let speed = Sweep::new(SweepOptions::default()).unwrap().speed(&points());
        assert!((speed.mean_mm - 0.03).abs() < 0.003 && speed.max_mm < 0.06, "{speed:?}");
    }

    #[test]
    fn another_seed_gives_another_tremor() {
        let pose = |seed| Sweep::new(SweepOptions { seed, ..SweepOptions::default() }).unwrap().pose(11);
        assert_ne!(pose(1), pose(2));
    }

    #[test]
    fn implausible_sweeps_are_refused() {
        let refused = |options| Sweep::new(options).unwrap_err().to_string();
        let usual = SweepOptions::default();
        assert!(refused(SweepOptions { poses: 0, ..usual }).contains("poses"));
        assert!(refused(SweepOptions { turn_deg: [0.0, f64::NAN, 0.0], ..usual }).contains("NaN °"));
        assert!(refused(SweepOptions { tremor_mm: 3.0, ..usual }).contains("3 mm"));
    }
}
