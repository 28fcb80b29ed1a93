//! Luma of a JPEG image.
//!
//! JPEG has no checksum. Damage that leaves the Huffman codes of a scan readable is therefore not noticed here; drivers
//! mark such images.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::error::UnpackError;
use super::jpeg_structure;

/// Start of an image, and an `AVI1` segment. The segment makes the decoder use the standard Huffman tables if the image
/// has none.
const START: [u8; 11] = *b"\xff\xd8\xff\xe0\x00\x07AVI1\0";
/// Replaces the end marker. If a decoder meets the end marker too early, it fills up the missing part; without the
/// marker it fails. Only damage that these zero bytes can hide is not noticed: a few blocks at most. The decoder reads
/// up to eight bytes ahead.
const END_PADDING: [u8; 16] = [0; 16];
/// Size of the start marker and of the end marker, bytes.
const MARKER_BYTES: usize = 2;

/// Decodes the luma of an image of this size into `out`. `out` has `width · height` bytes.
pub(super) fn decode(source: &[u8], size_px: [usize; 2], out: &mut [u8]) -> Result<(), UnpackError> {
    let length = jpeg_structure::check(source, size_px)?;
    let inner = source.get(MARKER_BYTES..length - MARKER_BYTES).unwrap_or_default();
    let image = [&START, inner, &END_PADDING].concat();
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(size_px[0])
        .set_max_height(size_px[1])
        .jpeg_set_max_scans(1)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(image), options);
    decoder.decode_into(out).map_err(|e| UnpackError::Jpeg(e.to_string()))
}
