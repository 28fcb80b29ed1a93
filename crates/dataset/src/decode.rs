//! Image files by their content, whatever their ending: PNG, TIFF, BMP, PGM. In: a path. Out: size and depth at once,
//! values on request.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _};
use std::path::Path;

use fringeflow_base::grey::PixelFormat;
use image::codecs::bmp::BmpDecoder;
use image::codecs::pnm::PnmDecoder;
use image::codecs::tiff::TiffDecoder;
use image::{ColorType, DynamicImage, ImageDecoder};
use tiff::tags::Tag;

use super::Problem;

type Reader = BufReader<File>;

/// An opened image file, its header read.
pub(super) enum ImageFile {
    Png(Box<png::Reader<Reader>>),
    Tiff(Box<TiffDecoder<Reader>>),
    Bmp(Box<BmpDecoder<Reader>>),
    /// With the largest value that the file states.
    Pnm(Box<PnmDecoder<Reader>>, u32),
}

/// The content of an image file.
pub(super) struct Decoded {
    pub(super) size_px: [usize; 2],
    pub(super) format: PixelFormat,
    pub(super) channels: usize,
    /// The channels of each pixel, row by row.
    pub(super) samples: Vec<u16>,
}

impl ImageFile {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// The file is unreadable, damaged, or of another kind.
    pub(super) fn open(path: &Path) -> Result<Self, Problem> {
        let mut file = BufReader::new(File::open(path).map_err(Problem::Unreadable)?);
        let mut start = [0; 4];
        let read = file.read(&mut start).map_err(Problem::Unreadable)?;
        file.rewind().map_err(Problem::Unreadable)?;
        Ok(match &start[..read] {
            [0x89, b'P', b'N', b'G'] => {
                let mut decoder = png::Decoder::new(file);
                decoder.set_transformations(png::Transformations::EXPAND);
                Self::Png(Box::new(decoder.read_info().map_err(|e| damage(&e))?))
            }
            b"II*\0" | b"MM\0*" => open_tiff(file)?,
            [b'B', b'M', ..] => Self::Bmp(Box::new(BmpDecoder::new(file).map_err(|e| damage(&e))?)),
            [b'P', b'1'..=b'7', ..] => open_pnm(file)?,
            [0xff, 0xd8, ..] => return Err(Problem::Jpeg),
            [] => return Err(Problem::Image("it is empty".to_owned())),
            _ => return Err(Problem::OtherImage),
        })
    }

    /// Width and height, pixels.
    pub(super) fn size_px(&self) -> [usize; 2] {
        match self {
            Self::Png(reader) => [reader.info().width, reader.info().height].map(|side| side as usize),
            Self::Tiff(decoder) => size_px(decoder.as_ref()),
            Self::Bmp(decoder) => size_px(decoder.as_ref()),
            Self::Pnm(decoder, _) => size_px(decoder.as_ref()),
        }
    }

    /// Depth of its values.
    ///
    /// # Errors
    /// The values are no whole numbers of 8 or 16 bits.
    pub(super) fn format(&self) -> Result<PixelFormat, Problem> {
        match self {
            Self::Png(reader) if reader.info().bit_depth == png::BitDepth::Sixteen => Ok(PixelFormat::Y16),
            Self::Png(_) => Ok(PixelFormat::Grey),
            Self::Tiff(decoder) => stored_format(decoder.color_type()),
            Self::Bmp(decoder) => stored_format(decoder.color_type()),
            // Only this kind of file states its largest value.
            Self::Pnm(_, most) => match *most {
                1 | 255 => Ok(PixelFormat::Grey),
                most => {
                    let format = PixelFormat::ALL.into_iter().find(|format| u32::from(format.max_value()) == most);
                    format.ok_or_else(|| {
                        Problem::UnusableImage(format!(
                            "its largest value is {most}, which is not that of 8, 10, 12, 14 or 16 bits"
                        ))
                    })
                }
            },
        }
    }

