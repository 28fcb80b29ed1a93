//! Solver for pixels with saturated samples: fits their remaining samples. In: grey levels. Out: a [`Solution`]. Cost:
//! some hundred operations, and a matrix inversion where the saturated images change.

use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

use crate::phase::arctangent::turn_fraction;
use crate::phase::map::Modulation;
use crate::phase::shifts::PhaseShifts;

/// Fit of the unsaturated samples of a pixel.
#[derive(Clone, Copy)]
pub(super) struct Solution {
    pub(super) phase: u16,
    pub(super) modulation: Modulation,
    pub(super) mean: u8,
    /// Standard deviation of the samples about the fit.
    pub(super) residual_grey: f32,
}

/// Fits pixels from a subset of their images. Neighbours mostly share the subset, so its weights are kept.
pub(super) struct UnsaturatedSolver<'a> {
    shifts: &'a PhaseShifts,
    /// The subset of images: image k is bit k.
    images: u32,
    /// Weights of the subset; `None` if it does not determine a phase.
    weights: Option<PhaseShifts>,
}

impl<'a> UnsaturatedSolver<'a> {
    pub(super) fn new(shifts: &'a PhaseShifts) -> Self {
        Self { shifts, images: 0, weights: None }
    }

    /// Fits a pixel; `unsaturated_grey(k)` is its grey level in image k, `None` if saturated. `None` if the remaining
    /// images do not determine a phase.
    pub(super) fn solve(&mut self, unsaturated_grey: impl Fn(usize) -> Option<f32>) -> Option<Solution> {
        let (mut greys, mut angles_rad, mut count, mut images) = ([0.0; MAX_STEPS], [0.0; MAX_STEPS], 0, 0);
        for (k, &shift_rad) in self.shifts.shifts_rad().iter().enumerate() {
            if let Some(grey) = unsaturated_grey(k) {
                (greys[count], angles_rad[count]) = (f64::from(grey), shift_rad);
                count += 1;
                images |= 1 << k;
            }
        }
        let (greys, angles_rad) = (&greys[..count], &angles_rad[..count]);
        if images != self.images {
            self.images = images;
            self.weights = if count < MIN_STEPS { None } else { PhaseShifts::solved(angles_rad) };
        }
        let sum = |w: &[f32]| w.iter().zip(greys).map(|(&w, g)| f64::from(w) * g).sum::<f64>();
        let [offset, cosine, sine] = self.weights.as_ref()?.weights().map(sum);
        let residual_square = |(g, s): (&f64, &f64)| (g - offset - cosine * s.cos() + sine * s.sin()).powi(2);
        let squares: f64 = greys.iter().zip(angles_rad).map(residual_square).sum();
        let freedom = (count - MIN_STEPS).max(1) as f64;
        Some(Solution {
            phase: turn_fraction(sine as f32, cosine as f32),
            modulation: Modulation::from_grey(cosine.hypot(sine) as f32),
            mean: (offset + 0.5) as u8,
            residual_grey: (squares / freedom).sqrt() as f32,
        })
    }
}
