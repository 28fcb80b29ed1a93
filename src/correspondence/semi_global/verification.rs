//! Decides which of the selected candidates stay.
//!
//! ```text
//! divide the selected candidates into regions of continuous absolute phase and z
//! for each region: lead = mean excess of the next best orders; strip = δ runs through it
//! a region stands if it is large, leads clearly, and z scatters like a normal error; a very clear lead is enough
//! a region falls if a good part of its places in C2 serve other orders of better founded regions
//! for each pixel, among the regions that stand:
//!     support = neighbours within 1 and 3 pixels whose absolute phases continue that of the pixel
//!     hidden = a point nearer to C2 has its place there with another order
//!     confidence = model(margin, z, support, hidden; size, lead and hidden share of its region)
//! keep a pixel if it is confident enough, and no strip in the volume; drop small regions of the remaining pixels
//! ```
//!
//! Why each step:
//!
//! - In a region of true candidates z scatters like a normal error, and every pixel stands out against the other
//!   orders. In a region whose true candidates are missing, hidden from C2 or outside the search, δ takes any value,
//!   and another order would fit nearly as well.
//! - A region through which δ runs, rather than scatters about zero, is a *strip* of a surface that lies elsewhere.
//! - One place of C2 serves one order (paper, 2.2.3). A region that loses a good part of its places to better founded
//!   ones is wrong: C2 sees the others there.
//! - The regions that stand are the ground on which each pixel is judged (*grounds*, *confidence*), including pixels of
//!   other regions: at borders true candidates err by more than noise and fall out of their regions.

use rayon::prelude::*;

use fringeflow_base::outcome::Outcome;

use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::chosen::ChosenCandidates;
use crate::correspondence::claims::{Claim, Claims};
use crate::correspondence::neighbourhood::ABSENT;
use crate::correspondence::regions::Regions;
use crate::correspondence::scene::Scene;
use crate::correspondence::surfaces;
use crate::phase::PhaseMap;

use super::confidence::{Confidence, GroundsRow, RegionGrounds, TABLES, confidences, margin_nats};
use super::cost_table::{PASSING_Z, UNITS_PER_NAT};
use super::grounds::{Grounds, Surroundings};
use super::paths::{PATHS, PathOrders};
use super::selection::Selection;
use super::strips::Strips;
use crate::correspondence::runs::Run;

/// Largest difference of z between neighbours in one region.
const MAX_Z_STEP: f32 = 5.0;
/// Least lead of a region over other orders, nats per path. The variance of its z may then be 1, that of a normal
/// error, and 1 more for every [`LEAD_NATS_PER_VARIANCE`] beyond, up to a bound. A surface apart from the others may
/// have an error that no drift models. The more images a phase has, the more this error exceeds noise: variances of 4.0
/// to 4.5 were measured. A part of a board, found at a wrong place within the volume, had 4.95.
const MIN_LEAD_NATS: f32 = 3.1;
const LEAD_NATS_PER_VARIANCE: f32 = 2.0;
const MAX_VARIANCE: f32 = 4.5;
/// With this lead the variance of z may be larger, and the region is no strip: motion moves δ by more than noise, above
/// all on small bodies. Measured over boards, gratings and bodies at rest and up to 0.5 mm per image: right regions
/// with variances up to 8 have at least 8.6 nats per path. The lead alone is not enough: a strip of a board 40 mm
/// behind the volume leads by 11, with a variance of 4.7, and is as large as the body before it. So the region must be
/// small compared with the regions that δ supports, and its variance is bounded. Where the phase moves far during the
/// window, δ supports few regions, and the lead alone decides.
const SURE_LEAD_NATS: f32 = 8.5;
const SURE_VARIANCE: f32 = 12.0;
const SURE_MOTION_RAD: f32 = 1.5;
const SURE_SHARE: f64 = 0.2;
/// Phase that a scene at rest seems to move during a window, rad, by noise.
const MOST_AT_REST_RAD: f32 = 0.25;
/// Handicap of such a region: every region that δ supports takes its places in C2.
const UNSUPPORTED_NATS: f32 = 20.0;
/// Median of the square of a normal number of variance 1.
const MEDIAN_SQUARE: f32 = 0.455;
/// Lead, nats per path, by which a region is better founded than another. A surface and the one that it hides have
/// similar leads.
const BETTER_FOUNDED_NATS: f32 = 3.0;
/// Reduction of the logarithm of the odds of every point if the drift explains few pixels of the image: the curves were
/// fitted where it explains most.
const DOUBT_NATS: f32 = 0.6;
/// Share of its places that a region may lose to better founded ones.
const MAX_LOST_SHARE: f64 = 0.3;

