mod jpeg;
mod layouts;
mod read_out;
mod sizes;

use super::SourceFormat;

/// Formats that are not compressed.
fn raw_formats() -> impl Iterator<Item = SourceFormat> {
    SourceFormat::ALL.into_iter().filter(|format| !format.is_compressed())
}
