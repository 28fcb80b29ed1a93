//! Brightness of the fringe images relative to each other.
//!
//! If the exposure is no multiple of the projector's refresh period, each image gets another share of its light. In: fringe
//! images and their phase. Out: how far the brightness of an image is from the mean. The mean grey level A and the cosine
//! of each pixel are known from the phase; regressing an image on both gives its gain, whatever the phases of the pixels
//! are.

use std::f64::consts::TAU;

use fringeflow::phase::PhaseMap;
use fringeflow_base::grey::GreyLevels;
use nalgebra::{Matrix2, Vector2};

/// Distance of the pixels that take part, pixels.
const STRIDE_PX: usize = 5;

/// Returns the largest relative deviation of the brightness of an image; `None` without pixels that have a phase.
pub(super) fn deviation_share(images: &[GreyLevels<'_>], phase: &PhaseMap, shifts_rad: &[f64]) -> Option<f64> {
    let pixels: Vec<usize> = (0..phase.phase.len()).step_by(STRIDE_PX).filter(|&i| phase.valid[i]).collect();
    let gains: Option<Vec<f64>> = images
        .iter()
        .zip(shifts_rad)
        .map(|(image, shift_rad)| {
            let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
            for &i in &pixels {
                let angle = TAU * f64::from(phase.phase[i]) / 65536.0 + shift_rad;
                let model = Vector2::new(f64::from(phase.mean[i]), f64::from(phase.modulation[i].grey()) * angle.cos());
                normal += model * model.transpose();
                right += model * f64::from(image.grey(i));
            }
            Some((normal.try_inverse()? * right).x)
        })
        .collect();
    let gains = gains?;
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    Some(gains.iter().map(|gain| (gain / mean - 1.0).abs()).fold(0.0, f64::max))
}
