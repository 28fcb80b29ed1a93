//! A ripple of the surface that repeats with the projected fringes.
//!
//! A projector that is not linear shifts the phase of N steps N times in each fringe; a wrong phase shift, or a light that
//! changes from image to image, does so once or twice.

/// A ripple.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ripple {
    /// Repetitions in a fringe period.
    pub per_fringe: usize,
    /// Phase steps of the measurement.
    pub steps: usize,
    /// Amplitude, metres.
    pub amplitude_m: f64,
    /// Standard deviation of the amplitude where there is no ripple, metres.
    pub sd_m: f64,
}

/// Neighbouring pixels share part of their noise. So their mean has about three times the sd of independent ones.
const SHARED_NOISE: f64 = 3.0;

/// The strongest ripple of the residuals among those that repeat 1 to `steps` times in a fringe; `None` without points.
pub(super) fn strongest(phases_rad: &[f64], residuals_m: &[f64], steps: usize) -> Option<Ripple> {
    let count = residuals_m.len() as f64;
    let mean = residuals_m.iter().sum::<f64>() / count;
    let variance = residuals_m.iter().map(|residual| (residual - mean).powi(2)).sum::<f64>() / count;
    let sd_m = SHARED_NOISE * (2.0 * variance / count).sqrt();
    let ripple = |per_fringe: usize| {
        let (sin, cos) = phases_rad.iter().zip(residuals_m).fold((0.0, 0.0), |(s, c), (phase, residual)| {
            let (sin, cos) = (per_fringe as f64 * phase).sin_cos();
            (s + sin * (residual - mean), c + cos * (residual - mean))
        });
        Ripple { per_fringe, steps, amplitude_m: 2.0 * f64::hypot(sin, cos) / count, sd_m }
    };
    let all = (1..=steps).map(ripple).filter(|ripple| ripple.amplitude_m.is_finite());
    all.max_by(|a, b| a.amplitude_m.total_cmp(&b.amplitude_m))
}
