//! The brightness of each image compared with the others: exposure, projector and lamps drift or flicker.
//!
//! A sinusoid whose images differ in brightness by `1 + γ_i` leaves residuals that depend on A and z alone. Blocks of pixels
//! all over the image, each freed from its own motion, give γ of all images by linear least squares; the brightness is
//! divided out before anything else is measured. What brightness and motion do differs: the first scales A as well.
//!
//! A γ that goes round with the shifts is left alone. It adds a sinusoid of one phase to all pixels, which the fit of each
//! takes for its own; all that betrays it is what a projector that is not linear makes as well.

use nalgebra::{DMatrix, DVector};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::MAX_IMAGES;
use super::fit::{MotionFit, time, unexplained};
use super::planes::Window;

/// Side of a block, pixels: some fringes, so that phases of all kinds occur; and distance from one to the next.
const BLOCK: usize = 16;
const PITCH: usize = 48;
/// Share of the mean diagonal that is added to the diagonal: a drift that nothing tells stays zero.
const RIDGE: f64 = 1e-4;
/// Largest departure that is compensated: more is no drift.
const LARGEST: f64 = 0.3;
/// Residual ÷ modulation from which on a pixel is at an edge and says nothing.
const EDGE_SHARE: f64 = 0.25;
/// Rounds: the second finds what the first left by being linear.
const ROUNDS: usize = 2;

/// Divides the brightness of the images out; the greatest departure from their mean, as a share.
pub(super) fn compensate<S: Sample>(window: &mut Window<'_, S>, fit: &MotionFit, validity: &Validity) -> f32 {
    let plain = window.grey_per_value.clone();
    for _ in 0..ROUNDS {
        let Some(departures) = departures(window, fit, validity) else { break };
        for (grey_per_value, departure) in window.grey_per_value.iter_mut().zip(&departures) {
            *grey_per_value /= (1.0 + departure) as f32;
        }
    }
    let share = |(now, before): (&f32, &f32)| (before / now - 1.0).abs();
    window.grey_per_value.iter().zip(&plain).map(share).fold(0.0, f32::max)
}

/// Sums over pixels: normal equations of γ, of as many images as there are.
struct Sums {
    normal: [[f64; MAX_IMAGES]; MAX_IMAGES],
    right: [f64; MAX_IMAGES],
}

/// γ of every image; `None` without enough pixels to tell.
fn departures<S: Sample>(window: &Window<'_, S>, fit: &MotionFit, validity: &Validity) -> Option<Vec<f64>> {
    let images = fit.images();
    let projector = residual_projector(fit.shifts_rad())?;
    let mut sums = Sums { normal: [[0.0; MAX_IMAGES]; MAX_IMAGES], right: [0.0; MAX_IMAGES] };
    let starts = |length: usize| (0..(length + 1).saturating_sub(BLOCK)).step_by(PITCH);
    for v in starts(window.height()) {
        for u in starts(window.width) {
            let rows = (v..v + BLOCK).map(|row| row * window.width + u);
            let pixels: Vec<usize> = rows.flat_map(|first| first..first + BLOCK).collect();
            add_block(window, fit, validity, &pixels, &projector, &mut sums);
        }
    }
    let basis: Vec<[f64; 3]> = fit.shifts_rad().iter().map(|s| [1.0, s.cos(), s.sin()]).collect();
    let told = unexplained(&basis);
    let product = |a: &[f64], b: &[f64]| -> f64 {
        (0..images).map(|i| (0..images).map(|j| a[i] * sums.normal[i][j] * b[j]).sum::<f64>()).sum()
    };
    let mut reduced = DMatrix::from_fn(told.len(), told.len(), |k, l| product(&told[k], &told[l]));
    let trace: f64 = (0..images).map(|i| sums.normal[i][i]).sum();
    let ridge = RIDGE * trace / images as f64;
    if ridge <= 0.0 {
        return None;
    }
    (0..told.len()).for_each(|k| reduced[(k, k)] += ridge);
    let along = |direction: &Vec<f64>| direction.iter().zip(&sums.right).map(|(a, b)| a * b).sum::<f64>();
    let solution = reduced.cholesky()?.solve(&DVector::from_iterator(told.len(), told.iter().map(along)));
    let departure = |i: usize| told.iter().zip(solution.iter()).map(|(direction, part)| part * direction[i]).sum();
    let departures: Vec<f64> = (0..images).map(departure).collect();
    departures.iter().all(|gamma| gamma.abs() <= LARGEST).then_some(departures)
}

