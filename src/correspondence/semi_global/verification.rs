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

use rayon::prelude::*;

use super::super::candidates::Candidate;
use super::super::outcome::Outcome;
use super::claims::{Claim, Claims};
use super::confidence::{Confidence, GroundsRow, OfRegion, RegionOdds, Tables, confidences, margin_nats};
use super::evidence::PASSING_Z;
use super::grounds::{Grounds, Surroundings};
use super::paths::{PATHS, Verdicts};
use super::regions::{Regions, Run};
use super::selection::{ABSENT, Selection};
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

/// Room for what is known of each pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct VerificationRoom {
    claims: Claims,
    surroundings: Surroundings,
    /// Pixels beside and around each pixel that support it.
    beside: Vec<u8>,
    around: Vec<u8>,
    is_hidden: Vec<bool>,
}

/// Decides about every pixel, of which it is known how many orders pass the back-projection test. Selected candidates that do
/// not stay become absent. The grounds go where they are asked for.
pub(super) fn verify(
    scene: &Scene<'_>,
    selection: &mut Selection,
    verdicts: &Verdicts,
    limits: &Limits,
    room: &mut VerificationRoom,
    decisions: &mut Decisions<'_>,
    grounds: Option<&mut Vec<Grounds>>,
) {
    let width = scene.cam1.width.max(1);
    let regions = Regions::of(width, &selection.absolute, &selection.z, MAX_Z_STEP);
    let mut verification = Verification { scene, width, selection, verdicts, limits, regions: &regions };
    let leads_nats = verification.leads_nats();
    let mut verdict_of_region = verification.judge_regions(&leads_nats);
    verification.contradict_by_foundation(&leads_nats, &mut verdict_of_region, &mut room.claims);
    verification.look_around(&verdict_of_region, room);
    let of_regions = verification.of_regions(&leads_nats, room);
    verification.state_confidence(&of_regions, room, decisions.confidence);
    if let Some(grounds) = grounds {
        *grounds = verification.grounds(&of_regions, room);
    }
    verification.stand_by_confidence(&verdict_of_region, room, decisions);
    verification.drop_small_regions(decisions.outcomes);
    verification.finish(decisions);
}

struct Verification<'a> {
    scene: &'a Scene<'a>,
    width: usize,
    selection: &'a mut Selection,
    verdicts: &'a Verdicts,
    limits: &'a Limits,
    regions: &'a Regions,
}

