//! Which of the selected candidates stay.
//!
//! Regions of continuous absolute phase are judged first, as a whole:
//!
//! - A region of true candidates has z like a normal error, and every pixel of it stands out against the other orders. Over
//!   a region whose true candidates are missing, hidden from C2 or outside the search, δ of whatever was selected runs
//!   through anything, and another order would have done nearly as well.
//! - One place of C2 serves one order (paper, 2.2.3). A region that loses a good part of its places to better founded ones is
//!   wrong: where it lies, C2 sees them.
//!
//! The regions that stand are the ground on which every pixel is then judged by itself (*grounds*, *confidence*), those of
//! other regions too: at borders true candidates err by more than the noise of the rest and fall out of their regions.

use super::super::candidates::Candidate;
use super::super::outcome::Outcome;
use super::super::places::Places;
use super::claims::Claims;
use super::confidence::{Confidence, confidences};
use super::evidence::PASSING_Z;
use super::grounds::{Grounds, gather};
use super::paths::{PATHS, Verdict};
use super::regions::Regions;
use super::selection::Selected;
use super::{Decisions, Limits, Scene, UNITS_PER_NAT};

/// Difference of z between neighbours of one region.
const MAX_Z_STEP: f32 = 5.0;
/// A region needs this lead over other orders, nats a path; then the variance of its z may be 1, that of a normal error, and
/// 1 more for every so many nats beyond, up to a bound: a region apart from the others may be off by an error of the drift.
const MIN_LEAD_NATS: f32 = 3.1;
const LEAD_NATS_PER_VARIANCE: f32 = 2.5;
const MAX_VARIANCE: f32 = 3.5;
/// Median of the square of a normal number of variance 1.
const MEDIAN_SQUARE: f32 = 0.455;
/// Lead, nats a path, by which a region is better founded than another. One surface that hides another has about its lead.
const BETTER_FOUNDED_NATS: f32 = 3.0;
/// Share of a region's places that better founded ones may take.
const MAX_LOST_SHARE: f64 = 0.3;

/// Decides about every pixel; `passing` is how many orders of each pixel pass the back-projection test.
pub(super) fn verify(
    scene: &Scene<'_>,
    selected: &[Option<Selected>],
    verdicts: &[Verdict],
    passing: Vec<u8>,
    limits: &Limits,
) -> (Decisions, Vec<Grounds>) {
    let regions = Regions::of(scene.cam1, selected, MAX_Z_STEP);
    let leads_nats: Vec<f32> = regions.iter().map(|region| lead_nats(region, verdicts)).collect();
    let mut verification =
        Verification { scene, standing: selected.to_vec(), outcomes: vec![Outcome::NoCandidate; selected.len()] };
    verification.judge_regions(&regions, &leads_nats, limits.min_region_px);
    let places = Places::of(scene.table, |pixel| selected[pixel].map(|s| s.candidate.column_px));
    verification.contradict_by_foundation(&places, &regions, &leads_nats);
    let grounds = gather(scene, selected, &verification.standing, &places, verdicts, &regions, &leads_nats);
    let confidence = confidences(selected, &grounds);
    verification.stand_by_confidence(selected, &grounds, &confidence, limits.min_confidence);
    verification.drop_small_regions(limits.min_region_px);
    (verification.finish(passing, confidence), grounds)
}

struct Verification<'a> {
    scene: &'a Scene<'a>,
    /// Those that stay so far.
    standing: Vec<Option<Selected>>,
    outcomes: Vec<Outcome>,
}

