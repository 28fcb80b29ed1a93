//! Which of the selected candidates stay.
//!
//! - A region of true candidates has z like a normal error, and every pixel of it stands out against the other orders. Over
//!   a region whose true candidates are missing, hidden from C2 or outside the search, δ of whatever was selected runs
//!   through anything, and another order would have done nearly as well.
//! - Pixels at borders err by more than the noise of the rest and fall out of their regions; they are readmitted beside
//!   those that stand.
//! - One place of C2 serves one order (paper, 2.2.3). A region that loses a good part of its places to better founded ones is
//!   wrong: where it lies, C2 sees them. Between regions that stand the point nearer to C2 hides the other.

use rayon::prelude::*;

use super::super::candidates::Candidate;
use super::super::neighbourhood::{MAX_STEP, TURN};
use super::super::outcome::Outcome;
use super::evidence::PASSING_Z;
use super::paths::{PATHS, Verdict};
use super::regions::{Regions, absolute};
use super::selection::Selected;
use super::{Scene, UNITS_PER_NAT};

/// Difference of z between neighbours of one region.
const MAX_Z_STEP: f32 = 5.0;
/// A region needs this lead over other orders, nats a path; then the variance of its z may be 1, that of a normal error, and
/// 1 more for every so many nats beyond, up to a bound: a region apart from the others may be off by an error of the drift.
const MIN_LEAD_NATS: f32 = 3.1;
const LEAD_NATS_PER_VARIANCE: f32 = 2.5;
const MAX_VARIANCE: f32 = 3.5;
/// Median of the square of a normal number of variance 1.
const MEDIAN_SQUARE: f32 = 0.455;
/// Neighbours, of eight, that readmit a pixel.
const MIN_SUPPORTERS: usize = 3;
/// Lead, nats a path, by which a region is better founded than another. One surface that hides another has about its lead.
const BETTER_FOUNDED_NATS: f32 = 3.0;
/// Share of a region's places that better founded ones may take.
const MAX_LOST_SHARE: f64 = 0.3;
/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// The outcome of every pixel and the candidate of those that found one; `passing` is how many orders of each pixel pass the
/// back-projection test.
pub(super) fn verify(
    scene: &Scene<'_>,
    selected: &[Option<Selected>],
    verdicts: &[Verdict],
    passing: &[u8],
    min_region_px: u32,
) -> (Vec<Outcome>, Vec<Option<Candidate>>) {
    let mut verification = Verification {
        scene,
        selected,
        standing: selected.to_vec(),
        outcomes: vec![Outcome::NoCandidate; selected.len()],
    };
    verification.judge_regions(verdicts, min_region_px);
    verification.readmit();
    verification.contradict_by_foundation(verdicts);
    verification.contradict_by_nearness();
    verification.drop_small_regions(min_region_px);
    verification.finish(passing)
}

struct Verification<'a> {
    scene: &'a Scene<'a>,
    selected: &'a [Option<Selected>],
    /// Those that stay so far.
    standing: Vec<Option<Selected>>,
    outcomes: Vec<Outcome>,
}

