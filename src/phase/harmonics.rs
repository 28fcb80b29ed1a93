//! Higher harmonics of the fringes, caused by a nonlinear projector.
//!
//! In: the samples of a thousand pixels. Out: [`Harmonics`], two amplitudes for the whole image. Cost: 1000 pixels,
//! independent of the size of the image. (The paper assumes sinusoidal fringes; section 2.1.)
//!
//! Image k has the angle `α_k`: its phase shift plus the motion of the scene. The model of a pixel with phase φ is
//! `I_k = A + B·Σ_h Re(c_h·e^(i·h·(φ + α_k)))`, h from 1 to 3, `c_1 = 1`. N images determine no more than N numbers per
//! pixel. But `c_2` and `c_3` belong to the projector and are the same everywhere, so pixels of different phase
//! determine them: by least squares over all pixels, after the fundamental is removed. Motion, edges and noise leave
//! residuals too, but not at two and three times the phase of their pixel. Harmonics disturb the measured motion; if
//! there are enough images, the effect of an error of the motion is removed together with the fundamental.
//!
//! A projector with exponent γ has `c_2 = (γ − 1)/(γ + 2)`.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

use fringeflow_base::limits::{MAX_IMAGES, MAX_STEPS};

use super::map::Harmonics;

/// Sampled pixels.
const PIXELS: usize = 1000;
/// Fewest usable pixels.
const LEAST_PIXELS: usize = 200;
/// Residual ÷ modulation from which on a pixel counts as an edge and is ignored.
const EDGE_SHARE: f64 = 0.5;
/// Largest phase motion of a pixel from the centre of the window to its ends, rad. Beyond, an error of the motion looks
/// like a harmonic.
const MAX_MOVED_RAD: f64 = 1.0;
/// Smallest part of a harmonic that must remain after offset and fundamental are removed.
const MIN_VISIBLE_SHARE: f64 = 0.2;
/// Smallest eigenvalue of the normal matrix (scaled to a mean of 1) that determines all unknowns.
const MIN_EIGENVALUE: f64 = 0.05;
/// Real and imaginary parts of `c_2` and `c_3`.
const UNKNOWNS: usize = 4;
/// Offset, cosine and sine of the sinusoid.
const FUNDAMENTAL: usize = 3;

/// Samples of a pixel: grey level, angle (rad), and time since the centre of the window (images; 0 if nothing moves).
pub(super) type Samples = Vec<[f64; 3]>;

/// Measures the harmonics in images with these shifts.
///
/// `load_samples` fills in the samples of a pixel and returns `false` if it is unusable: invalid, dim or saturated.
/// `samples` is scratch memory.
pub(super) fn measure(
    shifts_rad: &[f64],
    pixels: usize,
    samples: &mut Samples,
    mut load_samples: impl FnMut(usize, &mut Samples) -> bool,
) -> Harmonics {
    let visible = visible(shifts_rad);
    if !visible.contains(&true) {
        return Harmonics::default();
    }
    let mut sums = HarmonicSums::default();
    for pixel in spread_pixels(pixels, PIXELS) {
        samples.clear();
        if load_samples(pixel, samples) {
            sums.add(samples, shifts_rad);
        }
    }
    sums.solve(visible)
}

/// Harmonics of a scene at rest. Without motion, all pixels share the same weights; only their phase differs.
pub(super) struct RestingHarmonics {
    visible: [bool; 2],
    steps: usize,
    /// Cosine and sine of the shifts.
    angles: [[f64; 2]; MAX_STEPS],
    /// Weights of each sample in offset, cosine and sine of the fundamental; then the values of cos 2s, sin 2s, cos 3s
    /// and sin 3s at its shift s, orthogonal to the fundamental.
    weights: [[f64; FUNDAMENTAL + UNKNOWNS]; MAX_STEPS],
    /// Scalar products of these four orthogonalized vectors.
    products: [[f64; UNKNOWNS]; UNKNOWNS],
}

/// Fit of a sinusoid to one pixel.
pub(super) struct SinusoidFit {
    pub(super) modulation: f64,
    /// Sum of squared residuals.
    pub(super) squares: f64,
}

