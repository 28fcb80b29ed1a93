//! sd, measured from the images themselves, without truth (paper, section 2.3).
//!
//! The true candidates form a narrow peak in the histogram of δ near zero; the false ones a floor below it, with teeth
//! of their own elsewhere (δ of the candidate k orders away on a flat surface is close to 2π·k·r, r the place of the
//! projector on the base). A first estimate is a normal distribution on a constant floor, fitted around the peak. With
//! the threshold that follows, reference correspondences are selected; their δ, free of the floor, give mean and sd.

use std::f64::consts::TAU;

use crate::phase::PhaseMap;

use super::candidates::DeltaGate;
use super::delta_histogram::DeltaHistogram;
use super::epipolar_image::EpipolarImage;
use super::resolution::{self, Evidence, References, ResolutionSettings};
use super::search::Search;
use super::segment_table::SegmentTable;

/// Rows of the bands in which references are selected, and the distance from one band to the next.
const BAND_ROWS: usize = 16;
const BAND_PITCH_ROWS: usize = 128;
/// Least sd that is believed, turns (0.003 rad): rounding alone makes more.
pub(super) const MIN_SD_TURNS: f64 = 0.0005;
/// Factor from sd to the threshold (paper, section 2.1).
const THRESHOLD_SD: f64 = 3.0;
/// sd of δ beyond which something is wrong with images or calibration, rad.
const SUSPICIOUS_SD_RAD: f64 = 0.15;
/// Fewest reference correspondences that refine the first estimate.
const MIN_REFERENCES: usize = 200;
/// Tolerated difference of δ between neighbours, in standard deviations of that difference.
const TOLERANCE_NOISE_SD: f64 = 6.0;
/// Least tolerated difference, in sd: the smooth part of δ changes too.
const MIN_TOLERANCE_SD: f64 = 0.5;
/// Change of δ over the width of the image, in sd, that a calibration error does not reach: three times the range ±3·sd
/// that contains nearly all of it.
pub(super) const MAX_CHANGE_OVER_IMAGE_SD: f64 = 20.0;
/// Slope of δ over seven pixels that noise does not reach, in its standard deviations: 5/√28.
const STEEP_NOISE_SD: f64 = 1.0;
/// Rounds of refinement, and the relative change of sd below which another one would find nothing new.
const REFINEMENTS: usize = 2;
const REFINED_CHANGE: f64 = 0.1;

/// Mean and standard deviation of δ over the true candidates, and what follows from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeltaStatistics {
    /// Mean of δ, rad: zero for a perfect calibration.
    pub mean_rad: f64,
    /// Standard deviation of δ about its mean, rad: the paper's sd.
    pub sd_rad: f64,
    /// Standard deviation of δ from one pixel to the next of one surface (÷ √2), rad: what noise contributes to sd.
    pub noise_sd_rad: f64,
    /// Mean number n of fringe periods on a segment, over the valid pixels.
    pub mean_periods: f64,
    /// Reference correspondences that mean and sd were measured on.
    pub references: usize,
}

impl DeltaStatistics {
    /// Threshold thr = 3·sd, rad; never more than half a turn.
    #[must_use]
    pub fn threshold_rad(&self) -> f64 {
        (THRESHOLD_SD * self.sd_rad).min(0.5 * TAU)
    }

    /// The back-projection test that follows.
    #[must_use]
    pub fn gate(&self) -> DeltaGate {
        DeltaGate { mean_turns: (self.mean_rad / TAU) as f32, threshold_turns: (self.threshold_rad() / TAU) as f32 }
    }

    /// What the resolution reads, with the tolerances that follow.
    pub(super) fn evidence<'a>(
        &self,
        cam1: &'a PhaseMap,
        gate: &'a DeltaGate,
        readmission: &'a DeltaGate,
        table: &'a SegmentTable,
    ) -> Evidence<'a> {
        let (delta_tolerance_turns, steep_delta_turns) = (self.tolerance_turns(), self.steep_turns(cam1.width));
        Evidence { cam1, gate, readmission, delta_tolerance_turns, steep_delta_turns, table }
    }

    /// Difference of δ between neighbours of one surface that is tolerated, turns.
    #[must_use]
    pub fn tolerance_turns(&self) -> f32 {
        let noise_rad = TOLERANCE_NOISE_SD * 2.0_f64.sqrt() * self.noise_sd_rad;
        (noise_rad.max(MIN_TOLERANCE_SD * self.sd_rad) / TAU).min(0.5) as f32
    }

    /// Change of δ a pixel, over a few pixels, that neither a calibration error nor noise makes, turns.
    #[must_use]
    pub fn steep_turns(&self, width_px: usize) -> f32 {
        let of_calibration_rad = MAX_CHANGE_OVER_IMAGE_SD * self.sd_rad / width_px as f64;
        ((of_calibration_rad + STEEP_NOISE_SD * self.noise_sd_rad) / TAU) as f32
    }

    /// Whether δ scatters over three times as widely as on calibrated rigs, the paper's and ours: images and calibration may
    /// not belong together, or the calibration is out of date.
    #[must_use]
    pub fn is_suspicious(&self) -> bool {
        self.sd_rad > SUSPICIOUS_SD_RAD
    }

    /// Expected number of additional false candidates per true one (paper, Eq. 1): efc = 3·sd·(n − 1)/π.
    #[must_use]
    pub fn expected_false_candidates(&self) -> f64 {
        THRESHOLD_SD * self.sd_rad * (self.mean_periods - 1.0).max(0.0) / (0.5 * TAU)
    }
}

