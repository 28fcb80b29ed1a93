//! Planes of possible fringes in the space of M images, one per motion. In: steps and times. Out: the part of a block's
//! signal outside the best plane. Cost: four multiply-adds per image and plane, 31 planes for six images.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, Lanes, Level};

use super::Vector;

/// Fastest motion that is tried, rad per image.
pub(super) const FASTEST_RAD: f64 = 1.2;
/// Distance between tried motions, times the number of images. A parabola interpolates between them.
const MOTION_PITCH: f64 = 0.5;
/// Most planes on each side of the plane at rest.
const MAX_PER_SIDE: usize = (FASTEST_RAD * MAX_IMAGES as f64 / MOTION_PITCH) as usize + 1;
/// Vectors shorter than this count as zero.
const MIN_LENGTH: f64 = 1e-6;
/// Planes evaluated together.
const GROUP: usize = 8;
const MAX_GROUPS: usize = (2 * MAX_PER_SIDE + 1).div_ceil(GROUP);

/// The two directions in which the fringes of a block change. The squares of their lengths add up to 1, so the squared
/// length of their projection onto a plane is the explained share.
pub(super) type Directions = [Vector; 2];

/// A plane as orthonormal directions, all of mean zero.
type Plane = [Vector; 2];

/// The planes of one hypothesis, by rising motion.
#[derive(Clone, Debug, Default)]
pub(super) struct Planes {
    images: usize,
    pitch_rad: f64,
    /// Planes on each side of the plane at rest, which is in the middle.
    per_side: usize,
    groups: Vec<Group>,
}

/// `GROUP` planes side by side: `[image][first or second direction][plane]`.
type Group = [[[f64; GROUP]; 2]; MAX_IMAGES];

/// Part of a signal outside the best plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unexplained {
    /// Share of the squared length outside the plane.
    pub(super) square: f64,
    /// Motion of the plane, rad per image.
    pub(super) motion_rad: f64,
}

impl Planes {
    /// Sets the planes of images with these phase shifts (rad) and times (images), for motions up to `fastest_rad`,
    /// which is at most [`FASTEST_RAD`].
    pub(super) fn set(&mut self, shifts_rad: &[f64], times: &[f64], fastest_rad: f64) {
        self.images = shifts_rad.len();
        self.pitch_rad = MOTION_PITCH / self.images.max(1) as f64;
        self.per_side = ((fastest_rad / self.pitch_rad).ceil() as usize).min(MAX_PER_SIDE);
        let count = 2 * self.per_side + 1;
        self.groups.resize(count.div_ceil(GROUP), [[[0.0; GROUP]; 2]; MAX_IMAGES]);
        for k in 0..count {
            let motion_rad = (k as f64 - self.per_side as f64) * self.pitch_rad;
            let [first, second] = plane(shifts_rad, times, motion_rad);
            for (image, numbers) in self.groups[k / GROUP].iter_mut().enumerate() {
                (numbers[0][k % GROUP], numbers[1][k % GROUP]) = (first[image], second[image]);
            }
        }
    }

    /// Part of a block's signal outside the best plane; among equally good ones, the one of the slowest motion.
    pub(super) fn unexplained(&self, directions: &Directions) -> Unexplained {
        /// A faster motion must leave less than a slower one by this.
        const MIN_GAIN: f64 = 1e-9;
        let squares = fringeflow_simd::run(Level::in_use(), UnexplainedKernel { planes: self, directions });
        let squares = &squares.as_flattened()[..2 * self.per_side + 1];
        let middle = self.per_side;
        let outwards = (0..=middle).flat_map(|away| [middle + away, middle - away]);
        let best = outwards.fold(middle, |best, k| if squares[k] < squares[best] - MIN_GAIN { k } else { best });
        let rad = |place: f64| (place - middle as f64) * self.pitch_rad;
        let neighbours = best.checked_sub(1).and_then(|k| Some((squares.get(k)?, squares.get(best + 1)?)));
        let Some((before, after)) = neighbours else {
            return Unexplained { square: squares[best], motion_rad: rad(best as f64) };
        };
        // Vertex of the parabola through the best plane and its neighbours.
        let curvature = before - 2.0 * squares[best] + after;
        let offset = if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-1.0, 1.0) } else { 0.0 };
        let square = (squares[best] - 0.25 * (before - after) * offset).max(0.0);
        Unexplained { square, motion_rad: rad(best as f64 + offset) }
    }
}

/// Share of the squared length of `directions` outside each plane.
struct UnexplainedKernel<'a> {
    planes: &'a Planes,
    directions: &'a Directions,
}

impl Kernel for UnexplainedKernel<'_> {
    type Output = [[f64; GROUP]; MAX_GROUPS];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Self::Output {
        let Self { planes, directions: [one, other] } = self;
        let mut squares = [[0.0; GROUP]; MAX_GROUPS];
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

/// Directions of images with these shifts, times and motion, if all phases are equally frequent.
pub(super) fn directions(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Directions {
    plane(shifts_rad, times, motion_rad).map(|direction| direction.map(|x| x * 0.5_f64.sqrt()))
}

/// Orthonormal basis of the plane of cos θ and sin θ without their means.
fn plane(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Plane {
    let [mut first, mut second] = [[0.0; MAX_IMAGES]; 2];
    for (image, (shift, time)) in shifts_rad.iter().zip(times).enumerate() {
        let angle = shift + motion_rad * time;
        (first[image], second[image]) = (angle.cos(), angle.sin());
    }
    let [a, b] = [&mut first[..shifts_rad.len()], &mut second[..shifts_rad.len()]];
    subtract_mean(a);
    normalize(a);
    subtract_mean(b);
    let projection = dot(a, b);
    b.iter_mut().zip(&*a).for_each(|(value, a)| *value -= projection * a);
    normalize(b);
    [first, second]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn subtract_mean(values: &mut [f64]) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
}

/// Scales to length 1; vectors that are nearly zero become zero.
fn normalize(values: &mut [f64]) {
    let length = dot(values, values).sqrt();
    let scale = if length > MIN_LENGTH { 1.0 / length } else { 0.0 };
    values.iter_mut().for_each(|value| *value *= scale);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unexplained_share_is_that_outside_both_directions_of_a_plane_at_every_level() {
        for images in [5, 6, 18, MAX_IMAGES] {
            let shifts_rad: Vec<f64> = (0..images).map(|i| 1.1 * i as f64).collect();
            let times: Vec<f64> = (0..images).map(|i| i as f64).collect();
            let mut planes = Planes::default();
            // Old contents must not matter.
            planes.set(&[0.0; MAX_IMAGES], &[1.0; MAX_IMAGES], FASTEST_RAD);
            planes.set(&shifts_rad, &times, FASTEST_RAD);
            let shown = directions(&shifts_rad, &times, 0.13);
            for level in Level::ALL {
                let squares = fringeflow_simd::run(level, UnexplainedKernel { planes: &planes, directions: &shown });
                for k in 0..=2 * planes.per_side {
                    let motion_rad = (k as f64 - planes.per_side as f64) * planes.pitch_rad;
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
