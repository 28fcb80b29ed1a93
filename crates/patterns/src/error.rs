//! Errors of files of patterns.

use std::path::{Path, PathBuf};

use fringeflow_base::text_file::TextError;

use crate::ResponseError;

/// A file of patterns cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
pub struct PatternError {
    /// The file or folder.
    pub file: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: PatternProblem,
}

impl PatternError {
    pub(crate) fn new(file: &Path, problem: impl Into<PatternProblem>) -> Self {
        Self { file: file.to_owned(), problem: problem.into() }
    }
}

/// What is wrong with patterns or their file.
#[derive(Debug, thiserror::Error)]
pub enum PatternProblem {
    /// The file cannot be read, or is not text.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The text is not TOML, or has an unknown field or a wrong type.
    #[error("is not a valid list of patterns: {0}")]
    Toml(String),
    /// An invalid value.
    #[error("{field} is {value}; {expected}")]
    Value {
        /// Name of the field.
        field: String,
        /// Its value.
        value: String,
        /// The valid values.
        expected: String,
    },
    /// A field is missing.
    #[error("{field} is missing; {expected}")]
    Missing {
        /// Name of the field.
        field: String,
        /// The valid values.
        expected: &'static str,
    },
    /// A field does not apply.
    #[error("{field} does not apply to an image of kind {kind:?}; remove it")]
    Unused {
        /// Name of the field.
        field: String,
        /// Kind of the image.
        kind: &'static str,
    },
    /// The response of the projector is invalid.
    #[error(transparent)]
    Response(#[from] ResponseError),
    /// The folder exists and is not empty.
    #[error("already exists and is not an empty folder; choose another path or remove it first")]
    Exists,
    /// A file cannot be written.
    #[error("cannot be written: {0}")]
    Unwritable(#[source] std::io::Error),
}

impl PatternProblem {
    pub(crate) fn value(field: impl Into<String>, value: &impl ToString, expected: impl Into<String>) -> Self {
        Self::Value { field: field.into(), value: value.to_string(), expected: expected.into() }
    }
}
