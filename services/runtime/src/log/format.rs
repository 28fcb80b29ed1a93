//! Formats of log lines.

use clap::ValueEnum;

/// Format of log lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Lines for people: time, level, message, fields.
    #[default]
    Text,
    /// Lines for programs: one JSON object each, with time, level, process, message, fields, and repeated, the number
    /// of lines left out before.
    Json,
}

impl LogFormat {
    /// Returns the name on the command line and in the environment.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Json => "json",
        }
    }
}
