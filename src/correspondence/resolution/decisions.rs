//! What has been decided of each place so far.

use crate::simd::LANES;

use super::super::candidates::Candidate;
use super::super::neighbourhood::TURN;
use super::continuity::Continuity;
use super::grid::{Grid, bit};

/// Candidates that the places were decided for; what stands at others means nothing.
#[derive(Clone, Debug)]
pub(super) struct Decisions {
    /// Fringe order.
    pub(super) order: Vec<i16>,
    /// δ, turns · 65536.
    pub(super) delta: Vec<i16>,
    /// Column of the epipolar frame that is nearest to the correspondence.
    pub(super) column: Vec<u16>,
    /// A bit a place.
    pub(super) decided: Vec<u32>,
}

impl Decisions {
    pub(super) fn none(grid: Grid) -> Self {
        Self {
            order: vec![0; grid.places()],
            delta: vec![0; grid.places()],
            column: vec![0; grid.places()],
            decided: vec![0; grid.all_blocks()],
        }
    }

    #[inline]
    pub(super) fn is_decided(&self, place: usize) -> bool {
        bit(&self.decided, place)
    }

    #[inline]
    pub(super) fn decide(&mut self, place: usize, candidate: &Candidate) {
        self.order[place] = candidate.order;
        self.delta[place] = candidate.delta;
        self.column[place] = nearest_column(candidate);
        self.decided[place / LANES] |= 1 << (place % LANES);
    }

    /// Absolute phase of a decided place, turns · 65536.
    #[inline]
    pub(super) fn absolute(&self, continuity: &Continuity, place: usize) -> i32 {
        i32::from(self.order[place]) * TURN + i32::from(continuity.phase[place])
    }
}

/// The column of the epipolar frame that is nearest to a candidate: the frame has fewer than 65536.
#[inline]
pub(super) fn nearest_column(candidate: &Candidate) -> u16 {
    (candidate.column_px + 0.5) as u16
}
