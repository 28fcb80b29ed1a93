//! What can be wrong with a recording.

use std::path::{Path, PathBuf};

use fringeflow_dataset::{Problem, SetupError};

use super::{FORMAT_VERSION, UNFINISHED};

/// Why a recording was not made or not read: the file and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
pub struct RecordingError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: RecordingProblem,
}

/// What is wrong with a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingProblem {
    /// There is something already where the recording, or the unfinished file beside it, would go.
    #[error("already exists; give another name, or remove it first")]
    Exists,
    /// The file cannot be made or written.
    #[error("cannot be written: {0}")]
    Unwritable(#[source] std::io::Error),
    /// The disk has less space than is to stay free.
    #[error(
        "cannot be written: {free_bytes} bytes of the disk are free and {min_free_bytes} are to stay so; free some \
         space, or lower the limit in the configuration"
    )]
    NoSpace {
        /// Bytes that are free.
        free_bytes: u64,
        /// Bytes that are to stay free.
        min_free_bytes: u64,
    },
    /// Writing failed half-way; what had been written before can be recovered.
    #[error("could not be finished: {0}; what was written stands in NAME{UNFINISHED}, see `fringeflow recover`")]
    Unfinishable(String),
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] std::io::Error),
    /// It is no MCAP file.
    #[error("is no MCAP file (its first bytes are not those of one)")]
    NotMcap,
    /// The file ends without its end.
    #[error(
        "is unfinished: it ends at byte {offset} {within}; `fringeflow recover` makes a whole file of what is there"
    )]
    Unfinished {
        /// Where.
        offset: u64,
        /// Within what.
        within: &'static str,
    },
    /// A place of the file holds what cannot be.
    #[error("is damaged at byte {offset}: {what}; `fringeflow recover` makes a whole file of what can still be read")]
    Damaged {
        /// Where.
        offset: u64,
        /// What is wrong there.
        what: String,
    },
    /// A chunk is compressed.
    #[error(
        "has a chunk at byte {offset} compressed with {compression:?}; unpack it first, with `mcap compress --compression \
         none`"
    )]
    Compressed {
        /// Where.
        offset: u64,
        /// What the chunk says.
        compression: String,
    },
    /// A newer version wrote it.
    #[error(
        "has format version {found}, and this fringeflow reads versions up to {FORMAT_VERSION}; update fringeflow \
         (it was written by version {writer})"
    )]
    NewerFormat {
        /// Format version of the file.
        found: u64,
        /// Version of the fringeflow that wrote it.
        writer: String,
    },
    /// It lacks what every recording has.
    #[error("has no {what}, so it is no recording of fringeflow, or a part of it was cut out")]
    Missing {
        /// What it lacks.
        what: &'static str,
    },
    /// A message has a value that cannot be.
    #[error("topic {topic}, message {sequence} (byte {offset}): {what}")]
    Message {
        /// Name of the topic.
        topic: &'static str,
        /// MCAP sequence number.
        sequence: u32,
        /// Where its data start.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// An image that is asked for is not there.
    #[error("has no image {sequence} of session {session} of camera {camera}; it was lost, or never recorded")]
    NoImage {
        /// 1 or 2.
        camera: u32,
        /// Session of the camera.
        session: u64,
        /// Sequence number of its driver.
        sequence: u64,
    },
    /// Calibration or description cannot be used.
    #[error("attachment {0}")]
    Setup(#[from] SetupError),
    /// The recorded truth cannot be used.
    #[error("attachment truth.npz: {0}")]
    Truth(#[source] Problem),
}

impl RecordingProblem {
    /// Whether a message says what cannot be, in a file that is whole.
    #[must_use]
    pub fn is_content(&self) -> bool {
        matches!(self, Self::Message { .. })
    }

    /// Whether it was a recording once, and is no whole one now.
    #[must_use]
    pub fn is_damage(&self) -> bool {
        matches!(self, Self::Unfinished { .. } | Self::Damaged { .. } | Self::Missing { .. } | Self::Message { .. })
    }

    /// Whether a new file could not be made or written.
    #[must_use]
    pub fn is_about_writing(&self) -> bool {
        matches!(self, Self::Exists | Self::Unwritable(_) | Self::NoSpace { .. } | Self::Unfinishable(_))
    }

    /// The error about a file.
    pub(super) fn of(self, file: &Path) -> RecordingError {
        RecordingError { file: file.to_owned(), problem: self }
    }
}
