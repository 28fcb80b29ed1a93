//! Fields of comma-separated values (RFC 4180).

/// A number; empty if it was not measured.
pub(super) fn number(value: Option<f64>) -> String {
    value.map(|value| format!("{value:.5}")).unwrap_or_default()
}

/// Quotes a text that may contain commas, quotes and line breaks.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
