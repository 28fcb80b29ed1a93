//! Why a board cannot be used.

use std::path::PathBuf;

/// Why the description of a board is refused.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The kind of the pattern is not known.
    #[error(
        "board: kind {kind:?} is not known; use chessboard, charuco, circles, asymmetric-circles or aprilgrid, as in \
         charuco:14x10:square=12:marker=9:dictionary=4x4_250"
    )]
    Kind {
        /// The kind.
        kind: String,
    },
    /// The number of elements is missing or cannot be read.
    #[error("board: size {text:?} is not a number of {elements} across and down; write it as in {example}")]
    Size {
        /// What stands in its place.
        text: String,
        /// What is counted.
        elements: &'static str,
        /// A description of this kind.
        example: &'static str,
    },
    /// A number of elements is out of range.
    #[error("board: size {nx}x{ny} has a number of {elements} outside {least} to {most}; write it as in {example}")]
    Count {
        /// Elements across.
        nx: usize,
        /// Elements down.
        ny: usize,
        /// What is counted.
        elements: &'static str,
        /// Smallest number.
        least: usize,
        /// Largest number.
        most: usize,
        /// A description of this kind.
        example: &'static str,
    },
    /// A field is missing.
    #[error("board: field {field} is missing; write it as in {example}")]
    Missing {
        /// The field.
        field: &'static str,
        /// A description of this kind.
        example: &'static str,
    },
    /// A field is not known.
    #[error("board: field {field:?} is not known; this kind has {}, as in {example}", known.join(", "))]
    Unknown {
        /// The field.
        field: String,
        /// The fields of this kind.
        known: &'static [&'static str],
        /// A description of this kind.
        example: &'static str,
    },
    /// A field stands twice.
    #[error("board: field {field} stands twice; keep one")]
    Twice {
        /// The field.
        field: String,
    },
    /// A length cannot be read or is out of range.
    #[error("board: field {field} is {text:?}; it is a length of {least} to {most} millimetres")]
    Length {
        /// The field.
        field: &'static str,
        /// Its value.
        text: String,
        /// Smallest length.
        least: f64,
        /// Largest length.
        most: f64,
    },
    /// Something does not fit in the place that the pattern leaves.
    #[error("board: field {field} is {value} mm; it must be less than {limit} mm, {reason}")]
    DoesNotFit {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must stay below.
        limit: f64,
        /// Why.
        reason: &'static str,
    },
    /// The dictionary is not known.
    #[error("board: field {field} is {name:?}, which is not known; use one of {}", known.join(", "))]
    Dictionary {
        /// The field.
        field: &'static str,
        /// The name.
        name: String,
        /// All names.
        known: Vec<String>,
    },
    /// The dictionary has too few markers.
    #[error(
        "board: field {field} is {name}, which has {available} markers; the board needs {needed}, so use a larger \
         dictionary or fewer squares"
    )]
    FewMarkers {
        /// The field.
        field: &'static str,
        /// The name.
        name: String,
        /// Markers that the board needs.
        needed: usize,
        /// Markers of the dictionary.
        available: usize,
    },
    /// The file cannot be read, or does not describe a board.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}
