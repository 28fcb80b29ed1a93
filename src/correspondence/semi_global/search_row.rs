//! A row of pixels, ready for the search of its candidates: segments, drift, and the predicted sd of δ.

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::drift::DepthRow;
use crate::correspondence::pixel_search::{PixelSearch, Reach};
use crate::correspondence::scene::Scene;
use crate::correspondence::segment::SegmentRow;
use crate::phase::Modulation;

use super::kernels;

/// Share of the variance of δ that grows with (noise / modulation)²; the rest is equal for all pixels.
const NOISE_SHARE: f32 = 0.5;
/// Largest sd of a pixel, relative to one of median modulation.
const MAX_SD_RATIO: f32 = 4.0;

/// Predicted sd of δ of a true candidate about the drift.
pub(super) struct DeltaScale {
    /// At median modulation, turns.
    sd_turns: f32,
    /// Median modulation, grey levels.
    median_grey: f32,
}

impl DeltaScale {
    pub(super) fn from_scene(scene: &Scene<'_>) -> Self {
        let cam1 = scene.view.cam1;
        let median_grey = median_modulation(&cam1.modulation, &cam1.valid, cam1.width).map_or(1.0, Modulation::grey);
        let sd_turns = (scene.drift.residual_sd_rad / std::f64::consts::TAU) as f32;
        Self { sd_turns, median_grey }
    }

    /// At a modulation, turns.
    #[inline(always)]
    fn sd_turns(&self, modulation_grey: f32) -> f32 {
        let ratio = self.median_grey / modulation_grey.max(f32::MIN_POSITIVE);
        let variance = 1.0 - NOISE_SHARE + NOISE_SHARE * ratio * ratio;
        self.sd_turns * variance.sqrt().min(MAX_SD_RATIO)
    }
}

/// Median modulation of the valid pixels, from a sample of the rows.
fn median_modulation(modulation: &[Modulation], valid: &[bool], width: usize) -> Option<Modulation> {
    /// Distance of the sampled rows.
    const PITCH: usize = 16;
    // First the upper byte of the median, then the lower one. Neighbouring pixels have similar values, so each adds to
    // a histogram of its own: no addition waits for the one before.
    const WAYS: usize = 4;
    let rows = || modulation.chunks(width).zip(valid.chunks(width)).step_by(PITCH);
    let mut upper = [[0_u32; 256]; WAYS];
    for (modulation, valid) in rows().flat_map(|(modulation, valid)| modulation.chunks(WAYS).zip(valid.chunks(WAYS))) {
        for ((counts, modulation), &valid) in upper.iter_mut().zip(modulation).zip(valid) {
            counts[usize::from(modulation.steps() >> 8)] += u32::from(valid);
        }
    }
    let upper: [u32; 256] = std::array::from_fn(|byte| upper.iter().map(|counts| counts[byte]).sum());
    let (byte, rank) = ranked(&upper, upper.iter().sum::<u32>() / 2)?;
    let mut lower = [0_u32; 256];
    for (modulation, &valid) in rows().flat_map(|(modulation, valid)| modulation.iter().zip(valid)) {
        let is_near = valid && usize::from(modulation.steps() >> 8) == byte;
        lower[usize::from(modulation.steps() & 0xff)] += u32::from(is_near);
    }
    ranked(&lower, rank).map(|(lower, _)| Modulation::from_steps((byte << 8 | lower) as u16))
}

/// The bin that holds the number of a rank, and its rank in the bin.
pub(super) fn ranked(counts: &[u32], rank: u32) -> Option<(usize, u32)> {
    let mut below = 0;
    let place = counts.iter().position(|count| {
        below += count;
        below > rank
    })?;
    Some((place, rank + counts[place] - below))
}

/// Computes the sd of the pixels of a row.
struct ScaleRow<'a> {
    scale: &'a DeltaScale,
    modulation: &'a [Modulation],
    sd_turns: &'a mut [f32],
}

impl Kernel for ScaleRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (sd_turns, modulation) in self.sd_turns.iter_mut().zip(self.modulation) {
            *sd_turns = self.scale.sd_turns(modulation.grey());
        }
    }
}

/// Segments, drift and sd of a row of pixels, for searching their candidates.
#[derive(Clone, Debug, Default)]
pub(super) struct SearchRow {
    pub(super) segments: SegmentRow,
    drift: DepthRow,
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: Vec<f32>,
    v: usize,
}

impl SearchRow {
    /// Loads row `v`.
    pub(super) fn load_row(&mut self, scene: &Scene<'_>, scale: &DeltaScale, v: usize) {
        let width = scene.view.cam1.width;
        self.v = v;
        scene.view.table.row(v, &mut self.segments);
        scene.drift.along_row(v, width, &mut self.drift);
        self.sd_turns.resize(width, 0.0);
        let modulation = &scene.view.cam1.modulation[v * width..(v + 1) * width];
        fringeflow_simd::run(Level::in_use(), ScaleRow { scale, modulation, sd_turns: &mut self.sd_turns });
    }

    /// The search of a pixel of the row.
    pub(super) fn search<'a>(&self, scene: &Scene<'a>, reach: Reach, u: usize) -> PixelSearch<'a> {
        PixelSearch::new(scene, reach, &self.segments, &self.drift, [u, self.v])
    }

    /// The row for the kernels over 32 pixels.
    pub(super) fn block_row<'a>(&'a self, scene: &Scene<'a>, reach: Reach) -> kernels::Row<'a> {
        let width = scene.view.cam1.width;
        kernels::Row {
            image: scene.view.cam2,
            segments: &self.segments,
            drift: &self.drift,
            reach,
            phase: &scene.view.cam1.phase[self.v * width..(self.v + 1) * width],
            sd_turns: &self.sd_turns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_modulation_is_that_of_sorting() {
        for count in [0, 1, 2, 7, 1000, 1001] {
            let modulation: Vec<Modulation> =
                (0..count).map(|i: u32| Modulation::from_steps((i * 40_503 % 5003) as u16)).collect();
            let valid: Vec<bool> = (0..count).map(|i| i % 3 != 1).collect();
            let mut lit: Vec<Modulation> =
                modulation.iter().zip(&valid).filter(|(_, valid)| **valid).map(|(m, _)| *m).collect();
            lit.sort();
            assert_eq!(median_modulation(&modulation, &valid, 1001), lit.get(lit.len() / 2).copied());
        }
    }
}
