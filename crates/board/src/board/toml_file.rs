//! The description of a board as a TOML file: table `board` with `kind`, `size` and the fields of the kind.
//!
//! ```toml
//! [board]
//! kind = "charuco"
//! size = "14x10"
//! square_mm = 12
//! marker_mm = 9
//! dictionary = "4x4_250"
//! ```

use std::path::Path;

use fringeflow_base::text_file::read_text;

use super::spec::Fields;
use super::{Board, BoardError};

impl Board {
    /// Reads a board: a TOML file if the text ends in `.toml`, else a description such as `chessboard:9x6:square=25`.
    ///
    /// # Errors
    /// [`BoardError`]: the file cannot be read, or the description is wrong.
    pub fn read(text: &str) -> Result<Self, BoardError> {
        let path = Path::new(text);
        if path.extension().is_none_or(|extension| extension != "toml") {
            return text.parse();
        }
        let fail = |problem: String| BoardError::File { path: path.to_owned(), problem };
        let content = read_text(path).map_err(|error| fail(error.to_string()))?;
        Self::from_toml(&content).map_err(|error| fail(error.to_string()))
    }

    fn from_toml(content: &str) -> Result<Self, TomlError> {
        let file: toml::Table = content.parse()?;
        if let Some(key) = file.keys().find(|key| *key != "board") {
            return Err(TomlError::Key(key.clone()));
        }
        let table = file.get("board").and_then(toml::Value::as_table).ok_or(TomlError::NoTable)?;
        let texts: Vec<(&str, String)> = table.iter().map(|(key, value)| (key.as_str(), text_of(value))).collect();
        let named = |name| texts.iter().find(|(key, _)| *key == name).map_or("", |(_, text)| text);
        let others = texts.iter().filter(|(key, _)| !["kind", "size"].contains(key));
        let values = others.map(|(key, text)| (key.trim_end_matches("_mm"), text.as_str())).collect();
        Ok(Fields::new(named("kind"), named("size"), values)?.board()?)
    }
}

/// Why a file does not describe a board.
#[derive(Debug, thiserror::Error)]
enum TomlError {
    #[error(transparent)]
    Syntax(#[from] toml::de::Error),
    #[error("table [board] is missing; write kind, size and the fields of the kind into it")]
    NoTable,
    #[error("key {0:?} is not known; the file has one table, [board]")]
    Key(String),
    #[error(transparent)]
    Board(#[from] BoardError),
}

fn text_of(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