impl RestingHarmonics {
    /// For images with these shifts, which determine a phase.
    pub(super) fn new(shifts_rad: &[f64]) -> Self {
        let steps = shifts_rad.len();
        let inverse = normal(shifts_rad.iter().copied()).try_inverse().unwrap_or_else(Matrix3::zeros);
        // Each harmonic minus its projection onto the fundamental.
        let mut orthogonal = [[0.0; MAX_STEPS]; UNKNOWNS];
        for (i, vector) in orthogonal.iter_mut().enumerate() {
            let order = (2 + i / 2) as f64;
            let harmonic = |s: f64| if i % 2 == 0 { (order * s).cos() } else { (order * s).sin() };
            let projection: Vector3<f64> = shifts_rad.iter().map(|&s| row(s) * harmonic(s)).sum();
            let explained = inverse * projection;
            vector.iter_mut().zip(shifts_rad).for_each(|(v, &s)| *v = harmonic(s) - explained.dot(&row(s)));
        }
        let products = std::array::from_fn(|i| std::array::from_fn(|j| dot(&orthogonal[i], &orthogonal[j])));
        let mut weights = [[0.0; FUNDAMENTAL + UNKNOWNS]; MAX_STEPS];
        for (k, (weights, &shift)) in weights.iter_mut().zip(shifts_rad).enumerate() {
            let fundamental = inverse * row(shift);
            let all = fundamental.iter().copied().chain(orthogonal.iter().map(|vector| vector[k]));
            weights.iter_mut().zip(all).for_each(|(weight, value)| *weight = value);
        }
        let mut angles = [[0.0; 2]; MAX_STEPS];
        angles.iter_mut().zip(shifts_rad).for_each(|(angle, s)| *angle = [s.cos(), s.sin()]);
        Self { angles, visible: visible(shifts_rad), steps, weights, products }
    }

    /// Adds a pixel. Samples beyond the number of images are 0.
    pub(super) fn add(&self, samples: &[f64; MAX_STEPS], sums: &mut HarmonicSums) -> SinusoidFit {
        // All seven sums in one pass, so that they vectorize.
        let mut weighed = [0.0; FUNDAMENTAL + UNKNOWNS];
        for (weights, sample) in self.weights.iter().zip(samples).take(self.steps) {
            weighed.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * sample);
        }
        let [offset, re, im, right @ ..] = weighed;
        let power = re * re + im * im;
        let squares = self.residual_squares(samples, [offset, re, im]);
        let fit = SinusoidFit { modulation: power.sqrt(), squares };
        if squares > EDGE_SHARE * EDGE_SHARE * power * self.steps as f64 || power <= 0.0 {
            return fit;
        }
        // B·e^(2iφ) and B·e^(3iφ).
        let (c, s) = (re / fit.modulation, im / fit.modulation);
        let (re2, im2) = (re * c - im * s, re * s + im * c);
        let (re3, im3) = (re2 * c - im2 * s, re2 * s + im2 * c);
        // The column of each unknown in the least squares is a combination of two of the orthogonalized vectors, so the
        // normal equations follow from their products, without another pass over the samples.
        let columns = [[re2, -im2], [-im2, -re2], [re3, -im3], [-im3, -re3]];
        for (i, column_i) in columns.iter().enumerate() {
            let first = i / 2 * 2;
            sums.right[i] += column_i[0] * right[first] + column_i[1] * right[first + 1];
            for (j, column_j) in columns.iter().enumerate() {
                let second = j / 2 * 2;
                let product = |a: usize| {
                    column_j[0] * self.products[first + a][second] + column_j[1] * self.products[first + a][second + 1]
                };
                sums.normal[(i, j)] += column_i[0] * product(0) + column_i[1] * product(1);
            }
        }
        sums.pixels += 1;
        fit
    }

    fn residual_squares(&self, samples: &[f64; MAX_STEPS], [offset, re, im]: [f64; 3]) -> f64 {
        let square = |(sample, [cos, sin]): (&f64, &[f64; 2])| (sample - offset - re * cos + im * sin).powi(2);
        samples.iter().zip(&self.angles).take(self.steps).map(square).sum()
    }

    /// The harmonics of all pixels added to `sums`.
    pub(super) fn solve(&self, sums: HarmonicSums) -> Harmonics {
        if self.visible.contains(&true) { sums.solve(self.visible) } else { Harmonics::default() }
    }
}

