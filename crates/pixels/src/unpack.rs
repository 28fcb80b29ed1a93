//! One image: sizes are checked, then rows converted from the camera's layout to that of the channel.

use fringeflow_base::grey::PixelFormat;

use super::SourceFormat;
use super::jpeg;
use super::rows::{self, Row};

/// Why the bytes of a camera are no image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnpackError {
    /// The image is truncated.
    #[error(
        "{format} image of {width_px} × {height_px} pixels has {found} bytes; with rows of {stride_bytes} bytes it has at \
         least {least}"
    )]
    Short {
        /// Its format.
        format: SourceFormat,
        /// Width, pixels.
        width_px: usize,
        /// Height, pixels.
        height_px: usize,
        /// Bytes from one row to the next.
        stride_bytes: usize,
        /// Bytes received.
        found: usize,
        /// Bytes needed.
        least: usize,
    },
    /// Rows overlap.
    #[error("{format} image of {width_px} pixels a row has rows of {stride_bytes} bytes; it needs at least {least}")]
    Stride {
        /// Its format.
        format: SourceFormat,
        /// Width, pixels.
        width_px: usize,
        /// Bytes from one row to the next.
        stride_bytes: usize,
        /// Bytes needed.
        least: usize,
    },
    /// The output buffer has another size than the image.
    #[error("{format} image of {width_px} × {height_px} pixels does not fill {found} bytes; give {expected}")]
    Output {
        /// Its format.
        format: SourceFormat,
        /// Width, pixels.
        width_px: usize,
        /// Height, pixels.
        height_px: usize,
        /// Bytes of the buffer.
        found: usize,
        /// Bytes of the image.
        expected: usize,
    },
    /// The JPEG image has another size than expected.
    #[error("JPEG image is {} × {} pixels; expected {} × {}", found_px[0], found_px[1], expected_px[0], expected_px[1])]
    JpegSize {
        /// Width and height found.
        found_px: [usize; 2],
        /// Width and height expected.
        expected_px: [usize; 2],
    },
    /// The JPEG image is broken, or of a kind that cameras do not send.
    #[error("JPEG image cannot be decoded: {0}")]
    Jpeg(String),
}

/// Writes the grey levels of an image to `out`, in rows without gaps, in the format's
/// [`pixel_format`](SourceFormat::pixel_format).
///
/// `source` is the buffer of the driver; for formats with a buffer per plane, the first one. The stride is ignored for
/// compressed formats.
///
/// # Errors
/// [`UnpackError`]; `out` then holds no image.
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

/// Converts a row of this format to one of the channel; `None` where both are the same.
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
