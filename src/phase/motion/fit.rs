//! Constants of the least-squares fit of a moving sinusoid. In: the phase shifts of a window. Out: weights and
//! responses. Cost: once per kind of window, up to a millisecond.
//!
//! Image i is taken at `t_i` images from the centre of the window, with phase shift `s_i`; the scene moves the phase by
//! ε per image. The model is `I_i = A + Re(z·e^(i·(s_i + ε·t_i)))`, z = B·e^(iφ), φ the phase at the centre. To first
//! order in ε it is linear: `I_i = A + A'·t_i + Re((z + z'·t_i)·e^(i·s_i))`, z' = iεz. A' is the effect of texture,
//! shading and light that move across the pixel; z' contains their effect on the modulation.
//!
//! The phase is fitted without A' if the images hardly separate A' from z. That is the case for five images, and for
//! eight and more steps with two more images. With A', the phase would be twice as noisy as from the same images of a
//! resting scene for 8 steps, and three times for 16.

use nalgebra::{Matrix2, SMatrix, SVector};

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};

use crate::phase::shifts::ShiftError;

use super::brightness_plan::BrightnessEqualization;
use super::complement::unexplained;
use super::image_times::{pair, runs, side, time};

/// Unknowns of the linear fit: A, real and imaginary part of z and z', and A'.
const UNKNOWNS: usize = 6;
/// Fewest images of a window. With so few, A' is taken as zero.
const LEAST_IMAGES: usize = UNKNOWNS - 1;
/// The phase is fitted with A' if its noise is at most this multiple of that of a resting scene.
const MAX_TREND_NOISE: f64 = 1.25;
/// Smallest eigenvalue of the normal matrix, relative to the largest, that determines all unknowns.
const MIN_EIGENVALUE_SHARE: f64 = 1e-5;
/// Intervals of the table from measured to true motion.
pub(super) const TABLE: usize = 512;
/// Entries of a table.
pub(super) const MOTIONS: usize = TABLE + 2;
/// Largest motion of the table, rad per image; less if the images cannot distinguish such motions.
const WIDEST_RAD: f64 = 1.5;
/// Smallest response |H| to a measurable motion: the share of the modulation that remains.
const MIN_RESPONSE: f64 = 0.3;

/// A complex number: real and imaginary part.
pub(super) type Complex = [f32; 2];

/// Weighted sums of the samples of a pixel: A, Re z, Im z, Re z' and Im z' of the fit without A'; what only A' explains
/// (0 if A' is not determined); the first two of the [`MotionFit::residuals`].
pub(super) const SUMS: usize = 8;
/// Residuals among the [`SUMS`]: what z' explains.
pub(super) const IN_SUMS: usize = 2;

/// Constants of the fit of M images with known shifts.
#[derive(Clone, Debug)]
pub struct MotionFit {
    shifts_rad: Vec<f64>,
    /// `cos s_i` and `sin s_i`.
    pub(super) turns: Vec<Complex>,
    /// Weights of each image in the [`SUMS`].
    pub(super) weights: Vec<[f32; SUMS]>,
    /// Responses of the fit without A', which measures the motion: with the same images it tolerates more motion.
    pub(super) rough: Response,
    /// Responses of the fit that yields the phase.
    pub(super) fine: Response,
    /// The z of that fit is z plus these multiples of what only A' explains.
    pub(super) trend_in_z: Complex,
    /// See [`residuals`]: image weights of each.
    pub(super) residuals: Vec<Vec<f32>>,
    /// Responses of A and of the residuals to z.
    pub(super) offset_response: TurnedSum,
    pub(super) residual_responses: Vec<TurnedSum>,
    /// Response of z' to the conjugate of z.
    pub(super) slope_ripple: TurnedSum,
    /// Tables for motions that raise the phase and for motions that lower it. They differ if the window is not a whole
    /// number of half cycles.
    motions: [MotionTable; 2],
    /// Largest slopes of both tables, and all their motions one after the other.
    pub(super) limits: [f32; 2],
    pub(super) motions_rad: Vec<f32>,
    noise_gain: f32,
    /// For equalizing the brightness of the images.
    pub(super) equalization: BrightnessEqualization,
    /// First and last images of the runs that may show a single surface, the longest first.
    pub(super) runs: Vec<[usize; 2]>,
}

/// Response of a fitted z to the motion ε.
#[derive(Clone, Debug)]
pub(super) struct Response {
    /// `H(ε) = Σ h_i·e^(iεt_i)`, the response to z itself.
    pub(super) direct: TurnedSum,
    /// `G(ε) = Σ g_i·e^(−iεt_i)`, the response to the conjugate of z: the ripple at twice the fringe frequency.
    pub(super) ripple: TurnedSum,
}