fn dot(a: &[f64; MAX_STEPS], b: &[f64; MAX_STEPS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Whether the shifts determine the second and the third harmonic.
fn visible(shifts_rad: &[f64]) -> [bool; 2] {
    [2.0, 3.0].map(|order| visible_share(shifts_rad, order) >= MIN_VISIBLE_SHARE)
}

/// Indices of `count` of `pixels` pixels, spread over the image at distances that match no fringe period.
pub(super) fn spread_pixels(pixels: usize, count: usize) -> impl ExactSizeIterator<Item = usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..count.min(pixels)).map(move |i| ((i as f64 * GOLDEN).fract() * pixels as f64) as usize)
}

/// Share of a harmonic that remains after offset and fundamental are removed.
fn visible_share(shifts_rad: &[f64], order: f64) -> f64 {
    let Some(inverse) = normal(shifts_rad.iter().copied()).try_inverse() else { return 0.0 };
    let remaining = |wave: fn(f64) -> f64| {
        let harmonic = || shifts_rad.iter().map(|s| (row(*s), wave(order * s)));
        let projection: Vector3<f64> = harmonic().map(|(row, value)| row * value).sum();
        harmonic().map(|(_, value)| value * value).sum::<f64>() - projection.dot(&(inverse * projection))
    };
    (remaining(f64::cos) + remaining(f64::sin)) / shifts_rad.len() as f64
}

/// Row of the design matrix for offset, cosine and sine.
fn row(angle: f64) -> Vector3<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector3::new(1.0, cos, -sin)
}

fn normal(angles: impl Iterator<Item = f64>) -> Matrix3<f64> {
    angles.map(row).map(|row| row * row.transpose()).sum()
}

/// Normal equations of the least squares over the pixels.
#[derive(Default)]
pub(super) struct HarmonicSums {
    normal: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    right: SVector<f64, UNKNOWNS>,
    pixels: usize,
    /// Pixels ignored because they move too fast.
    fast: usize,
}

impl HarmonicSums {
    /// Adds a pixel whose samples have the phase shifts `shifts_rad`.
    ///
    /// ```text
    /// ignore the pixel if it moves too far
    /// fit offset and fundamental; then again with the effect of an error of the motion as a fourth unknown
    /// for each sample: values of the harmonics at its angle, and the residual of that fit
    /// normal equations of the harmonics, orthogonal to the four unknowns; none at an edge
    /// ```
    fn add(&mut self, samples: &Samples, shifts_rad: &[f64]) {
        let moved_rad = |(sample, shift): (&[f64; 3], &f64)| (sample[1] - shift).abs();
        if samples.iter().zip(shifts_rad).any(|pair| moved_rad(pair) > MAX_MOVED_RAD) {
            self.fast += 1;
            return;
        }
        // Fit of the fundamental. Cosine and sine of each angle are computed once.
        let mut angle_rows = [Vector3::zeros(); MAX_IMAGES];
        angle_rows.iter_mut().zip(samples).for_each(|(angle_row, &[_, angle, _])| *angle_row = row(angle));
        let angle_rows = &angle_rows[..samples.len().min(MAX_IMAGES)];
        let normal: Matrix3<f64> = angle_rows.iter().map(|row| row * row.transpose()).sum();
        let Some(inverse) = normal.try_inverse() else { return };
        let sums: Vector3<f64> = samples.iter().zip(angle_rows).map(|(&[grey, ..], row)| row * grey).sum();
        let [_, re, im] = <[f64; 3]>::from(inverse * sums);
        let modulation = re.hypot(im);
        // Once more, with a fourth unknown: the derivative of the fundamental with respect to the motion.
        let rows = || {
            samples.iter().zip(angle_rows).map(move |(&[grey, _, t], row)| {
                (Vector4::new(row[0], row[1], row[2], t * (im * row[1] - re * row[2]) / modulation), grey)
            })
        };
        let mut normal: Matrix4<f64> = rows().map(|(row, _)| row * row.transpose()).sum();
        if samples.iter().all(|&[_, _, t]| t == 0.0) {
            normal[(3, 3)] = 1.0;
        }
        let Some(inverse) = normal.try_inverse().filter(|_| modulation > 0.0) else { return };
        let fitted: Vector4<f64> = inverse * rows().map(|(row, grey)| row * grey).sum::<Vector4<f64>>();
        // Normal equations of the harmonics for the residual, orthogonal to that fit.
        let (mut normal, mut right) = (SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros(), SVector::<f64, UNKNOWNS>::zeros());
        let mut explained = SMatrix::<f64, 4, UNKNOWNS>::zeros();
        let mut squares = 0.0;
        for (row, grey) in rows() {
            // B·e^(i(φ + α)), then B times its second and third power.
            let (p, q) = (re * row[1] + im * row[2], im * row[1] - re * row[2]);
            let [c, s] = [p, q].map(|part| part / modulation);
            let (p2, q2) = (p * c - q * s, p * s + q * c);
            let (p3, q3) = (p2 * c - q2 * s, p2 * s + q2 * c);
            let harmonics = SVector::<f64, UNKNOWNS>::new(p2, -q2, p3, -q3);
            let residual = grey - fitted.dot(&row);
            squares += residual * residual;
            normal += harmonics * harmonics.transpose();
            right += harmonics * residual;
            explained += row * harmonics.transpose();
        }
        let is_edge = squares > EDGE_SHARE * EDGE_SHARE * modulation * modulation * samples.len() as f64;
        if !is_edge {
            self.normal += normal - explained.transpose() * inverse * explained;
            self.right += right;
            self.pixels += 1;
        }
    }

