//! Recording that is not in real time: every message is written before the next one is created, and none is lost.

use std::path::Path;

use crate::recordable::Encoded;
use crate::writer::{Opening, RecordingWriter};
use crate::{Recordable, RecorderCounts, RecordingError, RecordingProblem};

/// An unfinished recording. End it with [`Self::finish`], [`Self::abort`] or [`Self::discard`].
pub struct OfflineRecorder {
    writer: RecordingWriter,
    /// Time of the attachments.
    started_ns: u64,
    counts: RecorderCounts,
    /// The message that is being written.
    encoded: Encoded,
}

impl OfflineRecorder {
    /// Creates the file and writes the start of a recording.
    ///
    /// # Errors
    /// The file exists, or cannot be created.
    pub fn create(target: &Path, opening: &Opening<'_>) -> Result<Self, RecordingError> {
        let writer = RecordingWriter::create(target, opening)?;
        let started_ns = opening.origin.started_ns;
        Ok(Self { writer, started_ns, counts: RecorderCounts::default(), encoded: Encoded::default() })
    }

    /// Attaches a file.
    pub(super) fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<(), RecordingProblem> {
        self.writer.attach(name, media_type, data, self.started_ns)
    }

    /// Writes a message. A message that contradicts itself is skipped.
    ///
    /// # Errors
    /// The disk is full or failed. Then call [`Self::abort`].
    pub fn put(&mut self, message: &Recordable<'_>) -> Result<(), RecordingProblem> {
        let Some(topic) = message.topic() else { return Ok(()) };
        let counts = self.counts.for_topic(topic);
        counts.taken += 1;
        message.encode(self.writer.clock, &mut self.encoded);
        self.writer.require_space(self.encoded.len())?;
        self.writer.write(topic, message.times(), &self.encoded)?;
        counts.passed += 1;
        Ok(())
    }

    /// Writes the end of the file and renames it to its final name.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> Result<RecorderCounts, RecordingError> {
        let metadata = self.counts.metadata("end");
        self.writer.finish(&metadata)?;
        Ok(self.counts)
    }

    /// Removes the file after a message could not be written, and returns the error.
    #[must_use]
    pub fn abort(self, problem: RecordingProblem) -> RecordingError {
        self.writer.abort(problem)
    }

    /// Removes the incomplete file.
    pub fn discard(self) {
        self.writer.discard();
    }
}