impl Verification<'_> {
    fn judge_regions(&mut self, regions: &Regions, leads_nats: &[f32], min_region_px: u32) {
        for (region, &lead_nats) in regions.iter().zip(leads_nats) {
            let outcome = if region.len() < min_region_px as usize {
                Some(Outcome::Ambiguous)
            } else {
                judge(region, &self.standing, lead_nats)
            };
            if let Some(outcome) = outcome {
                self.drop_all(region, outcome);
            }
        }
    }

    fn drop_all(&mut self, pixels: &[u32], outcome: Outcome) {
        for &pixel in pixels {
            self.drop(pixel as usize, outcome);
        }
    }

    fn drop(&mut self, pixel: usize, outcome: Outcome) {
        self.standing[pixel] = None;
        self.outcomes[pixel] = outcome;
    }

    /// Drops regions of which a good part claims places of C2 that regions with a greater lead claim for other orders.
    fn contradict_by_foundation(&mut self, places: &Places, regions: &Regions, leads_nats: &[f32]) {
        let mut of_pixels_nats = vec![0.0; self.standing.len()];
        for (region, &lead_nats) in regions.iter().zip(leads_nats) {
            region.iter().for_each(|&pixel| of_pixels_nats[pixel as usize] = lead_nats);
        }
        let claims =
            Claims::new(self.scene, places, &self.standing, |pixel| of_pixels_nats[pixel], BETTER_FOUNDED_NATS);
        let is_lost = |&&pixel: &&u32| {
            let pixel = pixel as usize;
            self.standing[pixel].is_some_and(|standing| claims.is_lost(pixel, &standing))
        };
        let loses_much =
            |region: &&[u32]| region.iter().filter(is_lost).count() as f64 > MAX_LOST_SHARE * region.len() as f64;
        let fallen: Vec<&[u32]> = regions.iter().filter(loses_much).collect();
        fallen.into_iter().for_each(|region| self.drop_all(region, Outcome::Contradicted));
    }

    /// Lets every selected candidate stand that is confident enough, and no other.
    fn stand_by_confidence(
        &mut self,
        selected: &[Option<Selected>],
        grounds: &[Grounds],
        confidence: &[Confidence],
        min_confidence: f32,
    ) {
        let least = Confidence::at_least(min_confidence);
        for (pixel, selected) in selected.iter().enumerate() {
            let Some(candidate) = selected else { continue };
            if confidence[pixel] >= least {
                self.standing[pixel] = *selected;
            } else if self.standing[pixel].is_some() {
                self.drop(pixel, reason(candidate, &grounds[pixel]));
            }
        }
    }

    fn drop_small_regions(&mut self, min_region_px: u32) {
        for region in Regions::of(self.scene.cam1, &self.standing, f32::INFINITY).iter() {
            if region.len() < min_region_px as usize {
                self.drop_all(region, Outcome::Ambiguous);
            }
        }
    }

    fn finish(mut self, passing: Vec<u8>, mut confidence: Vec<Confidence>) -> Decisions {
        let mut chosen: Vec<Option<Candidate>> = vec![None; self.standing.len()];
        for (pixel, standing) in self.standing.iter().enumerate() {
            if let Some(standing) = standing {
                self.outcomes[pixel] = match (standing.in_volume, passing[pixel]) {
                    (false, _) => Outcome::OutsideVolume,
                    (true, 1) if standing.z.abs() < PASSING_Z => Outcome::Reference,
                    (true, 0 | 1) => Outcome::Unique,
                    (true, _) => Outcome::AcrossEpipolar,
                };
                chosen[pixel] = standing.in_volume.then_some(standing.candidate);
            }
            if chosen[pixel].is_none() {
                confidence[pixel] = Confidence::NONE;
            }
        }
        Decisions { outcomes: self.outcomes, chosen, passing, confidence }
    }
}

/// Why a candidate of a region that stands does not.
fn reason(selected: &Selected, grounds: &Grounds) -> Outcome {
    if grounds.is_hidden {
        Outcome::Contradicted
    } else if selected.z.abs() >= PASSING_Z {
        Outcome::RejectedByDelta
    } else {
        Outcome::Ambiguous
    }
}

/// Why a region does not stand; `None` if it does.
fn judge(region: &[u32], selected: &[Option<Selected>], lead_nats: f32) -> Option<Outcome> {
    if lead_nats < MIN_LEAD_NATS {
        return Some(Outcome::Ambiguous);
    }
    // The median: of a small region half the pixels lie at its border.
    let mut squares: Vec<f32> =
        region.iter().filter_map(|&pixel| selected[pixel as usize]).map(|s| s.z * s.z).collect();
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f32::total_cmp);
    let allowed = (1.0 + (lead_nats - MIN_LEAD_NATS) / LEAD_NATS_PER_VARIANCE).min(MAX_VARIANCE);
    (*median / MEDIAN_SQUARE > allowed).then_some(Outcome::RejectedByDelta)
}

/// Mean lead of the decided orders of a region over the next best ones, nats a path.
fn lead_nats(region: &[u32], verdicts: &[Verdict]) -> f32 {
    let margins: u64 = region.iter().map(|&pixel| u64::from(verdicts[pixel as usize].margin)).sum();
    (margins as f64 / region.len() as f64) as f32 / (PATHS as f32 * UNITS_PER_NAT)
}
