//! Images from which only places are taken, such as the corners of a calibration board: JPEG and colours serve too.

use std::path::Path;

use fringeflow_base::grey::PixelFormat;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::decode::{Decoded, ImageFile};
use super::image::stored_bytes;
use super::{GreyImage, Problem};

/// Reads a PNG, TIFF, BMP, PGM or JPEG file as a grey image of the depth of the file. Colours become luma (ITU-R BT.601).
///
/// # Errors
/// The file is unreadable or damaged.
pub fn read_picture(path: &Path) -> Result<GreyImage, Problem> {
    match ImageFile::open(path) {
        Err(Problem::Jpeg) => read_jpeg(path),
        opened => luma(opened?.decode()?),
    }
}

fn read_jpeg(path: &Path) -> Result<GreyImage, Problem> {
    let bytes = std::fs::read(path).map_err(Problem::Unreadable)?;
    let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let pixels = decoder.decode().map_err(|e| Problem::Image(e.to_string()))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| Problem::Image("it has no size".to_owned()))?;
    if pixels.len() != width * height {
        return Err(Problem::Image("its pixels do not fit its size".to_owned()));
    }
    Ok(GreyImage { width, height, format: PixelFormat::Grey, pixels })
}

fn luma(decoded: Decoded) -> Result<GreyImage, Problem> {
    let Decoded { size_px: [width, height], format, channels, samples } = decoded;
    let grey: Vec<u16> = match channels {
        1 => samples,
        _ => samples.chunks_exact(channels).map(luma_of).collect(),
    };
    Ok(GreyImage { width, height, format, pixels: stored_bytes(&grey, format, width)? })
}

/// Luma of a pixel with grey and alpha, or red, green, blue and perhaps alpha.
fn luma_of(pixel: &[u16]) -> u16 {
    match *pixel {
        [red, green, blue, ..] => {
            ((299 * u32::from(red) + 587 * u32::from(green) + 114 * u32::from(blue) + 500) / 1000) as u16
        }
        [grey, ..] => grey,
        [] => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_become_luma() {
        let decoded = |channels, samples| Decoded { size_px: [1, 1], format: PixelFormat::Grey, channels, samples };
        assert_eq!(luma(decoded(3, vec![255, 0, 0])).unwrap().pixels, [76]);
        assert_eq!(luma(decoded(4, vec![0, 255, 0, 255])).unwrap().pixels, [150]);
        assert_eq!(luma(decoded(2, vec![77, 255])).unwrap().pixels, [77]);
    }

    #[test]
    fn a_damaged_jpeg_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.jpg");
        std::fs::write(&path, [0xff, 0xd8, 0xff, 0xe0, 0, 16]).unwrap();
        assert!(matches!(read_picture(&path), Err(Problem::Image(_))));
    }
}
