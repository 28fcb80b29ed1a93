//! A message of a recording whose data is not read yet, and its place in the file.

use crate::content::Header;
use crate::place::Place;
use crate::recordable::Times;
use crate::{RecordingProblem, Topic};

/// A message whose data is not read yet.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) place: Place,
    pub(super) header: Option<Header>,
}

impl Entry {
    /// Returns the problem of an invalid message.
    pub(super) fn problem(&self, what: String) -> RecordingProblem {
        RecordingProblem::Message { topic: self.topic.name(), sequence: self.sequence, offset: self.place.offset, what }
    }
}
