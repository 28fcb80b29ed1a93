//! From two phase maps to one correspondence a pixel: segment table, candidates, back-projection test, resolution.

mod outcome;
pub mod reference_methods;

pub use outcome::{Outcome, OutcomeCounts};
