//! How the hand moves the scanner: a closed sweep over the object, with a tremor.
//!
//! In: a few amplitudes. Out: for each pose of a round, where the object is in the measurement volume compared with its
//! place at rest; the pose after the last is the first. To the cameras it is the same whether they or the object move.
//!
//! The tremor is a sum of waves whose periods last from ten to forty images, at sixty images a second 1.5 to 6 Hz.

use std::f64::consts::TAU;

use nalgebra::{Translation3, UnitQuaternion};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::geometry::{Point3, Pose, Vector3};

use super::sensor::standard_normal;
use super::{SimulationError, check_range};

/// What a sweep is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepOptions {
    /// Poses of a round, one an image.
    pub poses: usize,
    /// How far the sweep leads to either side along x, y and z of the measurement volume, millimetres.
    pub travel_mm: [f64; 3],
    /// How far it turns to either side about x, y and z through the centre of the volume, degrees.
    pub turn_deg: [f64; 3],
    /// Root mean square of the tremor along each axis, millimetres.
    pub tremor_mm: f64,
    /// Root mean square of the tremor about each axis, degrees.
    pub tremor_deg: f64,
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
            seed: 1,
        }
    }
}

/// How far places of the object move from one image to the next, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSpeed {
    /// Mean over the round.
    pub mean_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

/// A closed sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    options: SweepOptions,
    /// Waves of the tremor along x, y, z (metres) and about them (rad).
    tremor: [Vec<Wave>; 6],
}

/// One wave of the tremor: periods a round, and its parts of cosine and sine.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wave {
    periods: usize,
    cosine: f64,
    sine: f64,
}

/// Shortest and longest period of the tremor, images.
const TREMOR_IMAGES: [usize; 2] = [10, 40];
/// Bounds of the options: the measurement volume is 100 mm across.
const MAX_POSES: f64 = 10_000.0;
const MAX_TRAVEL_MM: f64 = 50.0;
const MAX_TURN_DEG: f64 = 45.0;
const MAX_TREMOR: f64 = 1.0;

impl Sweep {
    /// A sweep from its options.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: an option out of its range.
    pub fn new(options: SweepOptions) -> Result<Self, SimulationError> {
        check_range("the number of poses of the sweep", options.poses as f64, 1.0, MAX_POSES, "")?;
        for travel in options.travel_mm {
            check_range("the travel of the sweep", travel, 0.0, MAX_TRAVEL_MM, "mm")?;
        }
        for turn in options.turn_deg {
            check_range("the turn of the sweep", turn, 0.0, MAX_TURN_DEG, "°")?;
        }
        check_range("the tremor of the sweep", options.tremor_mm, 0.0, MAX_TREMOR, "mm")?;
        check_range("the turning tremor of the sweep", options.tremor_deg, 0.0, MAX_TREMOR, "°")?;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let tremor = std::array::from_fn(|axis| {
            let rms = if axis < 3 { options.tremor_mm * 1e-3 } else { options.tremor_deg.to_radians() };
            waves(&mut rng, options.poses, rms)
        });
        Ok(Self { options, tremor })
    }

    /// Number of poses of a round.
    #[must_use]
    pub fn poses(&self) -> usize {
        self.options.poses
    }

    /// Where a pose takes what is at rest, in the frame of the measurement volume, metres; poses count on after a round.
    #[must_use]
    pub fn pose(&self, number: usize) -> Pose {
        let angle = self.angle(number, 1);
        let course = [angle.cos(), angle.sin(), (2.0 * angle).sin()];
        let turning = [(angle + 1.0).sin(), (angle - 0.5).cos(), (2.0 * angle + 0.3).cos()];
        let tremor: [f64; 6] = std::array::from_fn(|axis| self.tremor(axis, number));
        let shift = Vector3::from_fn(|i, _| self.options.travel_mm[i] * 1e-3 * course[i] + tremor[i]);
        let turn = Vector3::from_fn(|i, _| self.options.turn_deg[i].to_radians() * turning[i] + tremor[i + 3]);
        Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
    }

    /// How fast places at rest are moved, frame of the measurement volume, metres.
    #[must_use]
    pub fn speed(&self, places: &[Point3]) -> SweepSpeed {
        let poses: Vec<Pose> = (0..=self.poses()).map(|number| self.pose(number)).collect();
        let way_mm = |pair: &[Pose], place: &Point3| (pair[1] * place - pair[0] * place).norm() * 1e3;
        let ways: Vec<f64> =
            poses.windows(2).flat_map(|pair| places.iter().map(move |place| way_mm(pair, place))).collect();
        SweepSpeed {
            mean_mm: ways.iter().sum::<f64>() / ways.len().max(1) as f64,
            max_mm: ways.iter().copied().fold(0.0, f64::max),
        }
    }