/// Measures mean and sd of δ, and n, from the phases of one pair of images, beginning with their histogram; `None` where no
/// pixel has a candidate.
#[must_use]
pub fn measure_delta(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    histogram: &DeltaHistogram,
    settings: &ResolutionSettings,
) -> Option<DeltaStatistics> {
    DeltaRoom::default().measure(cam1, cam2, table, histogram, settings)
}

/// Memory in which δ is measured, to be used from window to window.
#[derive(Clone, Debug, Default)]
pub(super) struct DeltaRoom {
    /// Rows that say what δ is like.
    rows: Vec<Option<usize>>,
    sample: PhaseMap,
    resolution: resolution::Room,
    references: References,
}

impl DeltaRoom {
    /// As [`measure_delta`].
    pub(super) fn measure(
        &mut self,
        cam1: &PhaseMap,
        cam2: &EpipolarImage,
        table: &SegmentTable,
        histogram: &DeltaHistogram,
        settings: &ResolutionSettings,
    ) -> Option<DeltaStatistics> {
        let mut statistics = histogram.fit()?;
        let Self { rows, sample, resolution, references } = self;
        find_bands(cam1.height, rows);
        stack(cam1, rows, sample);
        for _ in 0..REFINEMENTS {
            let gate = statistics.gate();
            let search = Search { cam1, cam2, table, gate: &gate, asks_elsewhere: false };
            let evidence = statistics.evidence(sample, &gate, &gate, table);
            resolution.find_references(&search, rows, evidence, settings, references);
            let References { deltas, differences, .. } = references;
            statistics.references = deltas.len();
            if deltas.len() < MIN_REFERENCES {
                break;
            }
            let sd_before_rad = statistics.sd_rad;
            (statistics.mean_rad, statistics.sd_rad) = mean_and_sd_rad(deltas.iter().copied());
            statistics.noise_sd_rad = sd_of_differences_rad(differences) / 2.0_f64.sqrt();
            if (statistics.sd_rad / sd_before_rad - 1.0).abs() < REFINED_CHANGE {
                break;
            }
        }
        Some(statistics)
    }
}

/// The rows that say what δ is like, one below the other, with an empty one after each band of them: an eighth of the image.
/// All rows of images so small that all are needed.
fn find_bands(height: usize, bands: &mut Vec<Option<usize>>) {
    bands.clear();
    if height < 2 * BAND_PITCH_ROWS {
        return bands.extend((0..height).map(Some));
    }
    let rows = (0..height).filter(|v| v % BAND_PITCH_ROWS <= BAND_ROWS);
    bands.extend(rows.map(|v| (v % BAND_PITCH_ROWS < BAND_ROWS).then_some(v)));
}

/// Puts some rows of a phase map one below the other; a row that is `None` has no phase.
fn stack(map: &PhaseMap, rows: &[Option<usize>], stack: &mut PhaseMap) {
    let width = map.width;
    (stack.width, stack.height) = (width, rows.len());
    stack.phase.resize(rows.len() * width, 0);
    stack.valid.resize(rows.len() * width, false);
    let places = stack.phase.chunks_mut(width).zip(stack.valid.chunks_mut(width)).zip(rows);
    for ((phase, valid), v) in places {
        match *v {
            Some(v) => {
                phase.copy_from_slice(&map.phase[v * width..(v + 1) * width]);
                valid.copy_from_slice(&map.valid[v * width..(v + 1) * width]);
            }
            None => {
                phase.fill(0);
                valid.fill(false);
            }
        }
    }
}

/// Mean and standard deviation of δ given in turns · 65536, rad.
pub(super) fn mean_and_sd_rad(deltas: impl Iterator<Item = i16>) -> (f64, f64) {
    let (mut count, mut sum, mut squares) = (0_u32, 0_i64, 0_i64);
    for delta in deltas.map(i64::from) {
        (count, sum, squares) = (count + 1, sum + delta, squares + delta * delta);
    }
    mean_and_sd_of_sums_rad(count, sum, squares)
}

/// The same of so many, from their sum and that of their squares.
pub(super) fn mean_and_sd_of_sums_rad(count: u32, sum: i64, squares: i64) -> (f64, f64) {
    let count = f64::from(count.max(1));
    let mean = sum as f64 / count;
    let variance = (squares as f64 / count - mean * mean).max((MIN_SD_TURNS * 65536.0).powi(2));
    (mean * TAU / 65536.0, variance.sqrt() * TAU / 65536.0)
}

/// Standard deviation of differences of δ (turns · 65536) from their median magnitude, rad: edges do not disturb it. They are put
/// in another order.
fn sd_of_differences_rad(differences: &mut [i16]) -> f64 {
    const MEDIAN_OF_UNIT_NORMAL: f64 = 0.6745;
    let middle = differences.len() / 2;
    if differences.is_empty() {
        return 0.0;
    }
    let (_, median, _) = differences.select_nth_unstable_by_key(middle, |difference| difference.unsigned_abs());
    f64::from(median.unsigned_abs()) / 65536.0 * TAU / MEDIAN_OF_UNIT_NORMAL
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efc_is_equation_1_of_the_paper() {
        // The paper's own figures: n = 6, sd = 0.041, efc = 0.20.
        let statistics =
            DeltaStatistics { mean_rad: 0.0, sd_rad: 0.041, noise_sd_rad: 0.005, mean_periods: 6.0, references: 0 };
        assert!((statistics.expected_false_candidates() - 0.20).abs() < 0.005);
    }
}
