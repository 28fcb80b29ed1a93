//! Region and binning of an image.
//!
//! Binning loses no precision: the four values of a square are added to one value with two more bits. So an image of
//! half the width and height has the noise of four averaged pixels. With 16 bits there are no two bits left, so the
//! mean is used.

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;

use super::error::UnpackError;
use super::unpack::{self, unpack};
use super::{SourceFormat, rows};

/// Converts the images of a camera to those of the channels. If an image must be unpacked before a region is taken, the
/// reader holds memory for a whole image.
#[derive(Clone, Debug)]
pub struct ImageReader {
    format: SourceFormat,
    readout: Readout,
    whole: Vec<u8>,
}

impl ImageReader {
    /// Creates a reader for camera images of this format. They have the size of the sensor of `readout`.
    #[must_use]
    pub fn new(format: SourceFormat, readout: Readout) -> Self {
        Self { format, readout, whole: Vec::new() }
    }

    /// Format of the converted images.
    #[must_use]
    pub fn pixel_format(&self) -> PixelFormat {
        self.format.pixel_format().binned(self.readout.binning())
    }

    /// Width and height of the converted images, pixels.
    #[must_use]
    pub fn image_size_px(&self) -> [usize; 2] {
        self.readout.image_size_px()
    }

    /// Size of a converted image, bytes.
    #[must_use]
    pub fn image_bytes(&self) -> usize {
        let [width, height] = self.image_size_px();
        width * height * self.pixel_format().bytes()
    }

    /// Size of a row of a whole image in the format of the channels, bytes.
    #[must_use]
    pub fn whole_row_bytes(&self) -> usize {
        self.readout.sensor_px()[0] * self.format.pixel_format().bytes()
    }

    /// Whether an image with rows of `stride_bytes` needs no conversion.
    #[must_use]
    pub fn is_passthrough(&self, stride_bytes: usize) -> bool {
        let is_stored = self.format == self.format.pixel_format().into();
        self.readout.is_whole() && is_stored && stride_bytes == self.whole_row_bytes()
    }

    /// Writes the grey levels of the region to `out`, in rows without gaps. The arguments are those of [`unpack`].
    ///
    /// # Errors
    /// [`UnpackError`]; the content of `out` is then undefined.
    pub fn read(&mut self, source: &[u8], stride_bytes: usize, out: &mut [u8]) -> Result<(), UnpackError> {
        let (format, sensor_px) = (self.format, self.readout.sensor_px());
        if self.readout.is_whole() {
            return unpack(format, source, stride_bytes, sensor_px, out);
        }
        unpack::check_output(format, self.image_size_px(), self.pixel_format(), out.len())?;
        let pixel_format = format.pixel_format();
        if format == pixel_format.into() {
            unpack::check_source(format, source.len(), stride_bytes, sensor_px)?;
            read_out(&self.readout, pixel_format, source, stride_bytes, out);
        } else {
            let row_bytes = self.whole_row_bytes();
            self.whole.resize(row_bytes * sensor_px[1], 0);
            unpack(format, source, stride_bytes, sensor_px, &mut self.whole)?;
            read_out(&self.readout, pixel_format, &self.whole, row_bytes, out);
        }
        Ok(())
    }
}

/// Copies the region of `source`, a whole image with rows of `stride_bytes`, to `out`, in rows without gaps. The caller
/// has checked the sizes.
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
            // If a camera sets bits beyond its depth, the sum can exceed 16 bits; it is then limited.
            _ => add_words(upper, lower, out, |sum| sum.min(u16::MAX.into()) as u16),
        }
    }
}

/// Adds the values of squares of 8-bit pixels to 10-bit values. A pair of pixels is read as a 16-bit number, so that
/// the compiler vectorizes the shifts and sums.
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

/// Adds the values of squares of 16-bit pixels. A pair of pixels is read as a 32-bit number.
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
