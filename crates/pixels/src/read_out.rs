//! What is used of an image: its region is copied, and pixels are added up.
//!
//! Adding loses nothing: the four values of a square become one with two bits more, so that an image of half the sides has
//! the noise of four. Of 16 bits there are no more, so the mean is taken.

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;

use super::unpack::{self, UnpackError, unpack};
use super::{SourceFormat, rows};

/// Makes the images of a camera into those of the channels. Keeps memory for a whole image where the camera's must be
/// unpacked before a part is taken of it.
#[derive(Clone, Debug)]
pub struct ImageReader {
    format: SourceFormat,
    readout: Readout,
    whole: Vec<u8>,
}

impl ImageReader {
    /// For images in a format of a camera, of the size of the readout's sensor.
    #[must_use]
    pub fn new(format: SourceFormat, readout: Readout) -> Self {
        Self { format, readout, whole: Vec::new() }
    }

    /// Format of what is left.
    #[must_use]
    pub fn pixel_format(&self) -> PixelFormat {
        self.format.pixel_format().binned(self.readout.binning())
    }

    /// Width and height of what is left, pixels.
    #[must_use]
    pub fn image_size_px(&self) -> [usize; 2] {
        self.readout.image_size_px()
    }

    /// Bytes of what is left.
    #[must_use]
    pub fn image_bytes(&self) -> usize {
        let [width, height] = self.image_size_px();
        width * height * self.pixel_format().bytes()
    }

    /// Bytes of a row of a whole image that is stored as those of the channels are.
    #[must_use]
    pub fn plain_row_bytes(&self) -> usize {
        self.readout.sensor_px()[0] * self.format.pixel_format().bytes()
    }

    /// Whether an image with rows of so many bytes goes out as it comes.
    #[must_use]
    pub fn is_plain(&self, stride_bytes: usize) -> bool {
        let is_stored = self.format == self.format.pixel_format().into();
        self.readout.is_whole() && is_stored && stride_bytes == self.plain_row_bytes()
    }

    /// Writes the grey levels of what is left to `out`, in rows without gaps; else as [`unpack`].
    ///
    /// # Errors
    /// [`UnpackError`]; what `out` holds then is no image.
    pub fn read(&mut self, source: &[u8], stride_bytes: usize, out: &mut [u8]) -> Result<(), UnpackError> {
        let (format, sensor_px) = (self.format, self.readout.sensor_px());
        if self.readout.is_whole() {
            return unpack(format, source, stride_bytes, sensor_px, out);
        }
        unpack::check_place(format, self.image_size_px(), self.pixel_format(), out.len())?;
        let pixel_format = format.pixel_format();
        if format == pixel_format.into() {
            unpack::check_source(format, source.len(), stride_bytes, sensor_px)?;
            read_out(&self.readout, pixel_format, source, stride_bytes, out);
        } else {
            let row_bytes = self.plain_row_bytes();
            self.whole.resize(row_bytes * sensor_px[1], 0);
            unpack(format, source, stride_bytes, sensor_px, &mut self.whole)?;
            read_out(&self.readout, pixel_format, &self.whole, row_bytes, out);
        }
        Ok(())
    }
}

/// `source`: a whole image with rows of `stride_bytes`; `out`: the rows that are left, without gaps. Sizes were checked.
fn read_out(readout: &Readout, format: PixelFormat, source: &[u8], stride_bytes: usize, out: &mut [u8]) {
    let [x, y, width, _] = readout.region();
    let (from, bytes) = (x * format.bytes(), width * format.bytes());
    if readout.binning() == 1 {
        return rows::copy(&source[y * stride_bytes + from..], stride_bytes, bytes, out);
    }
    let pairs = source[y * stride_bytes..].chunks(2 * stride_bytes);
    let out_bytes = 2 * readout.image_size_px()[0];
    for (pair, out) in pairs.zip(out.chunks_exact_mut(out_bytes)) {
        let [upper, lower] = [0, stride_bytes].map(|row| &pair[row + from..][..bytes]);
        match format {
            PixelFormat::Grey => add_bytes(upper, lower, out),
            PixelFormat::Y16 => add_words(upper, lower, out, |sum| ((sum + 2) >> 2) as u16),
            // What a camera sends in bits that there are not is too bright as well.
            _ => add_words(upper, lower, out, |sum| sum.min(u16::MAX.into()) as u16),
        }
    }
}

/// Adds squares of 8 bits to values of 10. Pairs are numbers of 16 bits: shifts and sums of these become vector code.
fn add_bytes(upper: &[u8], lower: &[u8], out: &mut [u8]) {
    let sum = |&pair: &[u8; 2]| {
        let pair = u16::from_le_bytes(pair);
        (pair & 0xff) + (pair >> 8)
    };
    let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    for ((upper, lower), out) in pairs.zip(out.as_chunks_mut::<2>().0) {
        *out = (sum(upper) + sum(lower)).to_le_bytes();
    }
}

/// Adds squares of values of 16 bits, pairs as numbers of 32.
fn add_words(upper: &[u8], lower: &[u8], out: &mut [u8], value_of: impl Fn(u32) -> u16) {
    let sum = |&pair: &[u8; 4]| {
        let pair = u32::from_le_bytes(pair);
        (pair & 0xffff) + (pair >> 16)
    };
    let pairs = upper.as_chunks::<4>().0.iter().zip(lower.as_chunks::<4>().0);
    for ((upper, lower), out) in pairs.zip(out.as_chunks_mut::<2>().0) {
        *out = value_of(sum(upper) + sum(lower)).to_le_bytes();
    }
}
