//! What whole regions are judged by.

use crate::simd::Level;

use super::super::grid::places_of;
use super::Evidence;
use super::continuity::Continuity;
use super::decisions::Decisions;

/// An image with the decisions about it.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) evidence: Evidence<'a>,
    pub(super) continuity: &'a Continuity,
    pub(super) decisions: Decisions<'a>,
    /// For each place the row of the epipolar frame that is nearest to its segment.
    pub(super) cam2_row: &'a [u16],
    /// Least and greatest δ that pass the back-projection test.
    pub(super) gate_bounds: [i16; 2],
    /// Smallest region that is judged, pixels.
    pub(super) min_region_px: u32,
    pub(super) level: Level,
}

impl<'a> Scene<'a> {
    /// Decided places of a row.
    pub(super) fn decided_in_row(&self, v: usize) -> impl Iterator<Item = usize> + use<'a> {
        let decided = self.decisions.decided;
        self.continuity.grid.blocks_of_row(v).flat_map(move |block| places_of(block, decided[block]))
    }
}
