//! The whole chain of the proposed method (PA), from two phase maps to a decision about every pixel of C1.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::agreement::{MatchError, check_scatter, check_share};
use super::candidates::{Candidate, DeltaGate, RowView, occurs};
use super::delta_statistics::{DeltaStatistics, mean_and_sd_rad, measure_delta};
use super::epipolar_image::EpipolarImage;
use super::outcome::Outcome;
use super::resolution::{Resolution, ResolutionSettings, resolve};
use super::search::{CandidateLists, SearchForm, find_candidates};
use super::segment_table::SegmentTable;

/// Factor on thr within which a candidate may still be decided by its neighbours (5·sd in all).
const READMISSION: f32 = 1.67;
/// Least such bound, turns (0.19 rad): at edges, where a pixel mixes surfaces, δ errs by more than the noise of the rest.
const MIN_READMISSION_TURNS: f32 = 0.03;
/// Relative change of sd after the resolution that calls for another pass with the better threshold.
const SD_CHANGE: f64 = 0.5;

/// How correspondences are found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MatchSettings {
    /// Standard deviation of δ, rad, where it is not to be measured.
    pub delta_sd_rad: Option<f64>,
    /// Resolution of ambiguous pixels.
    pub resolution: ResolutionSettings,
}

/// Correspondences of all pixels of C1, row by row, and what they rest on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matches {
    /// What became of each pixel.
    pub outcomes: Vec<Outcome>,
    /// The chosen candidate of each pixel with a found outcome.
    pub chosen: Vec<Option<Candidate>>,
    /// Number of candidates of each pixel that passed the back-projection test.
    pub passing: Vec<u8>,
    /// Statistics of δ from which the threshold came.
    pub delta: DeltaStatistics,
    /// δ of all candidates of some of the pixels: their numbers in equal parts of −π to π rad.
    pub delta_counts: Vec<u32>,
    /// Mean and sd of δ over the chosen candidates, rad.
    pub chosen_delta_rad: (f64, f64),
}

/// Finds the correspondence of every pixel of C1.
///
/// # Errors
/// Maps of another size than the table's, maps that have nothing in common, or a calibration they do not belong to.
pub fn match_phases(
    cam1: &PhaseMap,
    cam2: &PhaseMap,
    table: &SegmentTable,
    settings: &MatchSettings,
) -> Result<Matches, MatchError> {
    let (found, expected) = ([cam1.width, cam1.height], table.size_px());
    let size_error = MatchError::Size { found, expected };
    if found != expected {
        return Err(size_error);
    }
    let exchanged = || {
        let image = EpipolarImage::resample(cam1, table)?;
        let is_of_size = [cam2.width, cam2.height] == expected;
        is_of_size.then(|| measure_delta(cam2, &image, table, &settings.resolution))?.map(|(delta, _)| delta)
    };
    let cam2 = EpipolarImage::resample(cam2, table).ok_or(size_error)?;
    let measured = measure_delta(cam1, &cam2, table, &settings.resolution);
    let (mut delta, histogram) = measured.ok_or(MatchError::NothingInCommon)?;
    match settings.delta_sd_rad {
        Some(sd_rad) => delta.sd_rad = sd_rad,
        None => check_scatter(&delta, exchanged)?,
    }
    let mut pass = Pass::run(cam1, &cam2, table, &delta, &settings.resolution);
    let mut chosen_delta_rad = pass.delta_rad();
    let changed = (chosen_delta_rad.1 / delta.sd_rad - 1.0).abs() > SD_CHANGE;
    if changed && settings.delta_sd_rad.is_none() && pass.found() > 0 {
        (delta.mean_rad, delta.sd_rad) = chosen_delta_rad;
        check_scatter(&delta, exchanged)?;
        pass = Pass::run(cam1, &cam2, table, &delta, &settings.resolution);
        chosen_delta_rad = pass.delta_rad();
    }
    check_share(&delta, settings.delta_sd_rad.is_none(), pass.found(), pass.with_candidates())?;
    let passing = pass.passing(&delta.gate());
    let mut matches = Matches {
        chosen: pass.chosen().collect(),
        outcomes: pass.resolution.outcomes,
        passing,
        delta,
        delta_counts: histogram.from_minus_to_plus_pi().to_vec(),
        chosen_delta_rad,
    };
    explain_pixels_without_candidates(cam1, &cam2, table, &mut matches.outcomes);
    Ok(matches)
}

/// Candidates and decisions with one threshold.
struct Pass {
    candidates: CandidateLists,
    resolution: Resolution,
}

impl Pass {
    fn run(
        cam1: &PhaseMap,
        cam2: &EpipolarImage,
        table: &SegmentTable,
        delta: &DeltaStatistics,
        settings: &ResolutionSettings,
    ) -> Self {
        let gate = delta.gate();
        let threshold_turns = (READMISSION * gate.threshold_turns).max(MIN_READMISSION_TURNS);
        let readmission = DeltaGate { threshold_turns, ..gate };
        let candidates = find_candidates(cam1, cam2, table, &readmission, SearchForm::ProjectorSide);
        let evidence = delta.evidence(cam1, &candidates, &gate, &readmission, table);
        let resolution = resolve(evidence, settings);
        Self { candidates, resolution }
    }

    /// The chosen candidate of each pixel that found one.
    fn chosen(&self) -> impl Iterator<Item = Option<Candidate>> + '_ {
        self.resolution.outcomes.iter().enumerate().map(|(i, outcome)| {
            outcome.is_found().then(|| self.candidates.of(i)[usize::from(self.resolution.chosen[i])])
        })
    }

    fn found(&self) -> usize {
        self.resolution.outcomes.iter().filter(|o| o.is_found()).count()
    }

    fn with_candidates(&self) -> usize {
        self.resolution.outcomes.iter().filter(|&&o| o != Outcome::NoCandidate).count()
    }

    fn delta_rad(&self) -> (f64, f64) {
        let deltas: Vec<i16> = self.chosen().flatten().map(|c| c.delta).collect();
        mean_and_sd_rad(&deltas)
    }

    fn passing(&self, gate: &DeltaGate) -> Vec<u8> {
        let count = |i: usize| self.candidates.of(i).iter().filter(|c| gate.passes(c.delta)).count() as u8;
        (0..self.resolution.outcomes.len()).into_par_iter().map(count).collect()
    }
}

/// Tells pixels without candidate apart: no phase, no segment, nothing on it, or nothing that passes.
fn explain_pixels_without_candidates(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    outcomes: &mut [Outcome],
) {
    outcomes.par_iter_mut().enumerate().for_each(|(i, outcome)| {
        let segment = &table.segments()[i];
        if !cam1.valid[i] {
            *outcome = Outcome::Invalid;
        } else if segment.is_none() {
            *outcome = Outcome::OutsideVolume;
        } else if *outcome == Outcome::NoCandidate
            && occurs(&RowView::new(cam2, segment.row_px), segment, cam1.phase[i])
        {
            *outcome = Outcome::RejectedByDelta;
        }
    });
}
