//! Grey images and their files.

use std::path::Path;

use fringeflow_base::atomic_file::{WriteError, write_atomically};
use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::png_encoding;

use super::Problem;
use super::decode::{Decoded, ImageFile};

/// A grey image, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyImage {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Storage format of a pixel.
    pub format: PixelFormat,
    /// Bytes of `width · height` pixels.
    pub pixels: Vec<u8>,
}

impl GreyImage {
    /// The grey levels of the image.
    #[must_use]
    pub fn levels(&self) -> GreyLevels<'_> {
        GreyLevels { format: self.format, bytes: &self.pixels }
    }

    /// The grey levels of several images.
    #[must_use]
    pub fn levels_of(images: &[Self]) -> Vec<GreyLevels<'_>> {
        images.iter().map(Self::levels).collect()
    }
}

/// Reads a PNG, TIFF, BMP or PGM file as a grey image. Colours are converted if nothing is lost. If `format` is `None`,
/// the image has the depth of the file. Otherwise the values must fit the format.
///
/// # Errors
/// The file is unreadable or damaged, its size is not `expected_px`, or its values do not fit the format.
pub fn read_grey(
    path: &Path,
    expected_px: Option<[usize; 2]>,
    format: Option<PixelFormat>,
) -> Result<GreyImage, Problem> {
    let Decoded { size_px: [width, height], format: stored, channels, samples } = decoded(path, expected_px)?;
    let is_deep = stored != PixelFormat::Grey;
    let grey = grey_channel(samples, channels, width, if is_deep { u16::MAX } else { 255 })?;
    let format = format.unwrap_or(stored);
    if !is_deep && format != PixelFormat::Grey {
        return Err(Problem::Shallow { bits: format.bits() });
    }
    Ok(GreyImage { width, height, format, pixels: stored_bytes(&grey, format, width)? })
}

/// Reads a file with red, green and blue of 8 bits as bytes R G B, row by row.
///
/// # Errors
/// The file is unreadable or damaged, its size is not `expected_px`, or it does not have three colours of 8 bits.
pub(super) fn read_rgb(path: &Path, expected_px: [usize; 2]) -> Result<Vec<u8>, Problem> {
    let Decoded { format, channels, samples, .. } = decoded(path, Some(expected_px))?;
    if format != PixelFormat::Grey || channels != 3 {
        return Err(Problem::NotRgb { channels });
    }
    Ok(samples.into_iter().map(|sample| sample as u8).collect())
}

fn decoded(path: &Path, expected_px: Option<[usize; 2]>) -> Result<Decoded, Problem> {
    let opened = ImageFile::open(path)?;
    let [width, height] = opened.size_px();
    match expected_px {
        Some([expected_width, expected_height]) if [width, height] != [expected_width, expected_height] => {
            Err(Problem::ImageSize { width, height, expected_width, expected_height })
        }
        _ => opened.decode(),
    }
}

/// Writes a grey PNG with 8 bits, or with 16 bits for deeper images, whose values stay unchanged.
///
/// # Errors
/// The file cannot be written. An existing file stays unchanged.
pub fn write_png(path: &Path, image: &GreyImage) -> Result<(), WriteError> {
    let (size, grey) = ([image.width, image.height], png::ColorType::Grayscale);
    write_atomically(path, |out| match image.format {
        PixelFormat::Grey => png_encoding::encode(out, size, grey, png::BitDepth::Eight, &image.pixels),
        _ => {
            let big_endian: Vec<u8> = image.pixels.as_chunks().0.iter().flat_map(|&[low, high]| [high, low]).collect();
            png_encoding::encode(out, size, grey, png::BitDepth::Sixteen, &big_endian)
        }
    })
}

/// Returns the grey channel of an image with 1 to 4 channels, if its colours are equal and it is opaque.
fn grey_channel(samples: Vec<u16>, channels: usize, width: usize, opaque: u16) -> Result<Vec<u16>, Problem> {
    if channels == 1 {
        return Ok(samples);
    }
    let has_alpha = channels == 2 || channels == 4;
    let mut grey = Vec::with_capacity(samples.len() / channels);
    for (i, pixel) in samples.chunks_exact(channels).enumerate() {
        if has_alpha && pixel[channels - 1] != opaque {
            return Err(Problem::Transparent);
        }
        if channels >= 3 && (pixel[0] != pixel[1] || pixel[1] != pixel[2]) {
            return Err(Problem::Colour { u: i % width, v: i / width, rgb: [pixel[0], pixel[1], pixel[2]] });
        }
        grey.push(pixel[0]);
    }
    Ok(grey)
}

/// Converts values to bytes in a format.
pub(super) fn stored_bytes(values: &[u16], format: PixelFormat, width: usize) -> Result<Vec<u8>, Problem> {
    if let Some((i, &value)) = values.iter().enumerate().find(|&(_, &value)| value > format.max_value()) {
        return Err(Problem::Depth { bits: format.bits(), u: i % width, v: i / width, value });
    }
    Ok(match format {
        PixelFormat::Grey => values.iter().map(|&value| value as u8).collect(),
        _ => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn written(image: &GreyImage) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        write_png(&path, image).unwrap();
        (folder, path)
    }

    #[test]
    fn every_depth_comes_back_as_it_was() {
        for format in PixelFormat::ALL {
            let values = [0, 1, format.max_value() / 3, format.max_value() - 1, format.max_value(), 77];
            let image = GreyImage { width: 3, height: 2, format, pixels: stored_bytes(&values, format, 3).unwrap() };
            let (_folder, path) = written(&image);
            assert_eq!(read_grey(&path, Some([3, 2]), Some(format)).unwrap(), image);
            // The PNG file itself has 8 or 16 bits.
            let unknown = if format == PixelFormat::Grey { format } else { PixelFormat::Y16 };
            assert_eq!(read_grey(&path, None, None).unwrap(), GreyImage { format: unknown, ..image });
        }
    }

    #[test]
    fn values_beyond_the_depth_are_refused() {
        let values = [5, 4095, 4096, 9];
        let deep = GreyImage {
            width: 2,
            height: 2,
            format: PixelFormat::Y14,
            pixels: stored_bytes(&values, PixelFormat::Y14, 2).unwrap(),
        };
        let (_folder, path) = written(&deep);
        let refused = read_grey(&path, None, Some(PixelFormat::Y12)).unwrap_err();
        assert!(matches!(refused, Problem::Depth { bits: 12, u: 0, v: 1, value: 4096 }), "{refused}");
        let (_folder, path) =
            written(&GreyImage { width: 2, height: 1, format: PixelFormat::Grey, pixels: vec![1, 2] });
        let refused = read_grey(&path, None, Some(PixelFormat::Y10)).unwrap_err();
        assert!(matches!(refused, Problem::Shallow { bits: 10 }), "{refused}");
    }
}
