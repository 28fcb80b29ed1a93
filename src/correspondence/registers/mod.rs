//! What the projector-side search of 32 pixels at once is made of, by AVX-512.
//!
//! Neighbouring pixels look for one fringe order in neighbouring columns of the same rows of C2, so that two registers a row
//! hold the columns that 32 pixels need: *rows* and their crossings; *words*: loads, stores, and halves of registers.

mod rows;
mod words;

pub(super) use rows::{COLUMNS, Crossing, Differences, Rows, crosses};
pub(super) use words::{
    join, least_word, load_floats, load_words, narrow, signed_half, store_floats, store_narrow, unsigned_half, widen,
};

/// Pixels of a block.
pub(super) const BLOCK: usize = crate::simd::LANES;