impl Verification<'_> {
    /// Mean lead of the decided orders of each region over the next best ones, nats a path.
    fn leads_nats(&self) -> Vec<f32> {
        let margins =
            self.regions.sums(|run| self.verdicts.margin[run.pixels()].iter().map(|&margin| u64::from(margin)).sum());
        let of_region = |(margins, &size_px): (u64, &u32)| {
            (margins as f64 / f64::from(size_px)) as f32 / (PATHS as f32 * UNITS_PER_NAT)
        };
        margins.into_iter().zip(&self.regions.size_px).map(of_region).collect()
    }

    /// Why each region does not stand; `None` if it does.
    fn judge_regions(&self, leads_nats: &[f32]) -> Vec<Option<Outcome>> {
        // Half of the squares of z must be small, and one more of an even number: the median is that of the greater half.
        let allowed = |run: &Run| {
            let lead_nats = leads_nats[run.region as usize];
            (1.0 + (lead_nats - MIN_LEAD_NATS) / LEAD_NATS_PER_VARIANCE).min(MAX_VARIANCE)
        };
        let large = self.regions.sums(|run| {
            let allowed = allowed(run);
            self.selection.z[run.pixels()].iter().map(|z| u64::from(z * z / MEDIAN_SQUARE > allowed)).sum()
        });
        let judge = |((&size_px, &lead_nats), large): ((&u32, &f32), u64)| {
            if size_px < self.limits.min_region_px || lead_nats < MIN_LEAD_NATS {
                return Some(Outcome::Ambiguous);
            }
            let small = u64::from(size_px) - large;
            (small <= u64::from(size_px) / 2).then_some(Outcome::RejectedByDelta)
        };
        self.regions.size_px.iter().zip(leads_nats).zip(large).map(judge).collect()
    }

    /// The claim of a pixel with a precedence.
    #[inline(always)]
    fn claim(&self, pixel: usize, precedence: f32) -> Claim {
        Claim { place: self.selection.places.of_pixels[pixel], precedence, absolute: self.selection.absolute[pixel] }
    }

    /// Drops regions of which a good part claims places of C2 that regions with a greater lead claim for other orders.
    fn contradict_by_foundation(
        &self,
        leads_nats: &[f32],
        verdict_of_region: &mut [Option<Outcome>],
        claims: &mut Claims,
    ) {
        let standing =
            || leads_nats.iter().zip(&*verdict_of_region).filter(|(_, v)| v.is_none()).map(|(lead, _)| *lead);
        let (least, greatest) =
            (standing().fold(f32::INFINITY, f32::min), standing().fold(f32::NEG_INFINITY, f32::max));
        // Regions that take no place of any other need not claim theirs.
        let takes = |lead_nats: f32| lead_nats > least + BETTER_FOUNDED_NATS;
        let loses = |lead_nats: f32| greatest > lead_nats + BETTER_FOUNDED_NATS;
        if !takes(greatest) {
            return;
        }
        claims.clear(self.scene.table.epipolar_size_px().iter().product());
        for run in &self.regions.runs {
            let lead_nats = leads_nats[run.region as usize];
            if verdict_of_region[run.region as usize].is_none() && takes(lead_nats) {
                run.pixels().for_each(|pixel| claims.make(self.claim(pixel, lead_nats)));
            }
        }
        let lost = self.regions.sums(|run| {
            let lead_nats = leads_nats[run.region as usize];
            if verdict_of_region[run.region as usize].is_some() || !loses(lead_nats) {
                return 0;
            }
            let is_lost = |&pixel: &usize| claims.is_lost(self.claim(pixel, lead_nats), BETTER_FOUNDED_NATS);
            run.pixels().filter(is_lost).count() as u64
        });
        for ((verdict, lost), &size_px) in verdict_of_region.iter_mut().zip(lost).zip(&self.regions.size_px) {
            if verdict.is_none() && lost as f64 > MAX_LOST_SHARE * f64::from(size_px) {
                *verdict = Some(Outcome::Contradicted);
            }
        }
    }

    /// Finds for each pixel which others support it, and whether one nearer to C2 has its place.
    fn look_around(&self, verdict_of_region: &[Option<Outcome>], room: &mut VerificationRoom) {
        let VerificationRoom { claims, surroundings, beside, around, is_hidden } = room;
        let (width, absolute) = (self.width, &self.selection.absolute);
        let stands = |run: &&Run| verdict_of_region[run.region as usize].is_none();
        surroundings.fill([width, absolute.len() / width], |v, row| {
            for run in self.regions.of_row(v).iter().filter(stands) {
                let pixels = run.pixels();
                row[pixels.start - v * width..pixels.end - v * width].copy_from_slice(&absolute[pixels]);
            }
        });
        claims.clear(self.scene.table.epipolar_size_px().iter().product());
        for run in self.regions.runs.iter().filter(stands) {
            run.pixels().for_each(|pixel| claims.make(self.claim(pixel, self.selection.places.nearness[pixel])));
        }
        beside.resize(absolute.len(), 0);
        around.resize(absolute.len(), 0);
        is_hidden.resize(absolute.len(), false);
        let rows = beside.par_chunks_mut(width).zip(around.par_chunks_mut(width)).zip(is_hidden.par_chunks_mut(width));
        rows.enumerate().for_each(|(v, ((beside, around), is_hidden))| {
            surroundings.support(v, &absolute[v * width..(v + 1) * width], beside, around);
            for pixel in self.regions.of_row(v).iter().flat_map(Run::pixels) {
                let claim = self.claim(pixel, self.selection.places.nearness[pixel]);
                is_hidden[pixel - v * width] = claims.is_lost(claim, 0.0);
            }
        });
    }

    /// What each region says of its pixels.
    fn of_regions(&self, leads_nats: &[f32], room: &VerificationRoom) -> Vec<OfRegion> {
        let hidden =
            self.regions.sums(|run| room.is_hidden[run.pixels()].iter().map(|&is_hidden| u64::from(is_hidden)).sum());
        let of_region = |((&region_px, &lead_nats), hidden): ((&u32, &f32), u64)| OfRegion {
            region_px,
            lead_nats,
            hidden_share: hidden as f32 / region_px as f32,
        };
        self.regions.size_px.iter().zip(leads_nats).zip(hidden).map(of_region).collect()
    }

    /// How likely each selected candidate is true.
    fn state_confidence(&self, of_regions: &[OfRegion], room: &VerificationRoom, confidence: &mut Vec<Confidence>) {
        let (tables, width) = (Tables::new(), self.width);
        let odds: Vec<RegionOdds> = of_regions.iter().map(|&of_region| tables.of_region(of_region)).collect();
        confidence.resize(self.selection.absolute.len(), Confidence::NONE);
        let rows = confidence.par_chunks_mut(width).enumerate();
        rows.for_each_init(
            || ([const { Vec::new() }; 3], Vec::new()),
            |(of_regions, log_odds), (v, confidence)| {
                for (i, of_pixels) in of_regions.iter_mut().enumerate() {
                    of_pixels.resize(width, 0.0);
                    for run in self.regions.of_row(v) {
                        let columns = run.pixels().start - v * width..run.pixels().end - v * width;
                        of_pixels[columns].fill(odds[run.region as usize][i]);
                    }
                }
                let pixels = v * width..(v + 1) * width;
                let row = GroundsRow {
                    margin: &self.verdicts.margin[pixels.clone()],
                    z: &self.selection.z[pixels.clone()],
                    beside: &room.beside[pixels.clone()],
                    around: &room.around[pixels.clone()],
                    is_hidden: &room.is_hidden[pixels],
                    of_regions: of_regions.each_ref().map(Vec::as_slice),
                };
                confidences(&tables, &row, log_odds, confidence);
            },
        );
    }

    /// The grounds of every pixel with a selected candidate.
    fn grounds(&self, of_regions: &[OfRegion], room: &VerificationRoom) -> Vec<Grounds> {
        let mut grounds = vec![Grounds::default(); self.selection.absolute.len()];
        for run in &self.regions.runs {
            let OfRegion { region_px, lead_nats, hidden_share } = of_regions[run.region as usize];
            for pixel in run.pixels() {
                grounds[pixel] = Grounds {
                    margin_nats: margin_nats(self.verdicts.margin[pixel]),
                    abs_z: self.selection.z[pixel].abs(),
                    region_px,
                    region_lead_nats: lead_nats,
                    beside: room.beside[pixel],
                    around: room.around[pixel],
                    is_hidden: room.is_hidden[pixel],
                    hidden_share,
                };
            }
        }
        grounds
    }

    /// Lets every selected candidate stand that is confident enough, and no other.
    fn stand_by_confidence(
        &mut self,
        verdict_of_region: &[Option<Outcome>],
        room: &VerificationRoom,
        decisions: &mut Decisions<'_>,
    ) {
        let least = Confidence::at_least(self.limits.min_confidence);
        let (width, regions) = (self.width, self.regions);
        let Selection { absolute, z, .. } = &mut *self.selection;
        decisions.outcomes.resize(absolute.len(), Outcome::NoCandidate);
        let rows = absolute.par_chunks_mut(width).zip(z.par_chunks(width)).zip(room.is_hidden.par_chunks(width));
        let decided = decisions.outcomes.par_chunks_mut(width).zip(decisions.confidence.par_chunks(width));
        rows.zip(decided).enumerate().for_each(|(v, (((absolute, z), is_hidden), (outcomes, confidence)))| {
            outcomes.fill(Outcome::NoCandidate);
            for run in regions.of_row(v) {
                let verdict = verdict_of_region[run.region as usize];
                for u in run.pixels().start - v * width..run.pixels().end - v * width {
                    if confidence[u] < least {
                        outcomes[u] = verdict.unwrap_or_else(|| reason(is_hidden[u], z[u]));
                        absolute[u] = ABSENT;
                    }
                }
            }
        });
    }

    fn drop_small_regions(&mut self, outcomes: &mut [Outcome]) {
        let Selection { absolute, z, .. } = &mut *self.selection;
        let regions = Regions::of(self.width, absolute, z, f32::INFINITY);
        for run in &regions.runs {
            if regions.size_px[run.region as usize] < self.limits.min_region_px {
                outcomes[run.pixels()].fill(Outcome::Ambiguous);
                absolute[run.pixels()].fill(ABSENT);
            }
        }
    }

    fn finish(&self, decisions: &mut Decisions<'_>) {
        let width = self.width;
        let Decisions { outcomes, chosen, passing, confidence } = decisions;
        chosen.resize(outcomes.len());
        let rows = outcomes.par_chunks_mut(width).zip(chosen.rows_mut(width)).zip(confidence.par_chunks_mut(width));
        rows.enumerate().for_each(|(v, ((outcomes, mut chosen), confidence))| {
            for u in 0..outcomes.len() {
                let pixel = v * width + u;
                if self.selection.absolute[pixel] == ABSENT {
                    confidence[u] = Confidence::NONE;
                    chosen.set(u, None);
                    continue;
                }
                outcomes[u] = match (self.selection.in_volume[pixel], passing[pixel]) {
                    (false, _) => Outcome::OutsideVolume,
                    (true, 1) if self.selection.z[pixel].abs() < PASSING_Z => Outcome::Reference,
                    (true, 0 | 1) => Outcome::Unique,
                    (true, _) => Outcome::AcrossEpipolar,
                };
                let is_in_volume = self.selection.in_volume[pixel];
                chosen.set(u, is_in_volume.then(|| self.candidate(pixel)));
                if !is_in_volume {
                    confidence[u] = Confidence::NONE;
                }
            }
        });
    }

    fn candidate(&self, pixel: usize) -> Candidate {
        self.selection.candidate(pixel, self.verdicts.order[pixel])
    }
}

/// Why a candidate of a region that stands does not.
fn reason(is_hidden: bool, z: f32) -> Outcome {
    if is_hidden {
        Outcome::Contradicted
    } else if z.abs() >= PASSING_Z {
        Outcome::RejectedByDelta
    } else {
        Outcome::Ambiguous
    }
}
