//! Building blocks of the kernels that search 32 pixels of a row at once: their *segments*, and the *rows* of C2 with
//! the places where they cross the phases of the pixels.
//!
//! Neighbouring pixels look for one fringe order in neighbouring columns of the same rows of C2. A table of 64 columns
//! therefore serves 32 pixels.

mod rows;
mod segments;

use fringeflow_simd::LANES;

pub(super) use rows::{
    Crossing, Differences, Ends, MAX_COLUMN_STEP, Rows, Tables, column_and_slope, crosses, interpolate_rows,
};
pub(super) use segments::{Segments, load};

/// Pixels of a block.
pub(super) const BLOCK: usize = LANES;
