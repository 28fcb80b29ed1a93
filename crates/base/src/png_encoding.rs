//! PNG encoding.

use std::io::{self, Write};

/// Writes `width · height` pixels, row by row, with `depth` bits per channel of `color`; 16-bit values are big endian.
pub fn encode(
    out: impl Write,
    [width, height]: [usize; 2],
    color: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
) -> io::Result<()> {
    let side = |pixels: usize| u32::try_from(pixels).map_err(io::Error::other);
    let mut encoder = png::Encoder::new(out, side(width)?, side(height)?);
    encoder.set_color(color);
    encoder.set_depth(depth);
    // Noise hardly shrinks, however long one tries.
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(io_error)?;
    writer.write_image_data(bytes).map_err(io_error)?;
    writer.finish().map_err(io_error)
}

/// Converts an encoding error. An error of the operating system is kept, so that the caller recognizes a full disk.
fn io_error(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(e) => e,
        other => io::Error::other(other),
    }
}
