//! 8-bit grey images and the PNG files that hold them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use crate::atomic_file::{WriteError, write_atomically};
use crate::png_encoding;

use super::{DatasetError, Problem};

/// An 8-bit grey image, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyImage {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `width · height` grey levels.
    pub pixels: Vec<u8>,
}

/// Reads a PNG as 8-bit grey; colour and 16-bit images are converted where that loses nothing.
///
/// # Errors
/// An unreadable or damaged file, another size than `expected_px`, or content that 8-bit grey cannot hold.
pub fn read_png(path: &Path, expected_px: Option<[usize; 2]>) -> Result<GreyImage, Problem> {
    let file = File::open(path).map_err(Problem::Unreadable)?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let damaged = |e: png::DecodingError| Problem::Png(e.to_string());
    let mut reader = decoder.read_info().map_err(damaged)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    if let Some([expected_width, expected_height]) = expected_px
        && [width, height] != [expected_width, expected_height]
    {
        return Err(Problem::ImageSize { width, height, expected_width, expected_height });
    }
    let too_large = || Problem::Png(format!("{width} × {height} pixels do not fit into memory"));
    let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(too_large)?];
    let info = reader.next_frame(&mut bytes).map_err(damaged)?;
    reader.finish().map_err(damaged)?;
    bytes.truncate(info.buffer_size());
    let samples = match info.bit_depth {
        png::BitDepth::Sixteen => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
        _ => bytes.iter().map(|&b| u16::from(b)).collect::<Vec<u16>>(),
    };
    let opaque = if info.bit_depth == png::BitDepth::Sixteen { u16::MAX } else { 255 };
    let grey = grey_channel(samples, info.color_type.samples(), width, opaque)?;
    Ok(GreyImage { width, height, pixels: eight_bits(&grey, info.bit_depth, width)? })
}

/// Writes an 8-bit grey PNG.
///
/// # Errors
/// The file cannot be written; whatever stood there stays.
pub fn write_png(path: &Path, image: &GreyImage) -> Result<(), WriteError> {
    let size = [image.width, image.height];
    write_atomically(path, |out| png_encoding::encode(out, size, png::ColorType::Grayscale, &image.pixels))
}

/// The one channel of an image of 1 to 4, if its colours are equal and it is opaque.
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

/// 8-bit values of samples: as they are up to 255, or widened 16-bit ones (257·v) divided back.
fn eight_bits(samples: &[u16], depth: png::BitDepth, width: usize) -> Result<Vec<u8>, Problem> {
    if depth != png::BitDepth::Sixteen || samples.iter().all(|&s| s <= 255) {
        return Ok(samples.iter().map(|&s| s as u8).collect());
    }
    let convert = |(i, &value): (usize, &u16)| {
        let lossless = value % 257 == 0;
        if lossless { Ok((value / 257) as u8) } else { Err(Problem::Depth { u: i % width, v: i / width, value }) }
    };
    samples.iter().enumerate().map(convert).collect()
}

/// Files `KIND_NN.png` of a folder by their number.
pub(super) fn numbered(folder: &Path, kind: &str) -> Result<BTreeMap<usize, PathBuf>, DatasetError> {
    let unreadable = |e| DatasetError::new(folder, Problem::Unreadable(e));
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let number = name.strip_prefix(kind).and_then(|n| n.strip_prefix('_')).and_then(|n| n.strip_suffix(".png"));
        if let Some(number) = number.and_then(|n| n.parse().ok()) {
            found.insert(number, path);
        }
    }
    Ok(found)
}

/// Checks that a folder has exactly the images `KIND_00.png` to `KIND_(count−1).png`.
pub(super) fn check_numbers(folder: &Path, kind: &str, count: usize) -> Result<(), DatasetError> {
    let found = numbered(folder, kind)?;
    if let Some(missing) = (0..count).find(|n| !found.contains_key(n)) {
        return Err(DatasetError::new(&folder.join(format!("{kind}_{missing:02}.png")), Problem::MissingImage));
    }
    match found.range(count..).next() {
        Some((_, path)) => Err(DatasetError::new(path, Problem::ExtraImage { kind: kind.to_owned(), promised: count })),
        None => Ok(()),
    }
}
