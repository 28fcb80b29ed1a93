//! Pixels some of whose samples are saturated: solved from those that are left.

use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

use crate::phase::arctangent::turn_fraction;
use crate::phase::map::Modulation;
use crate::phase::shifts::PhaseShifts;

/// What the samples that are left determine.
#[derive(Clone, Copy)]
pub(super) struct Solution {
    pub(super) phase: u16,
    pub(super) modulation: Modulation,
    pub(super) mean: u8,
    /// Standard deviation of the samples about the fit.
    pub(super) residual_grey: f32,
}

/// Solves pixels from some of their images; neighbours mostly from the same ones, whose weights are kept.
pub(super) struct LeftOut<'a> {
    shifts: &'a PhaseShifts,
    /// The images that the weights are for, a bit each.
    images: u32,
    /// Weights in A, C and S; `None` where these images determine nothing.
    weights: Option<PhaseShifts>,
}

impl<'a> LeftOut<'a> {
    pub(super) fn new(shifts: &'a PhaseShifts) -> Self {
        Self { shifts, images: 0, weights: None }
    }

    /// The solution from the grey levels of the images that are kept; `None` if they do not determine it.
    pub(super) fn solve(&mut self, kept: impl Fn(usize) -> Option<f32>) -> Option<Solution> {
        let (mut greys, mut angles_rad, mut count, mut images) = ([0.0; MAX_STEPS], [0.0; MAX_STEPS], 0, 0);
        for (k, &shift_rad) in self.shifts.shifts_rad().iter().enumerate() {
            if let Some(grey) = kept(k) {
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
        let off = |(g, s): (&f64, &f64)| (g - offset - cosine * s.cos() + sine * s.sin()).powi(2);
        let squares: f64 = greys.iter().zip(angles_rad).map(off).sum();
        let freedom = (count - MIN_STEPS).max(1) as f64;
        Some(Solution {
            phase: turn_fraction(sine as f32, cosine as f32),
            modulation: Modulation::from_grey(cosine.hypot(sine) as f32),
            mean: (offset + 0.5) as u8,
            residual_grey: (squares / freedom).sqrt() as f32,
        })
    }
}
