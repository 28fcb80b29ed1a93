//! Building blocks of the kernels that search 32 pixels of a row at once: their *segments*, and the *rows* of C2 with
//! the places where they cross the phases of the pixels.
//!
//! Neighbouring pixels look for one fringe order in neighbouring columns of the same rows of C2. A table of 64 columns
//! therefore serves 32 pixels.

mod rows;
mod segments;

use fringeflow_simd::LANES;

pub(super) use rows::{
    Crossing, Differences, Ends, MAX_COLUMN_STEP, RowPair, Rows, Tables, column_and_slope, crosses, interpolate_rows,
};
pub(super) use segments::{Segments, load};

/// Pixels of a block.
pub(super) const BLOCK: usize = LANES;

/// The block that begins with pixel `first`.
#[inline(always)]
pub(super) fn block_of<T>(row: &[T], first: usize) -> &[T; BLOCK] {
    &row.as_chunks().0[first / BLOCK]
}

/// As [`block_of`], mutable.
#[inline(always)]
pub(super) fn block_of_mut<T>(row: &mut [T], first: usize) -> &mut [T; BLOCK] {
    &mut row.as_chunks_mut().0[first / BLOCK]
}
