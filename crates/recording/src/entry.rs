//! A message of a recording whose data is not read yet, and its place in the file.

use crate::content::Header;
use crate::recordable::Times;
use crate::{RecordingProblem, Topic};

/// A part of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FileRange {
    pub(super) offset: u64,
    pub(super) bytes: usize,
}

/// A message whose data is not read yet.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) range: FileRange,
    pub(super) header: Option<Header>,
}

impl Entry {
    /// Returns the problem of an invalid message.
    pub(super) fn problem(&self, what: String) -> RecordingProblem {
        RecordingProblem::Message { topic: self.topic.name(), sequence: self.sequence, offset: self.range.offset, what }
    }
}
