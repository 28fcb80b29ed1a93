//! Errors about recordings.

use std::path::{Path, PathBuf};

use fringeflow_dataset::{Problem, SetupError};

use crate::{FORMAT_VERSION, UNFINISHED};

/// An error about a recording: the file and what is wrong with it.
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
    /// The path of the recording, or of its unfinished file, already exists.
    #[error("already exists; choose another name or remove it first")]
    Exists,
    /// The file cannot be created or written.
    #[error("cannot be written: {0}")]
    Unwritable(#[source] std::io::Error),
    /// The disk has less free space than the limit.
    #[error(
        "cannot be written: {free_bytes} bytes of the disk are free, and {min_free_bytes} must stay free; free some \
         space, or lower the limit in the configuration"
    )]
    NoSpace {
        /// Free bytes.
        free_bytes: u64,
        /// Bytes that must stay free.
        min_free_bytes: u64,
    },
    /// Writing failed. The data written before can be recovered.
    #[error("could not be finished: {0}; the data written so far is in NAME{UNFINISHED}, see `fringeflow recover`")]
    Unfinishable(String),
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] std::io::Error),
    /// The file is not an MCAP file.
    #[error("is not an MCAP file, but {kind}")]
    NotMcap {
        /// The kind of the file, perhaps with a remedy.
        kind: &'static str,
    },
    /// The file is an MCAP file of another program.
    #[error(
        "is a recording of another program{}: its channels are {}; Fringeflow reads recordings of `fringeflow run \
         --record`, `simulate` and `import`, which have images and headers of two cameras, the calibration and the \
         description of the pattern; for images in files see `fringeflow import`",
        written_by(library),
        listed(channels)
    )]
    OtherProgram {
        /// Library that wrote the file.
        library: String,
        /// Its channels, each with schema and encoding.
        channels: Vec<String>,
    },
    /// Nothing of a recording can be read from a damaged file.
    #[error("holds nothing that can be recovered: {0}")]
    NothingReadable(String),
    /// The file ends before the end of the recording.
    #[error(
        "is unfinished: it ends at byte {offset} {within}; `fringeflow recover` writes a complete file from the rest"
    )]
    Unfinished {
        /// Length of the file.
        offset: u64,
        /// Part of the file that is incomplete.
        within: &'static str,
    },
    /// A part of the file is invalid.
    #[error("is damaged at byte {offset}: {what}; `fringeflow recover` writes a complete file from the readable parts")]
    Damaged {
        /// Start of that part.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// A chunk is compressed in a way that is not read.
    #[error(
        "has a chunk at byte {offset} compressed with {compression:?}; Fringeflow reads lz4 and zstd, so unpack it \
         first with the program that wrote it"
    )]
    Compressed {
        /// Start of the chunk.
        offset: u64,
        /// Its compression.
        compression: String,
    },
    /// The file was written by a newer version.
    #[error(
        "has format version {found}, and this fringeflow reads versions up to {FORMAT_VERSION}; update fringeflow \
         (it was written by version {writer})"
    )]
    NewerFormat {
        /// Format version of the file.
        found: u64,
        /// Version of fringeflow that wrote it.
        writer: String,
    },
    /// A required part is missing.
    #[error("has no {what}, so it is not a recording of Fringeflow, or a part of it was removed")]
    Missing {
        /// The missing part.
        what: &'static str,
    },
    /// A message has an invalid value.
    #[error("topic {topic}, message {sequence} (byte {offset}): {what}")]
    Message {
        /// Name of the topic.
        topic: &'static str,
        /// MCAP sequence number.
        sequence: u32,
        /// Start of its data.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// The recording does not contain this image.
    #[error("has no image {sequence} of session {session} of camera {camera}; it was lost, or never recorded")]
    NoImage {
        /// 1 or 2.
        camera: u32,
        /// Session of the camera.
        session: u64,
        /// Sequence number of its driver.
        sequence: u64,
    },
    /// Calibration or description is invalid.
    #[error("attachment {0}")]
    Setup(#[from] SetupError),
    /// The recorded ground truth is invalid.
    #[error("attachment truth.npz: {0}")]
    Truth(#[source] Problem),
}

impl RecordingProblem {
    /// Whether a message has an invalid value, in a file that is complete.
    #[must_use]
    pub fn is_content(&self) -> bool {
        matches!(self, Self::Message { .. })
    }

    /// Whether the file is an incomplete or damaged recording.
    #[must_use]
    pub fn is_damage(&self) -> bool {
        matches!(
            self,
            Self::Unfinished { .. }
                | Self::Damaged { .. }
                | Self::Missing { .. }
                | Self::Message { .. }
                | Self::NothingReadable(_)
        )
    }

    /// Whether a new file could not be created or written.
    #[must_use]
    pub fn is_about_writing(&self) -> bool {
        matches!(self, Self::Exists | Self::Unwritable(_) | Self::NoSpace { .. } | Self::Unfinishable(_))
    }

    /// Returns the error about a file.
    pub(super) fn in_file(self, file: &Path) -> RecordingError {
        RecordingError { file: file.to_owned(), problem: self }
    }
}

/// Maximum number of channels that an error lists.
const MAX_LISTED: usize = 8;

fn written_by(library: &str) -> String {
    if library.is_empty() { String::new() } else { format!(" ({library})") }
}

/// Lists channels, at most [`MAX_LISTED`].
fn listed(channels: &[String]) -> String {
    let mut text = channels.iter().take(MAX_LISTED).cloned().collect::<Vec<_>>().join(", ");
    match channels.len().saturating_sub(MAX_LISTED) {
        0 if channels.is_empty() => "none".to_owned(),
        0 => text,
        more => {
            text.push_str(&format!(" and {more} more"));
            text
        }
    }
}
