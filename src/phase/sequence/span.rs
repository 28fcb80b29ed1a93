//! The planes that the fringes of a block may lie in, by the steps that its images show, one for each motion.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, Lanes, Level};

use super::Vector;

/// Fastest motion that any planes reach, rad an image.
pub(super) const FASTEST_RAD: f64 = 1.2;
/// Motions from one that is tried to the next, times the number of images: between them a parabola tells the best.
const MOTION_PITCH: f64 = 0.5;
/// Most planes to either side of that of the scene at rest.
const MOST_TO_EITHER_SIDE: usize = (FASTEST_RAD * MAX_IMAGES as f64 / MOTION_PITCH) as usize + 1;
/// Length below which a direction is none.
const NOTHING: f64 = 1e-6;
/// Planes that are asked together.
const GROUP: usize = 8;
const MOST_GROUPS: usize = (2 * MOST_TO_EITHER_SIDE + 1).div_ceil(GROUP);

/// The two directions in which the fringes of a block change, of lengths whose squares add up to 1: what of them lies in a
/// plane is the explained share.
pub(super) type Directions = [Vector; 2];

/// A plane as orthonormal directions, all of mean zero.
type Plane = [Vector; 2];

/// The planes of one hypothesis, for motions from one sense to the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Planes {
    images: usize,
    pitch_rad: f64,
    /// An odd number in all; that of the scene at rest stands in the middle.
    to_either_side: usize,
    groups: Vec<Group>,
}

/// Some planes: the numbers of each image in the first and in the second direction of each plane.
type Group = [[[f64; GROUP]; 2]; MAX_IMAGES];

/// What the best plane of some leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unexplained {
    /// Share of the squares that lies beside it.
    pub(super) square: f64,
    /// Its motion, rad an image.
    pub(super) motion_rad: f64,
}

impl Planes {
    /// Becomes the planes of images with these phase shifts, rad, taken at these times, images, for motions up to the fastest, at
    /// most [`FASTEST_RAD`].
    pub(super) fn set(&mut self, shifts_rad: &[f64], times: &[f64], fastest_rad: f64) {
        self.images = shifts_rad.len();
        self.pitch_rad = MOTION_PITCH / self.images.max(1) as f64;
        self.to_either_side = ((fastest_rad / self.pitch_rad).ceil() as usize).min(MOST_TO_EITHER_SIDE);
        let count = 2 * self.to_either_side + 1;
        self.groups.resize(count.div_ceil(GROUP), [[[0.0; GROUP]; 2]; MAX_IMAGES]);
        for k in 0..count {
            let motion_rad = (k as f64 - self.to_either_side as f64) * self.pitch_rad;
            let [first, second] = plane(shifts_rad, times, motion_rad);
            for (image, numbers) in self.groups[k / GROUP].iter_mut().enumerate() {
                (numbers[0][k % GROUP], numbers[1][k % GROUP]) = (first[image], second[image]);
            }
        }
    }

    /// What they leave of the directions of a block. Of motions that suit alike the slowest.
    pub(super) fn unexplained(&self, directions: &Directions) -> Unexplained {
        /// A faster motion must leave less than a slower one by this.
        const LESS: f64 = 1e-9;
        let squares = fringeflow_simd::run(Level::in_use(), BesideKernel { planes: self, directions });
        let squares = &squares.as_flattened()[..2 * self.to_either_side + 1];
        let middle = self.to_either_side;
        let outwards = (0..=middle).flat_map(|away| [middle + away, middle - away]);
        let best = outwards.fold(middle, |best, k| if squares[k] < squares[best] - LESS { k } else { best });
        let rad = |place: f64| (place - middle as f64) * self.pitch_rad;
        let neighbours = best.checked_sub(1).and_then(|k| Some((squares.get(k)?, squares.get(best + 1)?)));
        let Some((before, behind)) = neighbours else {
            return Unexplained { square: squares[best], motion_rad: rad(best as f64) };
        };
        let curvature = before - 2.0 * squares[best] + behind;
        let off = if curvature > 0.0 { (0.5 * (before - behind) / curvature).clamp(-1.0, 1.0) } else { 0.0 };
        let square = (squares[best] - 0.25 * (before - behind) * off).max(0.0);
        Unexplained { square, motion_rad: rad(best as f64 + off) }
    }
}

