//! Luma of a JPEG image.
//!
//! JPEG has no checksum: damage that leaves the codes of a scan readable goes unnoticed here. Drivers mark such images.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::UnpackError;
use super::jpeg_structure;

/// Start of an image, and an `AVI1` segment: it makes the decoder use the standard tables where tables are missing.
const START: [u8; 11] = *b"\xff\xd8\xff\xe0\x00\x07AVI1\0";
/// Replaces the marker of the end. A decoder that meets this marker too early fills up the missing part; without it, it
/// fails. Only damage that these bytes can hide goes unnoticed, a few blocks at most. The decoder reads up to eight
/// bytes ahead.
const INSTEAD_OF_END: [u8; 16] = [0; 16];
/// Bytes of the markers of start and end.
const MARK_BYTES: usize = 2;

/// Decodes the luma of an image of this size into `out`, which holds `width · height` bytes.
pub(super) fn decode(source: &[u8], size_px: [usize; 2], out: &mut [u8]) -> Result<(), UnpackError> {
    let length = jpeg_structure::check(source, size_px)?;
    let inner = source.get(MARK_BYTES..length - MARK_BYTES).unwrap_or_default();
    let image = [&START, inner, &INSTEAD_OF_END].concat();
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(size_px[0])
        .set_max_height(size_px[1])
        .jpeg_set_max_scans(1)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(image), options);
    decoder.decode_into(out).map_err(|e| UnpackError::Jpeg(e.to_string()))
}
