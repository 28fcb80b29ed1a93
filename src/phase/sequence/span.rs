//! The planes that the fringes of a block may lie in, by the steps that its images show, one for each motion.

/// Motions from one that is tried to the next, times the number of images: between them a parabola tells the best.
const MOTION_PITCH: f64 = 0.5;
/// Length below which a direction is none.
const NOTHING: f64 = 1e-6;

/// The two directions in which the fringes of a block change, of lengths whose squares add up to 1: what of them lies in a
/// plane is the explained share.
pub(super) type Directions = [Vec<f64>; 2];

/// A plane as orthonormal directions, all of mean zero.
type Plane = [Vec<f64>; 2];

/// The planes of one hypothesis, for motions from one sense to the other.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    pitch_rad: f64,
    /// An odd number; that of the scene at rest stands in the middle.
    planes: Vec<Plane>,
}

/// What the best plane of some leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unexplained {
    /// Share of the squares that lies beside it.
    pub(super) square: f64,
    /// Its motion, rad an image.
    pub(super) motion_rad: f64,
}

impl Planes {
    /// The planes of images with these phase shifts, rad, taken at these times, images, for motions up to the fastest.
    pub(super) fn new(shifts_rad: &[f64], times: &[f64], fastest_rad: f64) -> Self {
        let images = shifts_rad.len().max(1) as f64;
        let pitch_rad = MOTION_PITCH / images;
        let to_either_side = (fastest_rad / pitch_rad).ceil() as i32;
        let plane = |k: i32| plane(shifts_rad, times, f64::from(k) * pitch_rad);
        Self { pitch_rad, planes: (-to_either_side..=to_either_side).map(plane).collect() }
    }

    /// What they leave of the directions of a block. Of motions that suit alike the slowest.
    pub(super) fn unexplained(&self, directions: &Directions) -> Unexplained {
        /// A faster motion must leave less than a slower one by this.
        const LESS: f64 = 1e-9;
        let squares: Vec<f64> = self.planes.iter().map(|plane| beside(plane, directions)).collect();
        let middle = squares.len() / 2;
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

/// What the images of a fault would have for directions, all phases occurring alike.
pub(super) fn directions(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Directions {
    plane(shifts_rad, times, motion_rad).map(|direction| direction.iter().map(|x| x * 0.5_f64.sqrt()).collect())
}

fn plane(shifts_rad: &[f64], times: &[f64], motion_rad: f64) -> Plane {
    let angles = || shifts_rad.iter().zip(times).map(|(shift, time)| shift + motion_rad * time);
    let first = unit(without_mean(angles().map(f64::cos).collect()));
    let mut second = without_mean(angles().map(f64::sin).collect());
    let along = dot(&first, &second);
    second.iter_mut().zip(&first).for_each(|(value, a)| *value -= along * a);
    [first, unit(second)]
}

fn beside(plane: &Plane, directions: &Directions) -> f64 {
    let within: f64 = directions.iter().flat_map(|d| plane.iter().map(|p| dot(p, d).powi(2))).sum();
    (1.0 - within).max(0.0)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn without_mean(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

/// Of length 1, or zero where there is no direction.
fn unit(mut values: Vec<f64>) -> Vec<f64> {
    let length = dot(&values, &values).sqrt();
    let scale = if length > NOTHING { 1.0 / length } else { 0.0 };
    values.iter_mut().for_each(|value| *value *= scale);
    values
}