/// Decisions about all pixels of C1, row by row. The old contents of the vectors do not matter.
pub(in crate::correspondence) struct Decisions<'a> {
    pub(in crate::correspondence) outcomes: &'a mut Vec<Outcome>,
    pub(in crate::correspondence) chosen: &'a mut ChosenCandidates,
    /// Orders of each pixel that pass the back-projection test about the drift.
    pub(in crate::correspondence) passing: &'a mut Vec<u8>,
    /// Probability that each point is true.
    pub(in crate::correspondence) confidence: &'a mut Vec<Confidence>,
}

/// Limits that a point must reach.
pub(in crate::correspondence) struct Limits {
    /// Pixels of a region of continuous absolute phase.
    pub(in crate::correspondence) min_region_px: u32,
    /// Probability of being true.
    pub(in crate::correspondence) min_confidence: f32,
}

/// Scratch memory for the verification.
#[derive(Clone, Debug, Default)]
pub(super) struct VerificationScratch {
    regions: Regions,
    per_region: RegionScratch,
    strips: Strips,
    claims: Claims,
    surroundings: Surroundings,
    /// Support of each pixel, near and wide.
    near_support: Vec<u8>,
    wide_support: Vec<u8>,
    is_hidden: Vec<bool>,
    scratches: Vec<ConfidenceScratch>,
    /// Regions of the pixels that remain.
    remaining: Regions,
}

/// Quantities of each region.
#[derive(Clone, Debug, Default)]
struct RegionScratch {
    /// Mean lead of the decided orders over the next best ones, nats per path.
    leads_nats: Vec<f32>,
    /// Mean lead, with a handicap for regions that δ does not support.
    foundations_nats: Vec<f32>,
    /// Why it does not stand; `None` if it does.
    verdicts: Vec<Option<Outcome>>,
    grounds: Vec<RegionGrounds>,
    /// Contribution to the logarithm of the odds of its pixels.
    log_odds: Vec<f32>,
    sums: Vec<u64>,
}

/// Scratch for the confidences of a row.
#[derive(Clone, Debug, Default)]
struct ConfidenceScratch {
    region_log_odds: Vec<f32>,
    log_odds: Vec<f32>,
}

/// Inputs of the verification besides scene and selection.
pub(super) struct VerificationInput<'a> {
    pub(super) path_orders: &'a PathOrders,
    /// Where the wrapped phase continues.
    pub(super) surfaces: &'a surfaces::Scratch,
}

/// Decides every pixel. Rejected candidates become absent. Also writes the grounds, if a vector is given.
pub(super) fn verify(
    scene: &Scene<'_>,
    selection: &mut Selection,
    &VerificationInput { path_orders, surfaces }: &VerificationInput<'_>,
    limits: &Limits,
    scratch: &mut VerificationScratch,
    decisions: &mut Decisions<'_>,
    grounds: Option<&mut Vec<Grounds>>,
) {
    let width = scene.view.cam1.width.max(1);
    scratch.regions.find(width, &selection.absolute, &selection.z, MAX_Z_STEP);
    let mut verification = Verification { scene, width, selection, path_orders, limits };
    verification.measure_regions(scratch, surfaces);
    // Regions first: single pixels are judged by the regions around them that stand.
    verification.judge_regions(scratch);
    verification.contradict_by_foundation(scratch);
    verification.find_support(scratch);
    verification.gather_region_grounds(scratch);
    verification.compute_confidence(scratch, decisions.confidence);
    if let Some(grounds) = grounds {
        *grounds = verification.grounds(scratch);
    }
    verification.keep_confident(scratch, decisions);
    verification.drop_small_regions(&mut scratch.remaining, decisions.outcomes);
    verification.finish(decisions);
}

