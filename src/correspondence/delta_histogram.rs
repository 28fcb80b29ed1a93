//! The histogram of δ, and the fit of its peak.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::candidates::{Candidate, DeltaGate, scan_segment};
use super::delta_statistics::{DeltaStatistics, MIN_SD_TURNS};
use super::epipolar_image::EpipolarImage;
use super::moments::Model;
use super::pool::Pool;
use super::row_view::RowView;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;
use super::view::View;

/// Distance of the examined pixels of C1 along both axes.
const STRIDE: usize = 8;
/// Bins of the histogram over one turn.
const BINS: usize = 512;
/// Half width of the fitted part, turns (0.8 rad): it excludes the nearest teeth.
const FIT_HALF_WIDTH_TURNS: f64 = 0.127;
/// Half width within which the peak is sought, turns (0.6 rad).
const PEAK_HALF_WIDTH_TURNS: f64 = 0.095;
/// Bins on either side that are averaged to find the peak.
const SMOOTHING_BINS: usize = 4;
/// Steps of the fit. It settles within twenty.
const FIT_STEPS: usize = 50;

/// Histogram of δ over all candidates of a sample of the pixels, before any test. True candidates make a peak near
/// zero, false ones a floor with teeth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeltaHistogram {
    /// Counts; bin k begins at δ = k turns / 512.
    bins: [u32; BINS],
    /// Examined pixels that have a candidate.
    pixels: u32,
}

impl Default for DeltaHistogram {
    fn default() -> Self {
        Self { bins: [0; BINS], pixels: 0 }
    }
}

impl DeltaHistogram {
    /// The histogram with the phases of C1 lowered by `ahead`, turns · 65536.
    #[must_use]
    pub fn from_all_candidates(cam1: &PhaseMap, cam2: &EpipolarImage, table: &SegmentTable, ahead: u16) -> Self {
        HistogramScratch::default().count(View { cam1, cam2, table, model: &Model::USUAL }, ahead)
    }

    /// Counts over −π to π rad in equal parts, in ascending order of δ.
    #[must_use]
    pub fn from_minus_to_plus_pi(&self) -> [u32; BINS] {
        std::array::from_fn(|part| self.bins[(part + BINS / 2) % BINS])
    }

    /// Candidates per pixel whose δ plus an offset is near zero. Each counts `exp(−δ²/(2·sd²))`.
    pub(super) fn agreement(&self, offset_rad: f64, sd_rad: f64) -> f64 {
        let weight = |bin: usize| {
            let delta_rad = (bin as f64 + 0.5) / BINS as f64 * TAU + offset_rad;
            let wrapped_rad = delta_rad - (delta_rad / TAU).round() * TAU;
            (-0.5 * (wrapped_rad / sd_rad).powi(2)).exp()
        };
        let sum: f64 = self.bins.iter().enumerate().map(|(bin, &count)| f64::from(count) * weight(bin)).sum();
        sum / f64::from(self.pixels.max(1))
    }

    /// Count of a bin by its distance from δ = 0.
    fn at(&self, offset: i64) -> f64 {
        f64::from(self.bins[offset.rem_euclid(BINS as i64) as usize])
    }

    fn add(&mut self, other: &Self) {
        self.bins.iter_mut().zip(&other.bins).for_each(|(mine, theirs)| *mine += theirs);
        self.pixels += other.pixels;
    }

    /// Fits a normal distribution on a constant floor around the peak near zero, by expectation maximization.
    pub(super) fn fit(&self) -> Option<DeltaStatistics> {
        let candidates: u32 = self.bins.iter().sum();
        if candidates == 0 {
            return None;
        }
        let peak = self.peak();
        let half = (FIT_HALF_WIDTH_TURNS * BINS as f64) as i64;
        let width = (2 * half + 1) as f64;
        let (mut mean, mut sd, mut share) = (peak as f64, 0.02 * BINS as f64, 0.5);
        for _ in 0..FIT_STEPS {
            let (mut weight, mut first, mut second, mut total) = (0.0, 0.0, 0.0, 0.0);
            for offset in peak - half..=peak + half {
                let (x, count) = (offset as f64, self.at(offset));
                let normal = share * (-0.5 * ((x - mean) / sd).powi(2)).exp() / (sd * TAU.sqrt());
                // Expectation: the share of the bin that belongs to the peak.
                let belongs = count * normal / (normal + (1.0 - share) / width);
                weight += belongs;
                first += belongs * x;
                second += belongs * (x - mean).powi(2);
                total += count;
            }
            if weight <= 0.0 {
                break;
            }
            mean = first / weight;
            sd = (second / weight).sqrt().max(MIN_SD_TURNS * BINS as f64);
            share = (weight / total).clamp(0.01, 0.999);
        }
        // A bin's δ lies half a bin above its lower edge.
        Some(DeltaStatistics {
            mean_rad: (mean + 0.5) / BINS as f64 * TAU,
            sd_rad: sd / BINS as f64 * TAU,
            noise_sd_rad: sd / BINS as f64 * TAU,
            mean_periods: f64::from(candidates) / f64::from(self.pixels.max(1)),
            references: 0,
        })
    }

