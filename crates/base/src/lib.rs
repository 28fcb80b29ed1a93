//! What every other crate may name: grey levels, limits, what became of a pixel, atomic files, PNG.

#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod grey;
pub mod limits;
pub mod outcome;
pub mod png_encoding;
