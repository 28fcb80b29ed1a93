//! From candidates to unique correspondences (2.2).

mod neighbours;
mod places;
mod regions;

use fringeflow::correspondence::{EpipolarAxis, ResolutionSettings};

use super::candidates::{Candidate, Candidates};
use super::phase::Phases;
use super::{Limits, TURN, Tables};

use neighbours::{Rule, Votes};
use places::Precedence;
use regions::Regions;

/// A round that changes fewer than one pixel in so many is the last.
const SETTLED_SHARE: usize = 500;
/// Share of the widest δ beyond which one side alone does not admit a candidate.
const RIM_SHARE: f32 = 0.8;

/// The decisions about an image.
pub(super) struct Image<'a> {
    cam1: &'a Phases,
    candidates: &'a Candidates,
    tables: &'a Tables,
    limits: &'a Limits,
    settings: ResolutionSettings,
    width: usize,
    height: usize,
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
    /// Index of the candidate that each pixel was given.
    chosen: Vec<Option<usize>>,
    /// Absolute phase of the pixels that have one, turns · 65536.
    absolute: Vec<i32>,
    /// Bit k: candidate k was contradicted.
    excluded: Vec<u32>,
}

/// The candidate that each pixel was given.
pub(super) fn resolve(
    cam1: &Phases,
    candidates: &Candidates,
    tables: &Tables,
    limits: &Limits,
) -> Vec<Option<Candidate>> {
    let [width, height] = tables.size_px;
    let mut image = Image {
        cam1,
        candidates,
        tables,
        limits,
        settings: ResolutionSettings::default(),
        width,
        height,
        tolerance: limits.tolerance,
        chosen: vec![None; width * height],
        absolute: vec![0; width * height],
        excluded: vec![0; width * height],
    };
    image.resolve();
    (0..width * height).map(|pixel| image.candidate(pixel).copied()).collect()
}