/// Phase that moves during a whole window, rad; one pixel in twenty exceeds it. 0 where it was not measured.
fn moved_rad(cam1: &PhaseMap) -> f32 {
    // The gain of N evenly spaced images is √(2/N).
    let images = 2.0 / (cam1.fit.noise_gain * cam1.fit.noise_gain);
    cam1.motion.map_or(0.0, |motion| motion.fast_rad * images)
}

struct Verification<'a> {
    scene: &'a Scene<'a>,
    width: usize,
    selection: &'a mut Selection,
    path_orders: &'a PathOrders,
    limits: &'a Limits,
}

impl Verification<'_> {
    /// Finds the lead of each region, and the strips.
    fn measure_regions(&self, scratch: &mut VerificationScratch, surfaces: &surfaces::Scratch) {
        let VerificationScratch { regions, per_region, strips, .. } = scratch;
        let (regions, z) = (&*regions, &self.selection.z);
        let at_rest = moved_rad(self.scene.view.cam1) <= MOST_AT_REST_RAD;
        rayon::join(|| self.find_leads(regions, per_region), || strips.find(self.width, regions, z, surfaces, at_rest));
    }

    fn find_leads(&self, regions: &Regions, per_region: &mut RegionScratch) {
        let RegionScratch { leads_nats, sums, .. } = per_region;
        regions.sum(sums, |run| self.path_orders.margin[run.pixels()].iter().map(|&margin| u64::from(margin)).sum());
        let of_region = |(&margins, &size_px): (&u64, &u32)| {
            (margins as f64 / f64::from(size_px)) as f32 / (PATHS as f32 * UNITS_PER_NAT)
        };
        leads_nats.clear();
        leads_nats.extend(sums.iter().zip(&regions.size_px).map(of_region));
    }

    /// Decides which regions stand, by their lead and the scatter of z.
    fn judge_regions(&self, VerificationScratch { regions, per_region, strips, .. }: &mut VerificationScratch) {
        let RegionScratch { leads_nats, foundations_nats, verdicts, sums, .. } = per_region;
        // The median of z² must be below a limit, so more than half of the pixels must be. One sum per region holds two
        // counts: in its low 32 bits the pixels beyond the limit by the lead, in its high bits those beyond the limit
        // of sure regions.
        let allowed = |run: &Run| {
            let lead_nats = leads_nats[run.set as usize];
            (1.0 + (lead_nats - MIN_LEAD_NATS) / LEAD_NATS_PER_VARIANCE).min(MAX_VARIANCE)
        };
        regions.sum(sums, |run| {
            let allowed = allowed(run);
            let count_of = |z: &f32| {
                let square = z * z / MEDIAN_SQUARE;
                u64::from(square > allowed) | u64::from(square > SURE_VARIANCE) << 32
            };
            self.selection.z[run.pixels()].iter().map(count_of).sum()
        });
        verdicts.clear();
        foundations_nats.clear();
        let mostly_small = |size_px: u32, large: u64| u64::from(size_px) - large > u64::from(size_px) / 2;
        let is_supported =
            |size_px, large, is_strip: bool| !is_strip && mostly_small(size_px, large & u64::from(u32::MAX));
        let judged = || regions.size_px.iter().zip(&*sums).zip(&strips.is_strip);
        let supported_px: u64 = judged()
            .filter(|&((&size_px, &large), &is_strip)| is_supported(size_px, large, is_strip))
            .map(|((&size_px, _), _)| u64::from(size_px))
            .sum();
        let moves_far = moved_rad(self.scene.view.cam1) >= SURE_MOTION_RAD;
        for (((&size_px, &large), &is_strip), &lead_nats) in judged().zip(&*leads_nats) {
            let is_supported = is_supported(size_px, large, is_strip);
            let is_small = f64::from(size_px) <= SURE_SHARE * supported_px as f64;
            let is_sure = lead_nats >= SURE_LEAD_NATS && (moves_far || is_small && mostly_small(size_px, large >> 32));
            let is_clear = size_px >= self.limits.min_region_px && lead_nats >= MIN_LEAD_NATS;
            verdicts.push(match is_supported || is_sure {
                true if is_clear => None,
                false if is_clear || is_strip => Some(Outcome::RejectedByDelta),
                _ => Some(Outcome::Ambiguous),
            });
            foundations_nats.push(if is_supported { lead_nats } else { lead_nats - UNSUPPORTED_NATS });
        }
    }

    /// The claim of a pixel.
    #[inline(always)]
    fn claim(&self, pixel: usize, precedence: f32) -> Claim {
        Claim { place: self.selection.places.of_pixels[pixel], precedence, absolute: self.selection.absolute[pixel] }
    }

    /// Rejects regions that lose a good part of their places of C2 to better founded regions with other orders.
    fn contradict_by_foundation(
        &self,
        VerificationScratch { regions, per_region, claims, .. }: &mut VerificationScratch,
    ) {
        let RegionScratch { foundations_nats, verdicts, sums, .. } = per_region;
        let standing = || foundations_nats.iter().zip(&*verdicts).filter(|(_, v)| v.is_none()).map(|(nats, _)| *nats);
        // Most images hold regions of similar foundation. Then no place can change hands, and the claims are skipped.
        let (least, greatest) =
            (standing().fold(f32::INFINITY, f32::min), standing().fold(f32::NEG_INFINITY, f32::max));
        // Regions that can take no place of another need not claim theirs.
        let takes = |nats: f32| nats > least + BETTER_FOUNDED_NATS;
        let loses = |nats: f32| greatest > nats + BETTER_FOUNDED_NATS;
        if !takes(greatest) {
            return;
        }
        claims.clear(self.scene.view.table.epipolar_size_px().iter().product());
        for run in &regions.runs.all {
            let nats = foundations_nats[run.set as usize];
            if verdicts[run.set as usize].is_none() && takes(nats) {
                run.pixels().for_each(|pixel| claims.add(self.claim(pixel, nats)));
            }
        }
        regions.sum(sums, |run| {
            let nats = foundations_nats[run.set as usize];
            if verdicts[run.set as usize].is_some() || !loses(nats) {
                return 0;
            }
            let is_lost = |&pixel: &usize| claims.is_lost(self.claim(pixel, nats), BETTER_FOUNDED_NATS);
            run.pixels().filter(is_lost).count() as u64
        });
        for ((verdict, &lost), &size_px) in verdicts.iter_mut().zip(&*sums).zip(&regions.size_px) {
            if verdict.is_none() && lost as f64 > MAX_LOST_SHARE * f64::from(size_px) {
                *verdict = Some(Outcome::Contradicted);
            }
        }
    }

    /// Finds the support of each pixel, and whether a point nearer to C2 has its place.
    fn find_support(&self, scratch: &mut VerificationScratch) {
        let VerificationScratch {
            regions,
            per_region,
            claims,
            surroundings,
            near_support,
            wide_support,
            is_hidden,
            ..
        } = scratch;
        let (regions, width, absolute) = (&*regions, self.width, &self.selection.absolute);
        let stands = |run: &&Run| per_region.verdicts[run.set as usize].is_none();
        let fill = || {
            surroundings.fill([width, absolute.len() / width], |v, row| {
                for run in regions.runs.row(v).iter().filter(stands) {
                    let pixels = run.pixels();
                    row[pixels.start - v * width..pixels.end - v * width].copy_from_slice(&absolute[pixels]);
                }
            });
        };
        let claim = || {
            claims.clear(self.scene.view.table.epipolar_size_px().iter().product());
            for run in regions.runs.all.iter().filter(stands) {
                run.pixels().for_each(|pixel| claims.add(self.claim(pixel, self.selection.places.nearness[pixel])));
            }
        };
        rayon::join(claim, fill);
        near_support.resize(absolute.len(), 0);
        wide_support.resize(absolute.len(), 0);
        is_hidden.resize(absolute.len(), false);
        let rows = near_support
            .par_chunks_mut(width)
            .zip(wide_support.par_chunks_mut(width))
            .zip(is_hidden.par_chunks_mut(width));
        rows.enumerate().for_each(|(v, ((near_support, wide_support), is_hidden))| {
            // Outside its runs a row has no selected candidates, so support is counted within them alone.
            let columns = regions.columns_of_row(v, width);
            let own = &absolute[v * width..][columns.clone()];
            surroundings.support(v, columns.start, own, &mut near_support[columns.clone()], &mut wide_support[columns]);
            for pixel in regions.runs.row(v).iter().flat_map(Run::pixels) {
                let claim = self.claim(pixel, self.selection.places.nearness[pixel]);
                is_hidden[pixel - v * width] = claims.is_lost(claim, 0.0);
            }
        });
    }

    /// Computes the contribution of each region to the confidence of its pixels.
    fn gather_region_grounds(
        &self,
        VerificationScratch { regions, per_region, is_hidden, .. }: &mut VerificationScratch,
    ) {
        let RegionScratch { leads_nats, grounds, log_odds, sums, .. } = per_region;
        regions.sum(sums, |run| is_hidden[run.pixels()].iter().map(|&is_hidden| u64::from(is_hidden)).sum());
        let of_region = |((&region_px, &lead_nats), &hidden): ((&u32, &f32), &u64)| RegionGrounds {
            region_px,
            lead_nats,
            hidden_share: hidden as f32 / region_px as f32,
        };
        grounds.clear();
        grounds.extend(regions.size_px.iter().zip(&*leads_nats).zip(&*sums).map(of_region));
        log_odds.clear();
        let doubt_nats = if self.scene.drift.explains_most_pixels() { 0.0 } else { DOUBT_NATS };
        log_odds.extend(grounds.iter().map(|&of_region| TABLES.region_log_odds(of_region) - doubt_nats));
    }

    /// Computes the confidence of each selected candidate; undefined elsewhere.
    fn compute_confidence(&self, scratch: &mut VerificationScratch, confidence: &mut Vec<Confidence>) {
        let VerificationScratch { regions, per_region, near_support, wide_support, is_hidden, scratches, .. } = scratch;
        let (regions, per_region, width) = (&*regions, &*per_region, self.width);
        let pixels = self.selection.absolute.len();
        confidence.resize(pixels, Confidence::NONE);
        bands::resize(scratches, pixels / width);
        let bands = confidence.par_chunks_mut(BAND_ROWS * width).zip(scratches).enumerate();
        bands.for_each(|(band, (confidence, ConfidenceScratch { region_log_odds, log_odds }))| {
            for (i, confidence) in confidence.chunks_mut(width).enumerate() {
                let v = band * BAND_ROWS + i;
                let columns = regions.columns_of_row(v, width);
                let first = v * width + columns.start;
                region_log_odds.resize(width, 0.0);
                for run in regions.runs.row(v) {
                    let of_run = run.pixels().start - first..run.pixels().end - first;
                    region_log_odds[of_run].fill(per_region.log_odds[run.set as usize]);
                }
                let pixels = first..first + columns.len();
                let row = GroundsRow {
                    margin: &self.path_orders.margin[pixels.clone()],
                    z: &self.selection.z[pixels.clone()],
                    near_support: &near_support[pixels.clone()],
                    wide_support: &wide_support[pixels.clone()],
                    is_hidden: &is_hidden[pixels],
                    region_log_odds,
                };
                confidences(&TABLES, &row, log_odds, &mut confidence[columns]);
            }
        });
    }

    /// The grounds of every pixel with a selected candidate.
    fn grounds(&self, scratch: &VerificationScratch) -> Vec<Grounds> {
        let mut grounds = vec![Grounds::default(); self.selection.absolute.len()];
        for run in &scratch.regions.runs.all {
            let RegionGrounds { region_px, lead_nats, hidden_share } = scratch.per_region.grounds[run.set as usize];
            for pixel in run.pixels() {
                grounds[pixel] = Grounds {
                    margin_nats: margin_nats(self.path_orders.margin[pixel]),
                    abs_z: self.selection.z[pixel].abs(),
                    region_px,
                    region_lead_nats: lead_nats,
                    near_support: scratch.near_support[pixel],
                    wide_support: scratch.wide_support[pixel],
                    is_hidden: scratch.is_hidden[pixel],
                    hidden_share,
                };
            }
        }
        grounds
    }

    /// Keeps the selected candidates that are confident enough, and rejects all others.
    fn keep_confident(&mut self, scratch: &VerificationScratch, decisions: &mut Decisions<'_>) {
        let least = Confidence::at_least(self.limits.min_confidence);
        let (width, regions, verdicts) = (self.width, &scratch.regions, &scratch.per_region.verdicts);
        let Selection { absolute, z, in_volume, .. } = &mut *self.selection;
        decisions.outcomes.resize(absolute.len(), Outcome::NoCandidate);
        let rows = (
            absolute.par_chunks_mut(width),
            z.par_chunks(width),
            in_volume.par_chunks(width),
            scratch.is_hidden.par_chunks(width),
            decisions.outcomes.par_chunks_mut(width),
            decisions.confidence.par_chunks(width),
        );
        rows.into_par_iter().enumerate().for_each(|(v, (absolute, z, in_volume, is_hidden, outcomes, confidence))| {
            outcomes.fill(Outcome::NoCandidate);
            for run in regions.runs.row(v) {
                let (verdict, is_strip) = (verdicts[run.set as usize], scratch.strips.is_strip[run.set as usize]);
                for u in run.pixels().start - v * width..run.pixels().end - v * width {
                    // Beyond the volume the drift is not known, so δ may run there.
                    if confidence[u] < least || (is_strip && in_volume[u]) {
                        outcomes[u] = verdict.unwrap_or_else(|| rejection(is_hidden[u], z[u]));
                        absolute[u] = ABSENT;
                    }
                }
            }
        });
    }

    /// Rejects small regions among the pixels that remain.
    fn drop_small_regions(&mut self, regions: &mut Regions, outcomes: &mut [Outcome]) {
        let Selection { absolute, z, .. } = &mut *self.selection;
        regions.find(self.width, absolute, z, f32::INFINITY);
        for run in &regions.runs.all {
            if regions.size_px[run.set as usize] < self.limits.min_region_px {
                outcomes[run.pixels()].fill(Outcome::Ambiguous);
                absolute[run.pixels()].fill(ABSENT);
            }
        }
    }

    /// Writes the decisions.
    fn finish(&self, decisions: &mut Decisions<'_>) {
        let width = self.width;
        let Decisions { outcomes, chosen, passing, confidence } = decisions;
        chosen.resize(outcomes.len());
        let rows = outcomes.par_chunks_mut(width).zip(chosen.rows_mut(width)).zip(confidence.par_chunks_mut(width));
        rows.enumerate().for_each(|(v, ((outcomes, mut chosen), confidence))| {
            let pixels = v * width..(v + 1) * width;
            let selected = self.selection.row(pixels.clone());
            let (passing, order) = (&passing[pixels.clone()], &self.path_orders.order[pixels]);
            let (passing, order) = (&passing[..outcomes.len()], &order[..outcomes.len()]);
            let confidence = &mut confidence[..outcomes.len()];
            for u in 0..outcomes.len() {
                // A candidate beyond the volume explained its pixel, but is no point.
                let candidate = selected.candidate(u, order[u]).filter(|_| selected.in_volume[u]);
                confidence[u] = if candidate.is_some() { confidence[u] } else { Confidence::NONE };
                chosen.set(u, candidate);
                let found = match (selected.in_volume[u], passing[u]) {
                    (false, _) => Outcome::OutsideVolume,
                    (true, 1) if selected.z[u].abs() < PASSING_Z => Outcome::Reference,
                    (true, 0 | 1) => Outcome::Unique,
                    (true, _) => Outcome::AcrossEpipolar,
                };
                outcomes[u] = if selected.absolute[u] == ABSENT { outcomes[u] } else { found };
            }
        });
    }
}

/// Why a candidate of a region that stands is rejected.
fn rejection(is_hidden: bool, z: f32) -> Outcome {
    if is_hidden {
        Outcome::Contradicted
    } else if z.abs() >= PASSING_Z {
        Outcome::RejectedByDelta
    } else {
        Outcome::Ambiguous
    }
}
