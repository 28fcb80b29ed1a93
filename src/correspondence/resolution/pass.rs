//! One pass of the paper's method: candidates within one threshold, and the decisions about them.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::super::candidates::DeltaGate;
use super::super::chosen::ChosenCandidates;
use super::super::delta_statistics::DeltaStatistics;
use super::super::epipolar_image::EpipolarImage;
use super::super::outcome::Outcome;
use super::super::search::{CandidateLists, SearchForm, find_candidates};
use super::super::segment_table::SegmentTable;
use super::{Resolution, ResolutionSettings, resolve};

/// Factor on thr within which a candidate may still be decided by its neighbours (5·sd in all).
const READMISSION: f32 = 1.67;
/// Least such bound, turns (0.19 rad): at edges, where a pixel mixes surfaces, δ errs by more than the noise of the rest.
const MIN_READMISSION_TURNS: f32 = 0.03;

/// Candidates and decisions with one threshold.
pub(in super::super) struct Pass {
    candidates: CandidateLists,
    pub(in super::super) resolution: Resolution,
}

impl Pass {
    /// Finds and decides candidates with the threshold of `delta`.
    pub(in super::super) fn run(
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
    pub(in super::super) fn choose(&self, width: usize, out: &mut ChosenCandidates) {
        let Resolution { outcomes, chosen, .. } = &self.resolution;
        out.resize(outcomes.len());
        out.rows_mut(width).enumerate().for_each(|(v, mut row)| {
            for u in 0..width {
                let pixel = v * width + u;
                let candidate = || self.candidates.of(pixel)[usize::from(chosen[pixel])];
                row.set(u, outcomes[pixel].is_found().then(candidate));
            }
        });
    }

    /// Pixels with a correspondence.
    pub(in super::super) fn found(&self) -> usize {
        self.resolution.outcomes.iter().filter(|o| o.is_found()).count()
    }

    /// Pixels with candidates.
    pub(in super::super) fn with_candidates(&self) -> usize {
        self.resolution.outcomes.iter().filter(|&&o| o != Outcome::NoCandidate).count()
    }
}
