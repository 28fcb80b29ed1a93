//! What has been decided of each place so far.

use super::super::grid::bit;
use super::super::neighbourhood::TURN;
use super::super::search::Candidates;
use super::continuity::Continuity;

/// Candidates that the places were decided for; what stands at others means nothing.
#[derive(Clone, Copy)]
pub(super) struct Decisions<'a> {
    /// Fringe order.
    pub(super) order: &'a [i16],
    /// δ, turns · 65536.
    pub(super) delta: &'a [i16],
    /// Column of the epipolar frame that is nearest to the correspondence.
    pub(super) column: &'a [u16],
    /// A bit a place.
    pub(super) decided: &'a [u32],
}

impl<'a> Decisions<'a> {
    /// Decisions for the candidates that stand in the planes.
    pub(super) fn of(candidates: &'a Candidates, decided: &'a [u32]) -> Self {
        let Candidates { order, delta, column, .. } = candidates;
        Self { order, delta, column, decided }
    }

    #[inline]
    pub(super) fn is_decided(&self, place: usize) -> bool {
        bit(self.decided, place)
    }

    /// Absolute phase of a decided place, turns · 65536.
    #[inline]
    pub(super) fn absolute(&self, continuity: &Continuity, place: usize) -> i32 {
        i32::from(self.order[place]) * TURN + i32::from(continuity.phase[place])
    }
}
