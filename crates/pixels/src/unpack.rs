//! Converts one image: checks the sizes, then converts the rows from the layout of the camera to that of the channel.

use fringeflow_base::grey::PixelFormat;

use super::error::UnpackError;
use super::jpeg;
use super::rows::{self, Row};
use super::source_format::SourceFormat;

/// Writes the grey levels of an image to `out`, in rows without gaps, in the format's
/// [`pixel_format`](SourceFormat::pixel_format).
///
/// `source` is the buffer of the driver; if the format has one buffer per plane, it is the first one. The stride is
/// ignored for compressed formats.
///
/// # Errors
/// [`UnpackError`]; the content of `out` is then undefined.
pub fn unpack(
    format: SourceFormat,
    source: &[u8],
    stride_bytes: usize,
    size_px: [usize; 2],
    out: &mut [u8],
) -> Result<(), UnpackError> {
    check_output(format, size_px, format.pixel_format(), out.len())?;
    if format.is_compressed() {
        return jpeg::decode(source, size_px, out);
    }
    check_source(format, source.len(), stride_bytes, size_px)?;
    let row_bytes = size_px[0] * format.pixel_format().bytes();
    match row_converter(format) {
        Some(row) => rows::each(source, stride_bytes, row_bytes, out, row),
        None => rows::copy(source, stride_bytes, row_bytes, out),
    }
    Ok(())
}

/// Returns the conversion of a row from this format to that of the channel; `None` if both are the same.
fn row_converter(format: SourceFormat) -> Option<Row> {
    Some(match format {
        SourceFormat::Y16BigEndian => rows::y16_big_endian,
        SourceFormat::Y012 => rows::y012,
        SourceFormat::Y10BitPacked => rows::y10_bit_packed,
        SourceFormat::Y10Mipi => rows::y10_mipi,
        SourceFormat::Y12Mipi => rows::y12_mipi,
        SourceFormat::Y14Mipi => rows::y14_mipi,
        SourceFormat::Yuyv | SourceFormat::Yvyu => rows::luma_first,
        SourceFormat::Uyvy | SourceFormat::Vyuy => rows::luma_second,
        _ => return None,
    })
}

pub(super) fn check_output(
    format: SourceFormat,
    [width_px, height_px]: [usize; 2],
    stored: PixelFormat,
    found: usize,
) -> Result<(), UnpackError> {
    let expected = width_px.saturating_mul(height_px).saturating_mul(stored.bytes());
    if found == expected { Ok(()) } else { Err(UnpackError::Output { format, width_px, height_px, found, expected }) }
}

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