/// A sum `Σ c_i·e^(±iεt_i)` over the images, evaluated from the turns `e^(iε|t_i|)`.
#[derive(Clone, Debug)]
pub(super) struct TurnedSum {
    /// For each pair of images at the same distance from the centre: factors of its cosine and sine in the real part of
    /// the sum, then in the imaginary part.
    pub(super) factors: Vec<[f32; 4]>,
}

impl TurnedSum {
    fn new(coefficients: &[[f64; 2]], sense: f64) -> Self {
        let images = coefficients.len();
        let mut factors = vec![[0.0; 4]; images.div_ceil(2)];
        for (i, [re, im]) in coefficients.iter().enumerate() {
            let sign = sense * f64::from(side(i, images));
            let factors = &mut factors[pair(i, images)];
            factors.iter_mut().zip([*re, -sign * im, *im, sign * re]).for_each(|(factor, part)| *factor += part);
        }
        Self { factors: factors.into_iter().map(|factors| factors.map(|factor| factor as f32)).collect() }
    }
}

/// Table from the fitted slope `Im(z'/z)` to the true motion, for one sign. Both are equal for small motions; the slope
/// of large motions is smaller.
#[derive(Clone, Debug)]
struct MotionTable {
    /// Largest slope.
    limit: f32,
    /// Motions at equally spaced slopes up to the limit; the last entry is repeated for interpolation.
    motion_rad: Box<[f32; MOTIONS]>,
}

impl MotionFit {
    /// The fit of images with these shifts (rad) in order of time, equally spaced in time.
    ///
    /// ```text
    /// weights = least squares without A'; phase weights = with A', if that is little noisier than a resting scene
    /// residuals = what neither a resting sinusoid nor A' explains
    /// responses H and G of both fits, of z' and of A and the residuals, to a moving sinusoid
    /// tables from the fitted slope Im(z'/z) to the motion, one for each direction of motion
    /// ```
    ///
    /// # Errors
    /// Fewer than five images, more than [`MAX_IMAGES`], a shift that is not finite, or shifts that do not determine
    /// phase and motion.
    pub fn new(shifts_rad: &[f64]) -> Result<Self, ShiftError> {
        let images = shifts_rad.len();
        if !(LEAST_IMAGES..=MAX_IMAGES).contains(&images) {
            return Err(ShiftError::Window { images, least: LEAST_IMAGES, most: MAX_IMAGES });
        }
        if let Some(index) = shifts_rad.iter().position(|s| !s.is_finite()) {
            return Err(ShiftError::NotFinite { index, value: shifts_rad[index] });
        }
        let basis: Vec<SVector<f64, UNKNOWNS>> = (0..images)
            .map(|i| {
                let (t, (sin, cos)) = (time(i, images), shifts_rad[i].sin_cos());
                SVector::from([1.0, cos, -sin, t * cos, -t * sin, t])
            })
            .collect();
        let degenerate = || ShiftError::Degenerate { shifts_rad: shifts_rad.to_vec() };
        let weights = least_squares(&basis, LEAST_IMAGES).ok_or_else(degenerate)?;
        let noise_gain =
            |weights: &[Vec<f64>; UNKNOWNS]| (0.5 * weights[1..3].iter().flatten().map(|w| w * w).sum::<f64>()).sqrt();
        let resting_gain = noise_gain(&least_squares(&basis, MIN_STEPS).ok_or_else(degenerate)?);
        let with_trend = least_squares(&basis, UNKNOWNS);
        // Each term of the model: its value at every image.
        let [one, re, im, re_slope, im_slope, trend]: [Vec<f64>; UNKNOWNS] =
            std::array::from_fn(|k| basis.iter().map(|row| row[k]).collect());
        let slopes = [re_slope, im_slope];
        let (only_trend, backgrounds) = if with_trend.is_some() {
            let others = [one.clone(), re.clone(), im.clone(), slopes[0].clone(), slopes[1].clone()];
            (unexplained(images, &others, std::slice::from_ref(&trend)).swap_remove(0), vec![one, trend])
        } else {
            (vec![0.0; images], vec![one])
        };
        let residuals = residuals(images, &backgrounds, [re, im], &slopes).ok_or_else(degenerate)?;
        let with_trend = with_trend.filter(|weights| noise_gain(weights) <= MAX_TREND_NOISE * resting_gain);
        let phase_weights = with_trend.unwrap_or_else(|| weights.clone());
        // Both fits differ by what only A' explains.
        let trend_in_z = [1, 2].map(|k| {
            let parts = phase_weights[k].iter().zip(&weights[k]).zip(&only_trend);
            parts.map(|((fine, rough), only)| (fine - rough) * only).sum::<f64>() as f32
        });
        let noise_gain = noise_gain(&phase_weights);
        let response = |[re, im]: [&Vec<f64>; 2], sign: f64| {
            let coefficient = |i: usize| half_product([re[i], im[i]], sign * shifts_rad[i]);
            (0..images).map(coefficient).collect::<Vec<[f64; 2]>>()
        };
        let both = |z: [&Vec<f64>; 2]| Response {
            direct: TurnedSum::new(&response(z, 1.0), 1.0),
            ripple: TurnedSum::new(&response(z, -1.0), -1.0),
        };
        let (z, slope) = ([&weights[1], &weights[2]], [&weights[3], &weights[4]]);
        let of_z = |row: &Vec<f64>| {
            let coefficients = row.iter().zip(shifts_rad).map(|(w, s)| [w * s.cos(), w * s.sin()]);
            TurnedSum::new(&coefficients.collect::<Vec<[f64; 2]>>(), 1.0)
        };
        let sums = weights[..LEAST_IMAGES].iter().chain([&only_trend]).chain(&residuals[..IN_SUMS]);
        let sums: Vec<&Vec<f64>> = sums.collect();
        let motions = [1.0, -1.0].map(|sense| MotionTable::new(&response(z, 1.0), &response(slope, 1.0), sense));
        Ok(Self {
            limits: [motions[0].limit, motions[1].limit],
            motions_rad: motions.iter().flat_map(|table| *table.motion_rad).collect(),
            motions,
            turns: shifts_rad.iter().map(|s| [s.cos() as f32, s.sin() as f32]).collect(),
            rough: both(z),
            fine: both([&phase_weights[1], &phase_weights[2]]),
            slope_ripple: TurnedSum::new(&response(slope, -1.0), -1.0),
            trend_in_z,
            offset_response: of_z(&weights[0]),
            residual_responses: residuals.iter().map(of_z).collect(),
            residuals: residuals.iter().map(|row| row.iter().map(|&w| w as f32).collect()).collect(),
            weights: (0..images).map(|i| std::array::from_fn(|k| sums[k][i] as f32)).collect(),
            noise_gain: noise_gain as f32,
            equalization: BrightnessEqualization::new(shifts_rad),
            runs: runs(images),
            shifts_rad: shifts_rad.to_vec(),
        })
    }