    fn tremor(&self, axis: usize, number: usize) -> f64 {
        let value = |wave: &Wave| {
            let angle = self.angle(number, wave.periods);
            wave.cosine * angle.cos() + wave.sine * angle.sin()
        };
        self.tremor[axis].iter().map(value).sum()
    }

    /// Angle of a wave at a pose; whole numbers as long as possible, so that every round has the same bits.
    fn angle(&self, number: usize, periods: usize) -> f64 {
        let poses = self.poses();
        TAU * (number % poses * periods % poses) as f64 / poses as f64
    }
}

/// Waves of random parts, together of root mean square `rms`.
fn waves(rng: &mut ChaCha8Rng, poses: usize, rms: f64) -> Vec<Wave> {
    let [shortest, longest] = TREMOR_IMAGES;
    let fewest = poses.div_ceil(longest);
    let drawn = (fewest..=(poses / shortest).max(fewest)).map(|periods| Wave {
        periods,
        cosine: standard_normal(rng),
        sine: standard_normal(rng),
    });
    let drawn: Vec<Wave> = drawn.collect();
    let power: f64 = drawn.iter().map(|w| (w.cosine * w.cosine + w.sine * w.sine) / 2.0).sum();
    let scale = rms / power.sqrt();
    drawn.into_iter().map(|w| Wave { cosine: w.cosine * scale, sine: w.sine * scale, ..w }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> Vec<Point3> {
        [[-0.04, -0.03, 0.0], [0.04, 0.03, 0.01], [0.0, 0.0, -0.01]].map(Point3::from).to_vec()
    }

    #[test]
    fn it_is_closed_and_smooth() {
        let sweep = Sweep::new(SweepOptions::default()).unwrap();
        let poses = sweep.poses();
        assert_eq!(sweep.pose(poses), sweep.pose(0));
        assert_eq!(sweep.pose(5 * poses + 17), sweep.pose(17));
        for number in 0..poses {
            for place in places() {
                let at = [number, number + 1, number + 2].map(|n| sweep.pose(n) * place);
                let bend_mm = (at[0].coords + at[2].coords - 2.0 * at[1].coords).norm() * 1e3;
                assert!(bend_mm < 0.03, "pose {number}: {bend_mm} mm off a straight line");
            }
        }
    }

    #[test]
    fn the_usual_one_moves_by_three_hundredths_of_a_millimetre() {
        let speed = Sweep::new(SweepOptions::default()).unwrap().speed(&places());
        assert!((speed.mean_mm - 0.03).abs() < 0.003 && speed.max_mm < 0.06, "{speed:?}");
    }

    #[test]
    fn the_tremor_has_its_strength_and_its_band() {
        let options = SweepOptions {
            travel_mm: [0.0; 3],
            turn_deg: [0.0; 3],
            tremor_mm: 0.2,
            tremor_deg: 0.1,
            ..SweepOptions::default()
        };
        let sweep = Sweep::new(options).unwrap();
        let poses = sweep.poses();
        for axis in 0..3 {
            let shift_mm = |n: usize| sweep.pose(n).translation.vector[axis] * 1e3;
            let rms = ((0..poses).map(|n| shift_mm(n).powi(2)).sum::<f64>() / poses as f64).sqrt();
            assert!((rms - 0.2).abs() < 1e-9, "axis {axis}: {rms} mm");
            let power = |periods: usize| {
                let wave =
                    |f: fn(f64) -> f64| (0..poses).map(|n| shift_mm(n) * f(sweep.angle(n, periods))).sum::<f64>();
                wave(f64::sin).hypot(wave(f64::cos)) * 2.0 / poses as f64
            };
            assert!((0..6).chain(25..poses / 2).all(|periods| power(periods) < 1e-9), "axis {axis}");
            assert!((6..=24).any(|periods| power(periods) > 0.03), "axis {axis}");
        }
    }

    #[test]
    fn another_seed_trembles_otherwise() {
        let pose = |seed| Sweep::new(SweepOptions { seed, ..SweepOptions::default() }).unwrap().pose(11);
        assert_ne!(pose(1), pose(2));
    }

    #[test]
    fn what_no_hand_does_is_refused() {
        let refused = |options| Sweep::new(options).unwrap_err().to_string();
        let usual = SweepOptions::default();
        assert!(refused(SweepOptions { poses: 0, ..usual }).contains("poses"));
        assert!(refused(SweepOptions { turn_deg: [0.0, f64::NAN, 0.0], ..usual }).contains("NaN °"));
        assert!(refused(SweepOptions { tremor_mm: 3.0, ..usual }).contains("3 mm"));
    }
}
