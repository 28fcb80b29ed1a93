//! Why an image cannot be unpacked.

use super::source_format::SourceFormat;

/// Why the bytes from a camera are not a valid image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnpackError {
    /// The image is truncated.
    #[error(
        "{format} image of {width_px} × {height_px} pixels has {found} bytes; with rows of {stride_bytes} bytes it \
         needs at least {least}"
    )]
    Short {
        /// Format of the image.
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
    #[error(
        "{format} image with {width_px} pixels per row has rows of {stride_bytes} bytes; at least {least} are needed"
    )]
    Stride {
        /// Format of the image.
        format: SourceFormat,
        /// Width, pixels.
        width_px: usize,
        /// Bytes from one row to the next.
        stride_bytes: usize,
        /// Bytes needed.
        least: usize,
    },
    /// The size of the output buffer differs from that of the image.
    #[error(
        "{format} image of {width_px} × {height_px} pixels needs an output buffer of {expected} bytes; it has {found}"
    )]
    Output {
        /// Format of the image.
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
    /// The image has no such view.
    #[error("{format} image has {views} view(s); there is no view {view}")]
    View {
        /// Format of the image.
        format: SourceFormat,
        /// Number of views.
        views: usize,
        /// The view, counted from 0.
        view: usize,
    },
    /// The size of the JPEG image differs from the expected size.
    #[error("JPEG image is {} × {} pixels; expected {} × {}", found_px[0], found_px[1], expected_px[0], expected_px[1])]
    JpegSize {
        /// Width and height found.
        found_px: [usize; 2],
        /// Width and height expected.
        expected_px: [usize; 2],
    },
    /// The JPEG image is damaged, or of a kind that cameras do not send.
    #[error("JPEG image cannot be decoded: {0}")]
    Jpeg(String),
}
