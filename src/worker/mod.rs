//! The three stages of the measurement as workers: `step(input, &mut output)`, whatever brings the input.
//!
//! ```text
//!  images ─► PhaseWorker ─► PhasePair ─► CorrespondenceWorker ─► Correspondences ─► CloudWorker ─► Cloud
//! ```
//!
//! A worker knows no transport, no recording and no clock, and keeps nothing of one sequence for the next: the same
//! images give the same bytes live, in a replay, in a test and in [`crate::reconstruction`].

mod cloud;
mod correspondence;
mod phase;
mod sequence;

pub use cloud::CloudWorker;
pub use correspondence::{CorrespondenceWorker, Correspondences};
pub use phase::{ImagesError, PhasePair, PhaseWorker};
pub use sequence::SequenceFaults;
