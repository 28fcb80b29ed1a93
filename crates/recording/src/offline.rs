//! Recording what comes at no rate of its own: every message is written before the next is made, and none is lost.

use std::path::Path;

use super::Recordable;
use super::counts::RecorderCounts;
use super::error::{RecordingError, RecordingProblem};
use super::writer::{Opening, RecordingWriter};

/// A recording in the making; it ends with [`Self::finish`] or one of the others that consume it.
pub struct OfflineRecorder {
    writer: RecordingWriter,
    counts: RecorderCounts,
}

impl OfflineRecorder {
    /// Makes the file and writes what a recording begins with.
    ///
    /// # Errors
    /// The name is taken, or the file cannot be made.
    pub fn create(target: &Path, opening: &Opening<'_>) -> Result<Self, RecordingError> {
        let writer = RecordingWriter::create(target, opening)?;
        Ok(Self { writer, counts: RecorderCounts::default() })
    }

    /// Attaches a file.
    pub(super) fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<(), RecordingProblem> {
        self.writer.attach(name, media_type, data, 0)
    }

    /// Writes a message; one that contradicts itself is left out.
    ///
    /// # Errors
    /// The disk is full or broken; what is left to do is [`Self::give_up`].
    pub fn put(&mut self, message: &Recordable<'_>) -> Result<(), RecordingProblem> {
        let Some(topic) = message.topic() else { return Ok(()) };
        let counts = self.counts.of(topic);
        counts.taken += 1;
        // Of several the others are not needed: as many come back as were handed over.
        let mut encoded = self.writer.released().last().unwrap_or_default();
        message.encode(&mut encoded);
        if !self.writer.admits(encoded.bytes.len()) {
            return Err(RecordingProblem::Unwritable(std::io::ErrorKind::StorageFull.into()));
        }
        self.writer.write(topic, message.times(), encoded)?;
        counts.passed += 1;
        Ok(())
    }

    /// Writes the end of the file, and gives it its name.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(self) -> Result<RecorderCounts, RecordingError> {
        let metadata = self.counts.metadata("end");
        self.writer.finish(&metadata)?;
        Ok(self.counts)
    }

    /// Removes the file after a message could not be written; the error about it.
    #[must_use]
    pub fn give_up(self, problem: RecordingProblem) -> RecordingError {
        self.writer.give_up(problem)
    }

    /// Removes the file: half of what was asked for is worth nothing.
    pub fn discard(self) {
        self.writer.discard();
    }
}