    fn solve(mut self, visible: [bool; 2]) -> Harmonics {
        // If most pixels move too fast, the motion of the others is not reliable either.
        if self.pixels < LEAST_PIXELS || self.fast > self.pixels {
            return Harmonics::default();
        }
        let unknowns = 2 * visible.iter().filter(|is_visible| **is_visible).count();
        let visible_unknowns = (0..UNKNOWNS).filter(|k| visible[k / 2]);
        let scale = visible_unknowns.map(|k| self.normal[(k, k)]).sum::<f64>() / unknowns as f64;
        if scale <= 0.0 {
            return Harmonics::default();
        }
        self.normal /= scale;
        for k in (0..UNKNOWNS).filter(|k| !visible[k / 2]) {
            // Decouple invisible unknowns, so that they stay zero.
            self.normal.row_mut(k).fill(0.0);
            self.normal.column_mut(k).fill(0.0);
            self.normal[(k, k)] = 1.0;
        }
        if self.normal.symmetric_eigenvalues().min() < MIN_EIGENVALUE {
            return Harmonics::default();
        }
        let Some(inverse) = self.normal.try_inverse() else { return Harmonics::default() };
        let solution = inverse * self.right / scale;
        let share = |h: usize| visible[h].then(|| solution[2 * h].hypot(solution[2 * h + 1]) as f32);
        Harmonics { second_share: share(0), third_share: share(1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::{MotionFit, PhaseMap, PhaseShifts, Validity, decode, decode_moving};
    use fringeflow_base::grey::{GreyLevels, PixelFormat};
    use std::f64::consts::TAU;

    const WIDTH: usize = 96;
    const HEIGHT: usize = 64;

    /// 16-bit images of a moving scene, illuminated by a projector with exponent `gamma`.
    fn images(steps: usize, images: usize, gamma: f64, motion_rad: f64) -> (Vec<Vec<u8>>, Vec<f64>) {
        let shifts: Vec<f64> = (0..images).map(|k| TAU * (k % steps) as f64 / steps as f64).collect();
        let grey = |k: usize, pixel: usize| {
            let phase = 0.37 * (pixel % WIDTH) as f64 + 0.11 * (pixel / WIDTH) as f64;
            let t = k as f64 - (images as f64 - 1.0) / 2.0;
            let light = (0.5 + 0.5 * (phase + shifts[k] + motion_rad * t).cos()).powf(gamma);
            // Noise: a hash of pixel and image.
            let noise = ((pixel * 7919 + k * 104_729).wrapping_mul(2_654_435_761) >> 7 & 0xff) as f64 / 255.0 - 0.5;
            12.0 + 170.0 * light + 2.0 * noise
        };
        let image = |k: usize| -> Vec<u8> {
            (0..WIDTH * HEIGHT).flat_map(|pixel| ((grey(k, pixel) * 256.0).round() as u16).to_le_bytes()).collect()
        };
        ((0..images).map(image).collect(), shifts)
    }

    fn decoded(steps: usize, count: usize, gamma: f64, motion_rad: f64) -> PhaseMap {
        let (bytes, shifts) = images(steps, count, gamma, motion_rad);
        let levels: Vec<GreyLevels<'_>> =
            bytes.iter().map(|bytes| GreyLevels { format: PixelFormat::Y16, bytes }).collect();
        let validity = Validity::default();
        if count == steps {
            decode(&levels, WIDTH, HEIGHT, &PhaseShifts::new(&shifts).unwrap(), &validity).unwrap()
        } else {
            decode_moving(&levels, WIDTH, HEIGHT, &MotionFit::new(&shifts).unwrap(), &validity).unwrap()
        }
    }

    #[test]
    fn the_exponent_of_the_projector_is_measured_at_rest_and_moving() {
        for (steps, count) in [(4, 4), (4, 6), (5, 5), (5, 7), (6, 6), (8, 10), (16, 16)] {
            for gamma in [1.0, 1.1, 1.2, 1.4, 0.8] {
                for motion_rad in if count > steps { vec![0.0, 0.15, -0.3] } else { vec![0.0] } {
                    let harmonics = decoded(steps, count, gamma, motion_rad).harmonics;
                    if f64::abs(motion_rad) * (count - 1) as f64 > 2.2 * MAX_MOVED_RAD {
                        assert_eq!(
                            harmonics,
                            Harmonics::default(),
                            "{steps} steps, {count} images, moving {motion_rad}"
                        );
                        continue;
                    }
                    let Harmonics { second_share, third_share } = harmonics;
                    let second = (gamma - 1.0) / (gamma + 2.0);
                    let third = second * (gamma - 2.0) / (gamma + 3.0);
                    // At 0.3 rad per image the harmonic turns by more than 2 rad within the window.
                    let tolerance = 0.004 + f64::abs(motion_rad) * (0.02 + 0.5 * second.abs());
                    let what = format!("{steps} steps, {count} images, γ {gamma}, moving {motion_rad}");
                    let found = f64::from(second_share.unwrap());
                    assert!((found - second.abs()).abs() < tolerance, "{what}: {found} for {second}");
                    assert_eq!(third_share.is_some(), steps > 4, "{what}");
                    let found = third_share.map_or(third.abs(), f64::from);
                    assert!((found - third.abs()).abs() < tolerance, "{what}: {found} for {third}");
                }
            }
        }
    }

    #[test]
    fn motion_within_a_single_cycle_is_not_taken_for_a_harmonic() {
        for motion_rad in [0.05, 0.2] {
            let second = decoded(4, 4, 1.0, motion_rad).harmonics.second_share.unwrap();
            assert!(second < 0.01, "{motion_rad}: {second}");
        }
    }

    #[test]
    fn three_steps_and_dark_images_yield_no_harmonics() {
        for count in [3, 6] {
            assert_eq!(decoded(3, count, 1.4, 0.2 * (count - 3) as f64 / 3.0).harmonics, Harmonics::default());
        }
        let shifts: Vec<f64> = (0..4).map(|k| TAU * f64::from(k) / 4.0).collect();
        let dark = vec![3_u8; WIDTH * HEIGHT];
        let levels = [GreyLevels::eight_bit(&dark); 4];
        let map = decode(&levels, WIDTH, HEIGHT, &PhaseShifts::new(&shifts).unwrap(), &Validity::default()).unwrap();
        assert_eq!(map.harmonics, Harmonics::default());
    }

    #[test]
    fn sampled_pixels_cover_the_image() {
        let mut rows = [0; 8];
        spread_pixels(80_000, PIXELS).for_each(|pixel| rows[pixel / 10_000] += 1);
        assert!(rows.iter().all(|&n| (120..=130).contains(&n)), "{rows:?}");
        assert!(spread_pixels(7, PIXELS).all(|pixel| pixel < 7));
    }
}
