//! What 32 pixels of a row at once look into and find, at every level: their *segments*, and the *rows* of C2 with the places
//! where the phases of the pixels are crossed.
//!
//! Neighbouring pixels look for one fringe order in neighbouring columns of the same rows of C2, so that tables of 64 columns
//! hold what 32 pixels need.

mod rows;
mod segments;

use fringeflow_simd::LANES;

pub(super) use rows::{Crossing, Differences, Ends, RowPair, Rows, Tables, column_and_slope, crosses, mix_rows};
pub(super) use segments::{Segments, load};

/// Pixels of a block.
pub(super) const BLOCK: usize = LANES;

/// The numbers of the block that begins with the first pixel.
#[inline(always)]
pub(super) fn block_of<T>(row: &[T], first: usize) -> &[T; BLOCK] {
    &row.as_chunks().0[first / BLOCK]
}

/// The same, to be changed.
#[inline(always)]
pub(super) fn block_of_mut<T>(row: &mut [T], first: usize) -> &mut [T; BLOCK] {
    &mut row.as_chunks_mut().0[first / BLOCK]
}