    /// Number M of images.
    #[must_use]
    pub fn images(&self) -> usize {
        self.shifts_rad.len()
    }

    /// Degrees of freedom per pixel that measure how well the moving sinusoid fits.
    pub(super) fn freedom(&self) -> usize {
        self.residuals.len()
    }

    /// Phase shifts of the images, rad.
    #[must_use]
    pub fn shifts_rad(&self) -> &[f64] {
        &self.shifts_rad
    }

    /// Standard deviation of the phase per unit of noise ÷ modulation.
    #[must_use]
    pub fn noise_gain(&self) -> f32 {
        self.noise_gain
    }

    /// Largest motion that is measurable in both directions, rad per image.
    pub(super) fn least_limit_rad(&self) -> f32 {
        self.motions.iter().map(|table| table.motion_rad[TABLE]).fold(f32::INFINITY, f32::min)
    }

    /// The motion (rad per image) of a fitted slope `Im(z'/z)`; NaN if it is too fast to measure.
    pub(super) fn motion_rad(&self, slope: f32) -> f32 {
        let [rising, falling] = &self.motions;
        let motion_rad = if slope >= 0.0 { rising } else { falling }.motion_rad(slope.abs());
        if slope >= 0.0 { motion_rad } else { -motion_rad }
    }
}

/// Weights of the samples in the first `unknowns` unknowns of a least-squares fit; `None` if they are not determined.
fn least_squares(basis: &[SVector<f64, UNKNOWNS>], unknowns: usize) -> Option<[Vec<f64>; UNKNOWNS]> {
    let mut normal: SMatrix<f64, UNKNOWNS, UNKNOWNS> = basis.iter().map(|row| row * row.transpose()).sum();
    for k in unknowns..UNKNOWNS {
        // Decouple the other unknowns.
        normal.row_mut(k).fill(0.0);
        normal.column_mut(k).fill(0.0);
        normal[(k, k)] = 1.0;
    }
    let values = normal.symmetric_eigenvalues();
    let inverse = normal.try_inverse().filter(|_| values.min() > MIN_EIGENVALUE_SHARE * values.max())?;
    Some(std::array::from_fn(|k| basis.iter().map(|row| (inverse * row)[k]).collect()))
}