/// Shares of the squares of directions that lie beside each plane.
struct BesideKernel<'a> {
    planes: &'a Planes,
    directions: &'a Directions,
}

impl Kernel for BesideKernel<'_> {
    type Output = [[f64; GROUP]; MOST_GROUPS];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Self::Output {
        let Self { planes, directions: [one, other] } = self;
        let mut squares = [[0.0; GROUP]; MOST_GROUPS];
        for (squares, group) in squares.iter_mut().zip(&planes.groups) {
            let mut sums = [[0.0; GROUP]; 4];
            for image in 0..planes.images {
                let [first, second] = &group[image];
                let (one, other) = (one[image], other[image]);
                for k in 0..GROUP {
                    sums[0][k] += first[k] * one;
                    sums[1][k] += second[k] * one;
                    sums[2][k] += first[k] * other;
                    sums[3][k] += second[k] * other;
                }
            }
            let [a, b, c, d] = &sums;
            for k in 0..GROUP {
                let within = a[k] * a[k] + b[k] * b[k] + c[k] * c[k] + d[k] * d[k];
                squares[k] = (1.0 - within).max(0.0);
            }
        }
        squares
    }
}

/// What the images of a fault would have for directions, all phases occurring alike.
pub(super) fn directions(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Directions {
    plane(shifts_rad, times, motion_rad).map(|direction| direction.map(|x| x * 0.5_f64.sqrt()))
}

fn plane(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Plane {
    let [mut first, mut second] = [[0.0; MAX_IMAGES]; 2];
    for (image, (shift, time)) in shifts_rad.iter().zip(times).enumerate() {
        let angle = shift + motion_rad * time;
        (first[image], second[image]) = (angle.cos(), angle.sin());
    }
    let [a, b] = [&mut first[..shifts_rad.len()], &mut second[..shifts_rad.len()]];
    take_mean_off(a);
    make_unit(a);
    take_mean_off(b);
    let along = dot(a, b);
    b.iter_mut().zip(&*a).for_each(|(value, a)| *value -= along * a);
    make_unit(b);
    [first, second]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn take_mean_off(values: &mut [f64]) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
}

/// Makes it of length 1, or zero where there is no direction.
fn make_unit(values: &mut [f64]) {
    let length = dot(values, values).sqrt();
    let scale = if length > NOTHING { 1.0 / length } else { 0.0 };
    values.iter_mut().for_each(|value| *value *= scale);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beside_the_planes_is_what_lies_in_none_of_their_directions_at_every_level() {
        for images in [5, 6, 18, MAX_IMAGES] {
            let shifts_rad: Vec<f64> = (0..images).map(|i| 1.1 * i as f64).collect();
            let times: Vec<f64> = (0..images).map(|i| i as f64).collect();
            let mut planes = Planes::default();
            // What they were makes no difference.
            planes.set(&[0.0; MAX_IMAGES], &[1.0; MAX_IMAGES], FASTEST_RAD);
            planes.set(&shifts_rad, &times, FASTEST_RAD);
            let shown = directions(&shifts_rad, &times, 0.13);
            for level in Level::ALL {
                let squares = fringeflow_simd::run(level, BesideKernel { planes: &planes, directions: &shown });
                for k in 0..=2 * planes.to_either_side {
                    let motion_rad = (k as f64 - planes.to_either_side as f64) * planes.pitch_rad;
                    let plane = plane(&shifts_rad, &times, motion_rad);
                    let within: f64 = shown.iter().flat_map(|d| plane.iter().map(|p| dot(p, d).powi(2))).sum();
                    assert_eq!(squares.as_flattened()[k], (1.0 - within).max(0.0), "{images} images, {level:?}");
                }
            }
            let best = planes.unexplained(&shown);
            assert!(best.square < 1e-3 && (best.motion_rad - 0.13).abs() < 0.01, "{best:?}");
        }
    }
}
