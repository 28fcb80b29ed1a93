//! The three stages of the measurement as workers: `step(input, &mut output)` (paper, sections 2.1 to 2.3).
//!
//! ```text
//!  images ─► PhaseWorker ─► PhasePair ─► CorrespondenceWorker ─► Correspondences ─► CloudWorker ─► Cloud
//! ```
//!
//! A worker knows no transport, no recording and no clock. It keeps memory from one sequence to the next, but no
//! results: the same images give the same bytes live, in a replay, in a test and in [`crate::reconstruction`].
//! Cost: after the first windows a worker allocates nothing.

mod cloud;
mod correspondence;
mod phase;
mod sequence;

pub use cloud::CloudWorker;
pub use correspondence::{CorrespondenceWorker, Correspondences};
pub use phase::{ImagesError, PhasePair, PhaseWorker};
pub use sequence::SequenceFaults;
