//! Selects the conversion of a row, and checks the sizes of an image.

use fringeflow_base::grey::PixelFormat;

use super::error::UnpackError;
use super::rows::{self, Row};
use super::source_format::SourceFormat;

/// Returns the conversion of a row of a view, from this format to that of the channel; `None` if both are the same. Of
/// a mosaic, the values stay as they are.
pub(super) fn row_converter(format: SourceFormat, view: usize) -> Option<Row> {
    let of_view = |rows: [Row; 2]| rows[view.min(1)];
    Some(match format.samples() {
        SourceFormat::Y16BigEndian => rows::y16_big_endian,
        SourceFormat::Y012 => rows::y012,
        SourceFormat::Y10BitPacked => rows::y10_bit_packed,
        SourceFormat::Y10Mipi => rows::y10_mipi,
        SourceFormat::Y12Mipi => rows::y12_mipi,
        SourceFormat::Y14Mipi => rows::y14_mipi,
        SourceFormat::Mono10p => rows::mono_10p,
        SourceFormat::Mono12p => rows::mono_12p,
        SourceFormat::Y8Interleaved => of_view([rows::first_of_pairs, rows::second_of_pairs]),
        SourceFormat::Y12Interleaved => of_view([rows::y12_interleaved_0, rows::y12_interleaved_1]),
        SourceFormat::Y16Interleaved => of_view([rows::y16_interleaved_0, rows::y16_interleaved_1]),
        SourceFormat::Yuyv | SourceFormat::Yvyu => rows::first_of_pairs,
        SourceFormat::Uyvy | SourceFormat::Vyuy => rows::second_of_pairs,
        format => match format.colour_bytes()? {
            [3, _] => rows::colours_of_three_bytes,
            [_, 0] => rows::colours_before_a_byte,
            _ => rows::colours_after_a_byte,
        },
    })
}

/// Checks the size of the output buffer of an image.
pub(super) fn check_output(
    format: SourceFormat,
    [width_px, height_px]: [usize; 2],
    stored: PixelFormat,
    found: usize,
) -> Result<(), UnpackError> {
    let expected = width_px.saturating_mul(height_px).saturating_mul(stored.bytes());
    if found == expected { Ok(()) } else { Err(UnpackError::Output { format, width_px, height_px, found, expected }) }
}

/// Checks the size of the buffer of a driver.
pub(super) fn check_source(
    format: SourceFormat,
    found: usize,
    stride_bytes: usize,
    size_px: [usize; 2],
) -> Result<(), UnpackError> {
    let [width_px, height_px] = size_px;
    let least = format.least_stride_bytes(width_px);
    if stride_bytes < least {
        return Err(UnpackError::Stride { format, width_px, stride_bytes, least });
    }
    let least = format.least_bytes(size_px, stride_bytes);
    if found < least {
        return Err(UnpackError::Short { format, width_px, height_px, stride_bytes, found, least });
    }
    Ok(())
}
