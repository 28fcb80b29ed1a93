//! The candidates of all places, and which of them are still in question.

use super::super::candidates::Candidate;
use super::super::search::CandidateLists;
use super::decision::{Proposal, Tally};
use super::grid::Grid;

/// Candidates, those left out that were contradicted.
pub(super) struct Lists<'a> {
    candidates: &'a CandidateLists,
    grid: Grid,
    /// For each candidate of all pixels whether it was contradicted.
    excluded: Vec<bool>,
}

impl<'a> Lists<'a> {
    pub(super) fn new(candidates: &'a CandidateLists, grid: Grid) -> Self {
        Self { candidates, grid, excluded: vec![false; candidates.all().len()] }
    }

    /// Candidates of a place.
    #[inline]
    pub(super) fn of(&self, place: usize) -> &'a [Candidate] {
        self.candidates.of(self.grid.pixel(place))
    }

    /// Those of a place that were not contradicted, nothing said for them yet.
    #[inline]
    pub(super) fn eligible(&self, place: usize, to: &mut Vec<Proposal>) {
        let range = self.candidates.range(self.grid.pixel(place));
        let all = self.candidates.all()[range.clone()].iter().zip(&self.excluded[range]).enumerate();
        to.extend(all.filter(|(_, (_, excluded))| !**excluded).map(|(k, (candidate, _))| Proposal {
            k: k as u8,
            order: candidate.order,
            delta: candidate.delta,
            tally: Tally::default(),
        }));
    }

    /// Leaves a candidate out; whether others are left.
    pub(super) fn exclude(&mut self, place: usize, k: u8) -> bool {
        let range = self.candidates.range(self.grid.pixel(place));
        let excluded = &mut self.excluded[range];
        excluded[usize::from(k)] = true;
        excluded.contains(&false)
    }

    /// Admits all candidates again.
    pub(super) fn readmit(&mut self) {
        self.excluded.fill(false);
    }
}