    /// Reads the values.
    ///
    /// # Errors
    /// The file is damaged, or its values are no whole numbers.
    pub(super) fn decode(self) -> Result<Decoded, Problem> {
        let (size_px, format) = (self.size_px(), self.format()?);
        let (channels, samples) = match self {
            Self::Png(reader) => png_samples(*reader)?,
            Self::Tiff(decoder) => samples(*decoder)?,
            Self::Bmp(decoder) => samples(*decoder)?,
            Self::Pnm(decoder, most) => {
                let (channels, samples) = samples(*decoder)?;
                (channels, samples.into_iter().map(|sample| stored_value(sample, most)).collect())
            }
        };
        Ok(Decoded { size_px, format, channels, samples })
    }
}

/// Reads the header of a TIFF file. Its values must be whole numbers, stored without loss.
fn open_tiff(mut file: Reader) -> Result<ImageFile, Problem> {
    const WHOLE_NUMBERS: u16 = 1;
    const JPEG: [u16; 2] = [6, 7];
    let mut tags = tiff::decoder::Decoder::new(&mut file).map_err(|e| damage(&e))?;
    let mut number = |tag| tags.find_tag_unsigned_vec::<u16>(tag).map_err(|e| damage(&e));
    if number(Tag::Compression)?.is_some_and(|kinds| kinds.iter().any(|kind| JPEG.contains(kind))) {
        return Err(Problem::UnusableImage(
            "it is compressed as JPEG, which changes grey levels and with them the phase; save it with LZW, Deflate or no \
             compression"
                .to_owned(),
        ));
    }
    if number(Tag::SampleFormat)?.is_some_and(|formats| formats.iter().any(|&format| format != WHOLE_NUMBERS)) {
        return Err(Problem::UnusableImage(
            "its values are signed or floating-point numbers; save whole numbers of 8 or 16 bits".to_owned(),
        ));
    }
    file.rewind().map_err(Problem::Unreadable)?;
    Ok(ImageFile::Tiff(Box::new(TiffDecoder::new(file).map_err(|e| damage(&e))?)))
}

/// Reads the header of a PGM file. The decoder gives it away only with the file, so the file is read from its start again.
fn open_pnm(file: Reader) -> Result<ImageFile, Problem> {
    let (mut file, header) = PnmDecoder::new(file).map_err(|e| damage(&e))?.into_inner();
    file.rewind().map_err(Problem::Unreadable)?;
    let decoder = PnmDecoder::new(file).map_err(|e| damage(&e))?;
    Ok(ImageFile::Pnm(Box::new(decoder), header.maximal_sample()))
}

fn damage(error: &dyn std::error::Error) -> Problem {
    Problem::Image(error.to_string())
}

/// The value that a PGM file stores, from a sample that the decoder has scaled to 16 bits.
fn stored_value(sample: u16, most: u32) -> u16 {
    const SCALED: u32 = u16::MAX as u32;
    if most <= 255 { sample } else { ((u32::from(sample) * most + SCALED / 2) / SCALED) as u16 }
}

fn size_px(decoder: &impl ImageDecoder) -> [usize; 2] {
    let (width, height) = decoder.dimensions();
    [width as usize, height as usize]
}

fn stored_format(colour: ColorType) -> Result<PixelFormat, Problem> {
    match colour.bytes_per_pixel() / colour.channel_count() {
        1 => Ok(PixelFormat::Grey),
        2 => Ok(PixelFormat::Y16),
        _ => Err(Problem::UnusableImage("its values are no whole numbers of 8 or 16 bits".to_owned())),
    }
}

fn png_samples(mut reader: png::Reader<Reader>) -> Result<(usize, Vec<u16>), Problem> {
    let too_large = || Problem::Image("its pixels do not fit into memory".to_owned());
    let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(too_large)?];
    let info = reader.next_frame(&mut bytes).map_err(|e| damage(&e))?;
    reader.finish().map_err(|e| damage(&e))?;
    bytes.truncate(info.buffer_size());
    let samples = match info.bit_depth {
        png::BitDepth::Sixteen => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
        _ => bytes.iter().map(|&b| u16::from(b)).collect(),
    };
    Ok((info.color_type.samples(), samples))
}