impl Image<'_> {
    fn resolve(&mut self) {
        self.select_references();
        let strict = Rule::strict(self.settings.min_votes);
        let settled = |changed: usize| changed * SETTLED_SHARE < self.cam1.phase.len();
        for round in 0..self.settings.max_rounds {
            let decided = self.sweep_until_settled(false, strict) + self.sweep_until_settled(true, strict);
            if round > 0 && settled(decided) {
                break;
            }
            self.contradict_by_neighbours(strict);
            if settled(self.contradict_by_regions(Precedence::Foundation)) {
                break;
            }
        }
        self.excluded.fill(0);
        self.tolerance = TURN;
        self.sweep_until_settled(true, Rule::LENIENT);
        self.contradict_by_delta();
        self.contradict_by_regions(Precedence::Nearness);
        self.reject_rims();
    }

    /// The candidate that a pixel was given.
    fn candidate(&self, pixel: usize) -> Option<&Candidate> {
        Some(&self.candidates.of_pixel(pixel)[self.chosen[pixel]?])
    }

    /// δ of the candidate that a pixel was given; 0 without one.
    fn delta(&self, pixel: usize) -> i32 {
        self.candidate(pixel).map_or(0, |candidate| candidate.delta)
    }

    fn absolute_of(&self, pixel: usize, candidate: &Candidate) -> i32 {
        candidate.order * TURN + i32::from(self.cam1.phase[pixel])
    }

    fn decide(&mut self, pixel: usize, k: usize) {
        self.chosen[pixel] = Some(k);
        self.absolute[pixel] = self.absolute_of(pixel, &self.candidates.of_pixel(pixel)[k]);
    }

    /// Pixels of which one candidate passes the test, with neighbours that have one too and agree (2.2.1).
    fn select_references(&mut self) {
        for pixel in 0..self.chosen.len() {
            let passes = |&k: &usize| self.limits.passes(self.candidates.of_pixel(pixel)[k].delta);
            let mut passing = (0..self.candidates.of_pixel(pixel).len()).filter(passes);
            if let (Some(k), None) = (passing.next(), passing.next()) {
                self.decide(pixel, k);
            }
        }
        let lonely = self.unsupported(Rule::strict(self.settings.min_votes));
        lonely.into_iter().for_each(|pixel| self.chosen[pixel] = None);
    }

    /// Decided pixels that their neighbours do not support.
    fn unsupported(&self, rule: Rule) -> Vec<usize> {
        let is_lonely = |&pixel: &usize| {
            self.chosen[pixel].is_some() && {
                let votes = self.votes_near(pixel, self.absolute[pixel]);
                !rule.supports(&votes, self.delta(pixel), self.tolerance)
            }
        };
        (0..self.chosen.len()).filter(is_lonely).collect()
    }

    /// Decides what can be decided, until nothing changes; how many pixels were (2.2.2). A sweep sees what stood before it.
    fn sweep_until_settled(&mut self, also_across: bool, rule: Rule) -> usize {
        let mut all = 0;
        for _ in 0..self.settings.max_sweeps {
            let decisions: Vec<(usize, usize)> = (0..self.chosen.len())
                .filter(|&pixel| self.chosen[pixel].is_none() && !self.candidates.of_pixel(pixel).is_empty())
                .filter_map(|pixel| Some((pixel, self.choice(pixel, also_across, rule)?)))
                .collect();
            decisions.iter().for_each(|&(pixel, k)| self.decide(pixel, k));
            all += decisions.len();
            if decisions.is_empty() {
                break;
            }
        }
        all
    }

    /// The candidate that the decided pixels around decide for.
    fn choice(&self, pixel: usize, also_across: bool, rule: Rule) -> Option<usize> {
        let opinions = self.opinions(pixel, also_across);
        let (mut best, mut best_votes, mut all_votes): (Option<(usize, &Candidate)>, _, _) = (None, 0, 0);
        for (k, candidate) in self.candidates.of_pixel(pixel).iter().enumerate() {
            if k < 32 && self.excluded[pixel] >> k & 1 == 1 {
                continue;
            }
            let votes = opinions.votes(self.absolute_of(pixel, candidate)).with(candidate.delta, self.tolerance);
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some((k, candidate)), votes);
            }
        }
        let (k, candidate) = best?;
        let votes: Votes = opinions.votes(self.absolute_of(pixel, candidate));
        let leads = best_votes >= Rule::LEAD * (all_votes - best_votes);
        (leads && rule.supports(&votes, candidate.delta, self.tolerance)).then_some(k)
    }

    /// Takes back what its neighbours do not support any more (2.2.3).
    fn contradict_by_neighbours(&mut self, rule: Rule) {
        self.unsupported(rule).into_iter().for_each(|pixel| self.chosen[pixel] = None);
    }

    /// Takes back and excludes what whole regions contradict; how many pixels (2.2.3).
    fn contradict_by_regions(&mut self, precedence: Precedence) -> usize {
        let regions = Regions::of(self, self.tolerance);
        let level = regions.level(self);
        let is_large = |region: usize| regions.sizes[region] >= self.settings.min_region_px;
        let stands: Vec<bool> = level.into_iter().enumerate().map(|(r, is_level)| is_level && is_large(r)).collect();
        let contested = places::contested(self, &regions, stands, precedence);
        self.exclude(&contested)
    }

    /// Takes back and excludes regions whose δ is not level.
    fn contradict_by_delta(&mut self) {
        let regions = Regions::of(self, self.limits.tolerance);
        let level = regions.level(self);
        let falls = |pixel: &usize| regions.of_pixel(*pixel).is_some_and(|region| !level[region]);
        self.exclude(&(0..self.chosen.len()).filter(falls).collect::<Vec<_>>());
    }

    fn exclude(&mut self, pixels: &[usize]) -> usize {
        for &pixel in pixels {
            if let Some(k) = self.chosen[pixel].take() {
                self.excluded[pixel] |= 1_u32.checked_shl(k as u32).unwrap_or(0);
            }
        }
        pixels.len()
    }

    /// Rejects candidates far beyond the threshold that have support on one side only.
    fn reject_rims(&mut self) {
        let is_rim = |&pixel: &usize| {
            self.chosen[pixel].is_some()
                && !self.limits.is_within(RIM_SHARE * self.limits.readmission, self.delta(pixel))
                && self.supporting_sides(pixel) == 1
        };
        let rims: Vec<usize> = (0..self.chosen.len()).filter(is_rim).collect();
        rims.into_iter().for_each(|pixel| self.chosen[pixel] = None);
    }

    /// Whether the epipolar lines run along the rows of the image.
    fn is_along_rows(&self) -> bool {
        self.tables.axis == EpipolarAxis::Horizontal
    }
}