    /// Bin of the highest point near zero after smoothing.
    fn peak(&self) -> i64 {
        let reach = (PEAK_HALF_WIDTH_TURNS * BINS as f64) as i64;
        let smooth = SMOOTHING_BINS as i64;
        let height = |centre: i64| (centre - smooth..=centre + smooth).map(|o| self.at(o)).sum::<f64>();
        (-reach..=reach).max_by(|&a, &b| height(a).total_cmp(&height(b))).unwrap_or(0)
    }
}

/// Scratch memory for histograms, kept from window to window.
#[derive(Clone, Debug, Default)]
pub(super) struct HistogramScratch(Pool<Part>);

/// Histogram over the rows that one thread takes, with its scratch memory.
#[derive(Debug, Default)]
struct Part {
    segments: SegmentRow,
    found: Vec<Candidate>,
    histogram: DeltaHistogram,
}

impl HistogramScratch {
    /// As [`DeltaHistogram::from_all_candidates`].
    pub(super) fn count(&mut self, view: View<'_>, ahead: u16) -> DeltaHistogram {
        let Self(parts) = self;
        parts.scratches().iter_mut().for_each(|part| part.histogram = DeltaHistogram::default());
        let rows = view.cam1.height.saturating_sub(STRIDE / 2).div_ceil(STRIDE);
        (0..rows)
            .into_par_iter()
            .for_each_init(|| parts.take(), |part, row| part.add_row(view, STRIDE / 2 + row * STRIDE, ahead));
        let mut histogram = DeltaHistogram::default();
        parts.scratches().iter().for_each(|part| histogram.add(&part.histogram));
        histogram
    }
}

impl Part {
    fn add_row(&mut self, View { cam1, cam2, table, .. }: View<'_>, v: usize, ahead: u16) {
        let Self { segments, found, histogram } = self;
        table.row(v, segments);
        for u in (STRIDE / 2..cam1.width).step_by(STRIDE) {
            let (i, segment) = (v * cam1.width + u, segments.segment(u));
            if !cam1.valid[i] || segment.is_none() {
                continue;
            }
            found.clear();
            let phase = cam1.phase[i].wrapping_sub(ahead);
            scan_segment(&RowView::new(cam2, segment.row_px), &segment, phase, &DeltaGate::OPEN, found);
            histogram.pixels += u32::from(!found.is_empty());
            for candidate in &*found {
                histogram.bins[(candidate.delta as u16 as usize * BINS) >> 16] += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_on_a_floor_with_a_tooth_is_measured() {
        let mut histogram = DeltaHistogram { bins: [40; BINS], pixels: 1000 };
        let (mean_turns, sd_turns) = (-0.008, 0.0065);
        for (i, bin) in histogram.bins.iter_mut().enumerate() {
            let at = |centre: f64, sd: f64| {
                let x = (i as f64 + 0.5) / BINS as f64;
                let off = (x - centre + 0.5).rem_euclid(1.0) - 0.5;
                (-0.5 * (off / sd).powi(2)).exp()
            };
            *bin += (400.0 * at(mean_turns, sd_turns) + 900.0 * at(0.2, 0.01)) as u32;
        }
        let fit = histogram.fit().unwrap();
        assert!((fit.mean_rad / TAU - mean_turns).abs() < 0.1 * sd_turns, "{fit:?}");
        assert!((fit.sd_rad / TAU / sd_turns - 1.0).abs() < 0.1, "{fit:?}");
    }

    #[test]
    fn parts_run_from_minus_to_plus_half_a_turn() {
        let mut histogram = DeltaHistogram::default();
        // δ of 0, just above it, just below it, and of half a turn, which is the same as minus half a turn.
        for (bin, count) in [(0, 1), (1, 2), (BINS - 1, 4), (BINS / 2, 8)] {
            histogram.bins[bin] = count;
        }
        let parts = histogram.from_minus_to_plus_pi();
        let filled: Vec<_> = parts.iter().enumerate().filter(|(_, n)| **n > 0).map(|(part, &n)| (part, n)).collect();
        assert_eq!(filled, [(0, 8), (255, 4), (256, 1), (257, 2)]);
    }
}
