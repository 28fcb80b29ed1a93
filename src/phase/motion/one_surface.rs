//! Pixels whose images show more than one surface: something moved across them, an edge or a shadow.
//!
//! Of the runs of images that include the centre of the window, the one is taken that fits a moving sinusoid best; the motion
//! is that of the neighbours. Saturated samples are left out of every run. Where no run fits, the pixel is left out.

use rayon::prelude::*;

use crate::phase::Validity;
use crate::phase::arctangent::turn_fraction;
use crate::phase::map::Modulation;
use crate::phase::map::{Exposure, FitStatistics};
use crate::phase::sample::Sample;

use super::fit::{LEAST_FITTED, MotionFit, solve_moving, time};
use super::planes::{Decoded, Window};

/// A residual this many times the usual one shows that the images do not belong together.
const LARGE_RESIDUAL: f32 = 4.0;
/// Usual residual ÷ modulation where three images leave none to measure.
const UNKNOWN_SHARE: f32 = 0.02;

/// What finds the images that show one surface.
pub(super) struct OneSurface<'a, S> {
    window: &'a Window<'a, S>,
    validity: &'a Validity,
    /// Time and phase shift of each image.
    moments: Vec<[f32; 2]>,
    /// First and last image of the runs that are tried, the longest first.
    runs: Vec<[usize; 2]>,
    /// Largest residual that is usual: grey levels, and a share of the modulation.
    usual: [f32; 2],
}

/// What was seen of the pixels on the way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Repaired {
    /// Pixels decoded from part of their images.
    pub(super) one_surface_pixels: u64,
    /// Pixels left out.
    pub(super) lost_pixels: u64,
    /// How the pixels are lit.
    pub(super) exposure: Exposure,
}

/// Offset, z and residual.
type Solution = [f32; 4];

impl<'a, S: Sample> OneSurface<'a, S> {
    pub(super) fn new(
        window: &'a Window<'a, S>,
        fit: &MotionFit,
        validity: &'a Validity,
        statistics: &FitStatistics,
    ) -> Self {
        let images = fit.images();
        let moment = |(i, &shift): (usize, &f64)| [time(i, images) as f32, shift as f32];
        let share = statistics.residual_share.unwrap_or(UNKNOWN_SHARE);
        Self {
            window,
            validity,
            moments: fit.shifts_rad().iter().enumerate().map(moment).collect(),
            runs: runs(images),
            usual: [LARGE_RESIDUAL * statistics.noise_grey, LARGE_RESIDUAL * share],
        }
    }

    /// Decodes the pixels again that need it.
    pub(super) fn repair(&self, decoded: &mut Decoded) -> Repaired {
        let width = self.window.width.max(1);
        let map = &mut decoded.map;
        let rows = map
            .phase
            .par_chunks_mut(width)
            .zip(map.modulation.par_chunks_mut(width))
            .zip(map.mean.par_chunks_mut(width))
            .zip(map.valid.par_chunks_mut(width))
            .zip(decoded.motion_rad.par_chunks(width))
            .zip(decoded.residual.par_chunks(width))
            .enumerate();
        let counts =
            rows.map_init(Vec::new, |saturated, (v, (((((phase, modulation), mean), valid), motion), residual))| {
                let mut counts = Repaired::default();
                self.window.find_saturated(v * width..v * width + phase.len(), saturated);
                for u in 0..phase.len() {
                    let pixel = v * width + u;
                    let is_saturated = saturated[u];
                    let least = self.validity.min_modulation_grey;
                    let modulation_grey = modulation[u].grey();
                    let is_lit = modulation_grey >= least;
                    let fits = valid[u] && residual[u] <= self.largest(modulation_grey);
                    if !is_saturated && (fits || !is_lit) {
                        counts.exposure.add(false, modulation_grey, least);
                        continue;
                    }
                    let motion_rad = if motion[u].is_finite() { motion[u] } else { 0.0 };
                    let found = self.best(pixel, motion_rad);
                    valid[u] = found.is_some();
                    if let Some([offset, re, im, _]) = found {
                        phase[u] = turn_fraction(im, re);
                        modulation[u] = Modulation::of_grey((re * re + im * im).sqrt());
                        mean[u] = (offset + 0.5) as u8;
                    }
                    counts.exposure.add(is_saturated, modulation[u].grey(), least);
                    if is_saturated {
                        // Too much light, not motion.
                        continue;
                    }
                    let count = if found.is_some() { &mut counts.one_surface_pixels } else { &mut counts.lost_pixels };
                    *count += 1;
                }
                counts
            });
        counts.reduce(Repaired::default, |a, b| Repaired {
            one_surface_pixels: a.one_surface_pixels + b.one_surface_pixels,
            lost_pixels: a.lost_pixels + b.lost_pixels,
            exposure: a.exposure.plus(b.exposure),
        })
    }

    /// Largest residual of images that belong together.
    fn largest(&self, modulation: f32) -> f32 {
        self.usual[0].max(self.usual[1] * modulation)
    }

    /// The solution of the run that fits best.
    fn best(&self, pixel: usize, motion_rad: f32) -> Option<Solution> {
        let share = |[_, re, im, residual]: &Solution| residual / (re * re + im * im).sqrt();
        let solutions = self.runs.iter().filter_map(|run| self.solve(*run, pixel, motion_rad));
        let fitting = solutions.filter(|[_, re, im, residual]| {
            let modulation = (re * re + im * im).sqrt();
            let limit = self.largest(modulation).max(self.validity.max_residual_share * modulation);
            modulation >= self.validity.min_modulation_grey && *residual <= limit
        });
        fitting.min_by(|a, b| share(a).total_cmp(&share(b)))
    }

    fn solve(&self, [first, last]: [usize; 2], pixel: usize, motion_rad: f32) -> Option<Solution> {
        let kept = (first..=last).filter(|&image| !self.window.is_saturated(image, pixel));
        let samples: Vec<[f32; 3]> = kept
            .map(|image| {
                let [t, shift] = self.moments[image];
                [self.window.grey(image, pixel), t, shift]
            })
            .collect();
        if samples.len() < LEAST_FITTED {
            return None;
        }
        solve_moving(&samples, motion_rad)
    }
}

/// Runs of images that include the centre of the window and leave a residual, the longest first.
fn runs(images: usize) -> Vec<[usize; 2]> {
    let centre = |first: usize, last: usize| 2 * first < images && 2 * last + 2 > images;
    let mut lengths: Vec<usize> = [images, images.saturating_sub(2), images.div_ceil(2) + 1].into();
    lengths.retain(|&length| length >= LEAST_FITTED);
    lengths.dedup();
    let of = |length: usize| (0..=images - length).map(move |first| [first, first + length - 1]);
    lengths.into_iter().flat_map(of).filter(|&[first, last]| centre(first, last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_include_the_centre_and_leave_a_residual() {
        assert_eq!(runs(6), [[0, 5], [0, 3], [1, 4], [2, 5]]);
        assert_eq!(runs(5), [[0, 4], [0, 3], [1, 4]]);
        for images in 5..24 {
            for [first, last] in runs(images) {
                let middle = (images - 1) as f64 / 2.0;
                assert!(first as f64 <= middle + 0.5 && last as f64 >= middle - 0.5 && last < images);
            }
        }
    }
}
