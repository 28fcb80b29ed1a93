//! One JSON object on standard output, for other programs.

use std::io::Write as _;

use serde::Serialize;

use crate::failure::Failure;

/// Prints a value as one line of JSON.
pub(crate) fn print(value: &impl Serialize) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer(&mut out, value).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
