//! How good a calibration is, and what would make it better.
//!
//! In: the solution with its covariance. Out: the expected errors of measurements ([`prediction`]), where the board was
//! ([`coverage`]), and which poses would help most ([`poses`]).

pub mod coverage;
pub mod poses;
pub mod prediction;
