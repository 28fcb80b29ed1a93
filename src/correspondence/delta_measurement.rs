//! Measures sd from the images themselves, without ground truth (paper, section 2.3).
//!
//! True candidates make a narrow peak near zero in the histogram of δ. False ones make a floor, with teeth elsewhere:
//! on a flat surface δ of the candidate k orders away is close to 2π·k·r, where r is the place of the projector on the
//! base. The first estimate is a normal distribution on a constant floor, fitted around the peak. Its threshold selects
//! reference correspondences. Their δ, free of the floor, gives mean and sd.

use std::f64::consts::TAU;

use crate::phase::PhaseMap;

use super::delta_histogram::DeltaHistogram;
use super::delta_statistics::{DeltaStatistics, mean_and_sd_rad};
use super::epipolar_image::EpipolarImage;
use super::moments::Model;
use super::segment_table::SegmentTable;
use super::support::{Support, SupportRule};
use super::unique::{Search, UniqueCandidates};
use super::view::View;

/// Bands of rows in which references are selected, and rows of one.
const BANDS: usize = 4;
const BAND_ROWS: usize = 16;
/// Rows of an image that is sampled whole.
const FEW_ROWS: usize = 256;
/// Fewest reference correspondences needed to refine the first estimate.
const MIN_REFERENCES: usize = 200;
/// Rounds of refinement, and the relative change of sd below which another round is skipped.
const REFINEMENTS: usize = 2;
const REFINED_CHANGE: f64 = 0.1;

/// Measures mean and sd of δ, and n, from one pair of phase maps, starting from their histogram. A reference needs the
/// support of `min_votes` neighbours. `None` if no pixel has a candidate.
#[must_use]
pub fn measure_delta(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    histogram: &DeltaHistogram,
    min_votes: u16,
) -> Option<DeltaStatistics> {
    DeltaScratch::default().measure(View { cam1, cam2, table, model: &Model::USUAL }, histogram, min_votes)
}

/// Scratch memory for the measurement, kept from window to window.
#[derive(Clone, Debug, Default)]
pub(super) struct DeltaScratch {
    /// The rows that are sampled.
    rows: Vec<Option<usize>>,
    sample: PhaseMap,
    unique: UniqueCandidates,
    support: Support,
    /// δ of the reference correspondences, turns · 65536, and its differences between horizontal neighbours.
    deltas: Vec<i16>,
    differences: Vec<i16>,
}

impl DeltaScratch {
    /// As [`measure_delta`].
    pub(super) fn measure(
        &mut self,
        view: View<'_>,
        histogram: &DeltaHistogram,
        min_votes: u16,
    ) -> Option<DeltaStatistics> {
        let mut statistics = histogram.fit()?;
        find_bands(view.cam1.height, &mut self.rows);
        stack(view.cam1, &self.rows, &mut self.sample);
        for _ in 0..REFINEMENTS {
            let search = Search { view, gate: &statistics.gate() };
            let rule = SupportRule { min_votes, tolerance: statistics.tolerance() };
            self.find_references(search, rule);
            let Self { deltas, differences, .. } = self;
            statistics.references = deltas.len();
            // Too few references: the fit of the histogram stands.
            if deltas.len() < MIN_REFERENCES {
                break;
            }
            let sd_before_rad = statistics.sd_rad;
            (statistics.mean_rad, statistics.sd_rad) = mean_and_sd_rad(deltas);
            statistics.noise_sd_rad = sd_of_differences_rad(differences) / 2.0_f64.sqrt();
            if (statistics.sd_rad / sd_before_rad - 1.0).abs() < REFINED_CHANGE {
                break;
            }
        }
        Some(statistics)
    }

    /// Selects the reference correspondences of the sampled rows: pixels with exactly one candidate that passes,
    /// supported by neighbours that have exactly one too and agree by Eq. (2) (paper, 2.2.1).
    fn find_references(&mut self, search: Search<'_>, rule: SupportRule) {
        let Self { rows, sample, unique, support, deltas, differences } = self;
        unique.find(search, rows);
        support.find(sample, &unique.absolute, &unique.delta, rule);
        deltas.clear();
        differences.clear();
        let width = sample.width.max(1);
        for (delta, is_reference) in unique.delta.chunks(width).zip(support.is_supported.chunks(width)) {
            let references = delta.iter().zip(is_reference).filter(|(_, is_reference)| **is_reference);
            deltas.extend(references.map(|(delta, _)| delta));
            let pairs = delta.windows(2).zip(is_reference.windows(2)).filter(|(_, both)| both[0] & both[1]);
            differences.extend(pairs.map(|(delta, _)| delta[1].wrapping_sub(delta[0])));
        }
    }
}

/// Lists the sampled rows: bands with one empty row after each. A small image is sampled whole.
fn find_bands(height: usize, bands: &mut Vec<Option<usize>>) {
    bands.clear();
    if height < FEW_ROWS {
        return bands.extend((0..height).map(Some));
    }
    let pitch = height / BANDS;
    let rows = (0..height).filter(|v| v % pitch <= BAND_ROWS);
    bands.extend(rows.map(|v| (v % pitch < BAND_ROWS).then_some(v)));
}

/// Copies rows of a phase map one below the other. A row that is `None` has no phase.
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

/// Standard deviation of differences of δ (turns · 65536), rad, from their median magnitude: edges do not disturb it.
/// Reorders the differences.
fn sd_of_differences_rad(differences: &mut [i16]) -> f64 {
    const MEDIAN_OF_UNIT_NORMAL: f64 = 0.6745;
    let middle = differences.len() / 2;
    if differences.is_empty() {
        return 0.0;
    }
    let (_, median, _) = differences.select_nth_unstable_by_key(middle, |difference| difference.unsigned_abs());
    f64::from(median.unsigned_abs()) / 65536.0 * TAU / MEDIAN_OF_UNIT_NORMAL
}