fn samples(decoder: impl ImageDecoder) -> Result<(usize, Vec<u16>), Problem> {
    let channels = usize::from(decoder.color_type().channel_count());
    let bytes = |values: Vec<u8>| values.into_iter().map(u16::from).collect();
    Ok((
        channels,
        match DynamicImage::from_decoder(decoder).map_err(|e| damage(&e))? {
            DynamicImage::ImageLuma8(image) => bytes(image.into_raw()),
            DynamicImage::ImageLumaA8(image) => bytes(image.into_raw()),
            DynamicImage::ImageRgb8(image) => bytes(image.into_raw()),
            DynamicImage::ImageRgba8(image) => bytes(image.into_raw()),
            DynamicImage::ImageLuma16(image) => image.into_raw(),
            DynamicImage::ImageLumaA16(image) => image.into_raw(),
            DynamicImage::ImageRgb16(image) => image.into_raw(),
            DynamicImage::ImageRgba16(image) => image.into_raw(),
            _ => return Err(Problem::OtherImage),
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tiff_file_holds_whole_numbers_without_loss() {
        use tiff::encoder::{TiffEncoder, colortype};

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.tiff");
        let write = |bytes: &[u8]| std::fs::write(&path, bytes).unwrap();
        let refusal = || match ImageFile::open(&path) {
            Err(Problem::UnusableImage(what)) => what,
            other => panic!("{:?}", other.map(|file| file.size_px())),
        };
        let mut bytes = std::io::Cursor::new(Vec::new());
        TiffEncoder::new(&mut bytes).unwrap().write_image::<colortype::Gray32Float>(2, 1, &[0.5, 1.0]).unwrap();
        write(bytes.get_ref());
        assert!(refusal().contains("floating-point"), "{}", refusal());

        let mut bytes = std::io::Cursor::new(Vec::new());
        TiffEncoder::new(&mut bytes).unwrap().write_image::<colortype::Gray8>(2, 1, &[7, 9]).unwrap();
        let mut bytes = bytes.into_inner();
        write(&bytes);
        assert_eq!(ImageFile::open(&path).unwrap().decode().unwrap().samples, [7, 9]);
        // The tag of the compression, one short number: none (1) becomes JPEG (7).
        let tag = [3, 1, 3, 0, 1, 0, 0, 0, 1, 0];
        let place = bytes.windows(tag.len()).position(|window| window == tag).unwrap();
        bytes[place + 8] = 7;
        write(&bytes);
        assert!(refusal().contains("JPEG"), "{}", refusal());
    }

    #[test]
    fn a_pgm_file_states_its_depth_and_keeps_its_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.pgm");
        let open = |most: u16, values: &[u16]| {
            let header = format!("P5\n# by hand\n{} 1\n{most}\n", values.len());
            let bytes: Vec<u8> = match most {
                0..=255 => values.iter().map(|&value| value as u8).collect(),
                _ => values.iter().flat_map(|value| value.to_be_bytes()).collect(),
            };
            std::fs::write(&path, [header.as_bytes(), &bytes].concat()).unwrap();
            ImageFile::open(&path).unwrap()
        };
        for (most, format) in
            [(255, PixelFormat::Grey), (1023, PixelFormat::Y10), (4095, PixelFormat::Y12), (65535, PixelFormat::Y16)]
        {
            let values = [0, 1, most / 3, most];
            let Decoded { size_px, format: stored, channels, samples } = open(most, &values).decode().unwrap();
            assert_eq!((size_px, stored, channels, samples), ([4, 1], format, 1, values.to_vec()));
        }
        assert!(matches!(open(1000, &[0]).format(), Err(Problem::UnusableImage(_))));
        std::fs::write(&path, b"P5\n9 9\n255\nshort").unwrap();
        assert!(ImageFile::open(&path).unwrap().decode().is_err());
    }
}