/// What projects the samples of a pixel onto what no sinusoid with these shifts explains; row by row.
fn residual_projector(shifts_rad: &[f64]) -> Option<Vec<Vec<f64>>> {
    let rows: Vec<nalgebra::Vector3<f64>> =
        shifts_rad.iter().map(|s| nalgebra::Vector3::new(1.0, s.cos(), -s.sin())).collect();
    let inverse = rows.iter().map(|row| row * row.transpose()).sum::<nalgebra::Matrix3<f64>>().try_inverse()?;
    let entry = |i: usize, j: usize| f64::from(u8::from(i == j)) - rows[i].dot(&(inverse * rows[j]));
    Some((0..rows.len()).map(|i| (0..rows.len()).map(|j| entry(i, j)).collect()).collect())
}

fn add_block<S: Sample>(
    window: &Window<'_, S>,
    fit: &MotionFit,
    validity: &Validity,
    pixels: &[usize],
    projector: &[Vec<f64>],
    sums: &mut Sums,
) {
    let images = fit.images();
    let fitted: Vec<_> = pixels.iter().filter_map(|&pixel| fitted(window, fit, validity, pixel)).collect();
    let slope: f64 = fitted.iter().map(|(_, [_, re, im, a, b])| b * re - a * im).sum();
    let power: f64 = fitted.iter().map(|(_, [_, re, im, ..])| re * re + im * im).sum();
    let motion_rad = if power > 0.0 { fit.motion_rad((slope / power) as f32) } else { f32::NAN };
    if motion_rad.is_nan() {
        return;
    }
    let turns: Vec<[f64; 2]> = fit
        .shifts_rad()
        .iter()
        .enumerate()
        .map(|(i, shift)| {
            let (resting, moved) = (*shift, shift + f64::from(motion_rad) * time(i, images));
            [moved.cos() - resting.cos(), moved.sin() - resting.sin()]
        })
        .collect();
    for (greys, [offset, re, im, ..]) in &fitted {
        let (mut still, mut model) = ([0.0; MAX_IMAGES], [0.0; MAX_IMAGES]);
        for i in 0..images {
            // As if it had not moved.
            let [cos, sin] = turns[i];
            still[i] = greys[i] - (re * cos - im * sin);
            let [cos, sin] = fit.turns[i].map(f64::from);
            model[i] = offset + re * cos - im * sin;
        }
        for (i, row) in projector.iter().enumerate() {
            let residual: f64 = row.iter().zip(&still).map(|(q, grey)| q * grey).sum();
            sums.right[i] += model[i] * residual;
            for (j, q) in row.iter().enumerate() {
                sums.normal[i][j] += model[i] * q * model[j];
            }
        }
    }
}

/// Grey levels of a pixel and its linear fit, if it is well lit and away from edges.
fn fitted<S: Sample>(
    window: &Window<'_, S>,
    fit: &MotionFit,
    validity: &Validity,
    pixel: usize,
) -> Option<([f64; MAX_IMAGES], [f64; 5])> {
    let images = fit.images();
    if (0..images).any(|image| window.is_saturated(image, pixel)) {
        return None;
    }
    let mut greys = [0.0; MAX_IMAGES];
    (0..images).for_each(|image| greys[image] = f64::from(window.grey(image, pixel)));
    let values: [f64; 5] = std::array::from_fn(|k| {
        greys.iter().zip(&fit.weights[k]).map(|(grey, weight)| grey * f64::from(*weight)).sum()
    });
    let [offset, re, im, a, b] = values;
    let modulation = (re * re + im * im).sqrt();
    let off = |(i, grey): (usize, &f64)| {
        let ([cos, sin], t) = (fit.turns[i].map(f64::from), time(i, images));
        (grey - offset - (re + t * a) * cos + (im + t * b) * sin).powi(2)
    };
    let residual = (greys[..images].iter().enumerate().map(off).sum::<f64>() / images as f64).sqrt();
    let is_good = modulation >= 2.0 * f64::from(validity.min_modulation_grey) && residual < EDGE_SHARE * modulation;
    is_good.then_some((greys, values))
}
