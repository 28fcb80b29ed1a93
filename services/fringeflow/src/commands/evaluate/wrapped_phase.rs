//! Wrapped phase of a whole sequence by least squares, for the reference methods.

use std::f64::consts::TAU;

use fringeflow::dataset::GreyImage;
use fringeflow::phase::PhaseMap;
use nalgebra::{Matrix3, Vector3};

use crate::failure::Failure;

/// Least modulation that Gray code is decoded at, grey levels.
const MIN_MODULATION_GREY: f64 = 6.0;

/// Fits `I_k = A + C·cos s_k − S·sin s_k` to every pixel; φ = atan2(S, C), B = hypot(S, C).
pub(super) fn decode(images: &[GreyImage], shifts_rad: &[f64]) -> Result<PhaseMap, Failure> {
    let weights = weights(shifts_rad)?;
    let (width, height) = images.first().map_or((0, 0), |image| (image.width, image.height));
    let mut map = PhaseMap { width, height, ..PhaseMap::default() };
    for i in 0..width * height {
        let samples = images.iter().zip(&weights);
        let fit: Vector3<f64> = samples.map(|(image, w)| w * f64::from(image.pixels[i])).sum();
        let (modulation, turns) = (fit.y.hypot(fit.z), fit.z.atan2(fit.y) / TAU);
        // A whole turn wraps to zero, as does its fraction.
        map.phase.push((turns.rem_euclid(1.0) * 65536.0).round() as u32 as u16);
        map.modulation.push(modulation as f32);
        map.mean.push(fit.x.round().clamp(0.0, 255.0) as u8);
        map.valid.push(modulation >= MIN_MODULATION_GREY);
    }
    Ok(map)
}

/// What each image contributes to A, C and S.
fn weights(shifts_rad: &[f64]) -> Result<Vec<Vector3<f64>>, Failure> {
    let model: Vec<Vector3<f64>> = shifts_rad.iter().map(|s| Vector3::new(1.0, s.cos(), -s.sin())).collect();
    let normal: Matrix3<f64> = model.iter().map(|m| m * m.transpose()).sum();
    let well_posed = normal.determinant() > 1e-3;
    let inverse = normal.try_inverse().filter(|_| well_posed).ok_or_else(|| {
        Failure::Usage(format!("the phase shifts {shifts_rad:?} rad do not determine a phase; three must differ"))
    })?;
    Ok(model.iter().map(|m| inverse * m).collect())
}
