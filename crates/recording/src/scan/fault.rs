//! What is wrong with the bytes of a recording.

use crate::RecordingProblem;

/// Returns the problem of a record at `offset`.
pub(super) fn damaged(offset: u64, what: impl Into<String>) -> RecordingProblem {
    RecordingProblem::Damaged { offset, what: what.into() }
}