/// Image weights of the residuals: numbers that are zero for a resting sinusoid, whatever A and A' are. Their squares add
/// up to the squared distance of the samples from the sinusoid, with the best A and A', that has the fitted z; nearly so
/// where the phase is fitted without A'.
///
/// ```text
/// directions = orthonormal complement of A, A' and z, first those of z'
/// a change δ of z' changes the first two by R·δ, and the samples (with the best A and A') by T·δ
/// first two directions = √(R⁻ᵀ·TᵀT·R⁻¹) · those
/// ```
///
/// `None` if z' is not determined.
fn residuals(
    images: usize,
    backgrounds: &[Vec<f64>],
    z: [Vec<f64>; 2],
    slopes: &[Vec<f64>; 2],
) -> Option<Vec<Vec<f64>>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let terms: Vec<Vec<f64>> = backgrounds.iter().cloned().chain(z).collect();
    let mut residuals = unexplained(images, &terms, slopes);
    let seen = unexplained(images, backgrounds, &[]);
    let change = |directions: &[Vec<f64>], i: usize, j: usize| dot(&directions[i], &slopes[j]);
    let of_residuals = Matrix2::from_fn(|i, j| change(&residuals, i, j)).try_inverse()?;
    let of_samples = Matrix2::from_fn(|i, j| (0..seen.len()).map(|k| change(&seen, k, i) * change(&seen, k, j)).sum());
    let root = (of_residuals.transpose() * of_samples * of_residuals).cholesky()?.l();
    let mixed = [0, 1].map(|k| {
        let both = residuals[0].iter().zip(&residuals[1]);
        both.map(|(first, second)| root[(0, k)] * first + root[(1, k)] * second).collect()
    });
    residuals.splice(..mixed.len(), mixed);
    Some(residuals)
}

/// `(re + i·im)·e^(i·angle)/2`.
fn half_product([re, im]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [(re * cos - im * sin) / 2.0, (re * sin + im * cos) / 2.0]
}

/// `Σ c_i·e^(iεt_i)`.
fn response(coefficients: &[[f64; 2]], motion_rad: f64) -> [f64; 2] {
    let images = coefficients.len();
    coefficients.iter().enumerate().fold([0.0; 2], |[re, im], (i, [a, b])| {
        let (sin, cos) = (motion_rad * time(i, images)).sin_cos();
        [re + a * cos - b * sin, im + a * sin + b * cos]
    })
}

impl MotionTable {
    fn new(direct: &[[f64; 2]], slope: &[[f64; 2]], sense: f64) -> Self {
        // Im(H'/H) rises with the motion until H has all but faded.
        let ratio = |motion_rad: f64| {
            let ([a, b], [c, d]) = (response(slope, sense * motion_rad), response(direct, sense * motion_rad));
            let square = c * c + d * d;
            (square >= MIN_RESPONSE * MIN_RESPONSE).then(|| sense * (b * c - a * d) / square)
        };
        let step = WIDEST_RAD / TABLE as f64;
        let mut rising = vec![0.0];
        for k in 1..=TABLE {
            match ratio(k as f64 * step) {
                Some(value) if value > rising[k - 1] => rising.push(value),
                _ => break,
            }
        }
        let limit = rising[rising.len() - 1];
        let motion = |i: usize| {
            let wanted = limit * i as f64 / TABLE as f64;
            let above = rising.partition_point(|&value| value < wanted).clamp(1, rising.len().max(2) - 1);
            let (low, high) = (rising[above - 1], rising.get(above).copied().unwrap_or(limit));
            let part = if high > low { (wanted - low) / (high - low) } else { 0.0 };
            ((above - 1) as f64 + part) * step
        };
        Self { limit: limit as f32, motion_rad: Box::new(std::array::from_fn(|i| motion(i.min(TABLE)) as f32)) }
    }

    fn motion_rad(&self, slope: f32) -> f32 {
        let place = slope / self.limit * TABLE as f32;
        let below = place.min(TABLE as f32) as usize;
        let [low, high] = [self.motion_rad[below], self.motion_rad[below + 1]];
        let motion_rad = low + (high - low) * (place - below as f32);
        if below < TABLE { motion_rad } else { f32::NAN }
    }
}