impl Verification<'_> {
    fn judge_regions(&mut self, verdicts: &[Verdict], min_region_px: u32) {
        for region in Regions::of(self.scene.cam1, &self.standing, MAX_Z_STEP).iter() {
            let outcome = if region.len() < min_region_px as usize {
                Outcome::Ambiguous
            } else {
                match judge(region, self.selected, verdicts) {
                    Some(outcome) => outcome,
                    None => continue,
                }
            };
            self.drop_all(region, outcome);
        }
    }

    fn drop_all(&mut self, pixels: &[u32], outcome: Outcome) {
        for &pixel in pixels {
            self.standing[pixel as usize] = None;
            self.outcomes[pixel as usize] = outcome;
        }
    }

    /// Readmits candidates that continue what stands around them.
    fn readmit(&mut self) {
        let (width, cam1) = (self.scene.cam1.width, self.scene.cam1);
        let supported = |&pixel: &u32| {
            let pixel = pixel as usize;
            let Some(candidate) = self.selected[pixel].filter(|_| self.standing[pixel].is_none()) else { return false };
            let supports = |&neighbour: &usize| {
                self.standing[neighbour].is_some_and(|standing| {
                    let step = absolute(cam1, neighbour, &standing) - absolute(cam1, pixel, &candidate);
                    step.abs() <= MAX_STEP
                })
            };
            around(pixel, width, self.standing.len()).filter(supports).count() >= MIN_SUPPORTERS
        };
        let readmitted: Vec<u32> = (0..self.standing.len() as u32).into_par_iter().filter(supported).collect();
        for pixel in readmitted {
            self.standing[pixel as usize] = self.selected[pixel as usize];
        }
    }

    /// Drops regions of which a good part claims places of C2 that regions with a greater lead claim for other orders.
    fn contradict_by_foundation(&mut self, verdicts: &[Verdict]) {
        let regions = Regions::of(self.scene.cam1, &self.standing, MAX_Z_STEP);
        let mut leads_nats = vec![0.0; self.standing.len()];
        for region in regions.iter() {
            let lead_nats = lead_nats(region, verdicts);
            region.iter().for_each(|&pixel| leads_nats[pixel as usize] = lead_nats);
        }
        let claims = Claims::new(self.scene, &self.standing, |pixel| leads_nats[pixel], BETTER_FOUNDED_NATS);
        let loses_much = |region: &&[u32]| {
            let lost = region.iter().filter(|&&pixel| claims.is_lost(pixel as usize)).count();
            lost as f64 > MAX_LOST_SHARE * region.len() as f64
        };
        let fallen: Vec<&[u32]> = regions.iter().filter(loses_much).collect();
        fallen.into_iter().for_each(|region| self.drop_all(region, Outcome::Contradicted));
    }

    /// Drops those whose place of C2 a point nearer to C2 takes for another order.
    fn contradict_by_nearness(&mut self) {
        let claims = Claims::new(self.scene, &self.standing, |pixel| self.scene.table.nearness_to_cam2(pixel), 0.0);
        let lost: Vec<u32> =
            (0..self.standing.len() as u32).into_par_iter().filter(|&p| claims.is_lost(p as usize)).collect();
        self.drop_all(&lost, Outcome::Contradicted);
    }

    fn drop_small_regions(&mut self, min_region_px: u32) {
        for region in Regions::of(self.scene.cam1, &self.standing, f32::INFINITY).iter() {
            if region.len() < min_region_px as usize {
                self.drop_all(region, Outcome::Ambiguous);
            }
        }
    }

    fn finish(mut self, passing: &[u8]) -> (Vec<Outcome>, Vec<Option<Candidate>>) {
        let mut chosen = vec![None; self.standing.len()];
        for (pixel, standing) in self.standing.iter().enumerate() {
            let Some(standing) = standing else { continue };
            self.outcomes[pixel] = match (standing.in_volume, passing[pixel]) {
                (false, _) => Outcome::OutsideVolume,
                (true, 1) if standing.z.abs() < PASSING_Z => Outcome::Reference,
                (true, 0 | 1) => Outcome::Unique,
                (true, _) => Outcome::AcrossEpipolar,
            };
            chosen[pixel] = standing.in_volume.then_some(standing.candidate);
        }
        (self.outcomes, chosen)
    }
}

/// Why a region does not stand; `None` if it does.
fn judge(region: &[u32], selected: &[Option<Selected>], verdicts: &[Verdict]) -> Option<Outcome> {
    let lead_nats = lead_nats(region, verdicts);
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

/// The eight neighbours of a pixel, as far as they lie in the image.
fn around(pixel: usize, width: usize, pixels: usize) -> impl Iterator<Item = usize> {
    let (u, v) = ((pixel % width) as isize, (pixel / width) as isize);
    let height = (pixels / width) as isize;
    (-1..=1).flat_map(move |dv| (-1..=1).map(move |du| (du, dv))).filter_map(move |(du, dv)| {
        let (x, y) = (u + du, v + dv);
        let inside = (du, dv) != (0, 0) && x >= 0 && y >= 0 && x < width as isize && y < height;
        inside.then(|| y as usize * width + x as usize)
    })
}

/// Who claims which place of C2, and with what precedence: the greater by more than a handicap takes it.
struct Claims<'a, P> {
    scene: &'a Scene<'a>,
    standing: &'a [Option<Selected>],
    precedence: P,
    handicap: f32,
    /// For each place of the epipolar frame the greatest precedence, and the absolute phase that has it.
    owners: Vec<(f32, i32)>,
    width: usize,
    height: usize,
}

impl<'a, P: Fn(usize) -> f32> Claims<'a, P> {
    fn new(scene: &'a Scene<'a>, standing: &'a [Option<Selected>], precedence: P, handicap: f32) -> Self {
        let [width, height] = scene.table.epipolar_size_px();
        let owners = vec![(f32::NEG_INFINITY, 0); width * height];
        let mut claims = Self { scene, standing, precedence, handicap, owners, width, height };
        for (pixel, selected) in standing.iter().enumerate() {
            let Some(selected) = selected else { continue };
            let place = claims.place(pixel, selected);
            let precedence = (claims.precedence)(pixel);
            if precedence > claims.owners[place].0 {
                claims.owners[place] = (precedence, absolute(scene.cam1, pixel, selected));
            }
        }
        claims
    }

    fn place(&self, pixel: usize, selected: &Selected) -> usize {
        let row = (self.scene.table.segments()[pixel].row_px + 0.5) as usize;
        let column = (selected.candidate.column_px + 0.5) as usize;
        row.min(self.height - 1) * self.width + column.min(self.width - 1)
    }

    /// Whether another order takes the place of a pixel.
    fn is_lost(&self, pixel: usize) -> bool {
        let Some(selected) = &self.standing[pixel] else { return false };
        let precedence = (self.precedence)(pixel);
        let own = absolute(self.scene.cam1, pixel, selected);
        let loses = |place: usize| {
            let owner = self.owners.get(place);
            owner.is_some_and(|&(greatest, other)| {
                greatest > precedence + self.handicap && (other - own).abs() > SAME_ORDER
            })
        };
        let place = self.place(pixel, selected);
        // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
        loses(place) || (loses(place.wrapping_sub(1)) && loses(place + 1))
    }
}
