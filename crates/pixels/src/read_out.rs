//! Converts the images of a device: its views, their region and binning.
//!
//! Binning loses no precision: the four values of a square are added to one value with two more bits. So an image of
//! half the width and height has the noise of four averaged pixels. With 16 bits there are no two bits left, so the
//! mean is used. The square of a Bayer mosaic has one red, two green and one blue pixel, so binning acts on the mosaic
//! itself, and nothing is interpolated.

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;

use super::device_images::{DeviceImages, DeviceImagesError};
use super::error::UnpackError;
use super::mosaic::{MosaicRows, MosaicSource};
use super::source_format::SourceFormat;
use super::stereo::StereoLayout;
use super::{jpeg, rows, unpack};

/// Converts the images of a device to those of the channels. If an image must be decoded or unpacked before a part of
/// it is taken, the reader holds memory for a whole image.
#[derive(Clone, Debug)]
pub struct ImageReader {
    images: DeviceImages,
    /// Width and height of the images of the device, pixels.
    image_px: [usize; 2],
    decoded: Vec<u8>,
    views: ViewReader,
}

/// Converts the rows of a view.
#[derive(Clone, Debug)]
struct ViewReader {
    readout: Readout,
    whole: Vec<u8>,
    mosaic: MosaicRows,
}

/// The bytes of an image that is not compressed.
#[derive(Clone, Copy)]
struct RawImage<'a> {
    format: SourceFormat,
    bytes: &'a [u8],
    stride_bytes: usize,
}

impl ImageReader {
    /// Creates a reader for the images of a device. Each view has the size of the sensor of `readout`, and region and
    /// binning act on each view.
    ///
    /// # Errors
    /// Views of this size cannot share an image in the format and arrangement of the device, or the grey level of a
    /// mosaic is not possible with this binning.
    pub fn new(images: DeviceImages, readout: Readout) -> Result<Self, DeviceImagesError> {
        images.check_binning(readout.binning())?;
        let image_px = images.image_px(readout.sensor_px())?;
        let views = ViewReader { readout, whole: Vec::new(), mosaic: MosaicRows::default() };
        Ok(Self { images, image_px, decoded: Vec::new(), views })
    }

    /// Format of the converted images.
    #[must_use]
    pub fn pixel_format(&self) -> PixelFormat {
        self.images.pixel_format(self.views.readout.binning())
    }

    /// Width and height of the converted images, pixels.
    #[must_use]
    pub fn image_size_px(&self) -> [usize; 2] {
        self.views.readout.image_size_px()
    }

    /// Size of a converted image, bytes.
    #[must_use]
    pub fn image_bytes(&self) -> usize {
        let [width, height] = self.image_size_px();
        width * height * self.pixel_format().bytes()
    }

    /// Size of a row of a whole view in the format of the channels, bytes.
    #[must_use]
    pub fn whole_row_bytes(&self) -> usize {
        self.views.readout.sensor_px()[0] * self.images.format().pixel_format().bytes()
    }

    /// Whether an image with rows of `stride_bytes` needs no conversion.
    #[must_use]
    pub fn is_passthrough(&self, stride_bytes: usize) -> bool {
        let samples = self.images.format().samples();
        let is_stored = samples == samples.pixel_format().into() && self.images.interpolation(1).is_none();
        let is_whole = self.views.readout.is_whole() && !self.images.holds_both_views();
        is_whole && is_stored && stride_bytes == self.whole_row_bytes()
    }

    /// Writes the grey levels of a view to `out`, in rows without gaps. View 0 is that of camera 1, or the only one;
    /// view 1 is that of camera 2.
    ///
    /// `source` is the buffer of the driver; if the format has one buffer per plane, it is the first one. The stride is
    /// ignored for compressed formats.
    ///
    /// # Errors
    /// [`UnpackError`]; the content of `out` is then undefined.
    pub fn read(&mut self, view: usize, source: &[u8], stride_bytes: usize, out: &mut [u8]) -> Result<(), UnpackError> {
        self.read_views(source, stride_bytes, [(view, out)])
    }

    /// Writes the grey levels of both views, as [`Self::read`] does. A compressed image is decoded once.
    ///
    /// # Errors
    /// [`UnpackError`]; the content of both outputs is then undefined.
    pub fn read_both(
        &mut self,
        source: &[u8],
        stride_bytes: usize,
        [first, second]: [&mut [u8]; 2],
    ) -> Result<(), UnpackError> {
        self.read_views(source, stride_bytes, [(0, first), (1, second)])
    }

    fn read_views<const N: usize>(
        &mut self,
        source: &[u8],
        stride_bytes: usize,
        mut outputs: [(usize, &mut [u8]); N],
    ) -> Result<(), UnpackError> {
        for (view, out) in &outputs {
            self.check_view(*view, out)?;
        }
        let (format, layout) = (self.images.format(), self.images.layout());
        if !format.is_compressed() {
            unpack::check_source(format, source.len(), stride_bytes, self.image_px)?;
            let image = RawImage { format, bytes: source, stride_bytes };
            outputs.into_iter().for_each(|(view, out)| self.views.read(self.images, view, image, out));
            return Ok(());
        }
        if let (None, true, [(_, out)]) = (layout, self.views.readout.is_whole(), outputs.as_mut_slice()) {
            return jpeg::decode(source, self.image_px, out);
        }
        let [width, height] = self.image_px;
        self.decoded.resize(width.saturating_mul(height), 0);
        jpeg::decode(source, self.image_px, &mut self.decoded)?;
        let image = RawImage { format: SourceFormat::Grey, bytes: &self.decoded, stride_bytes: width };
        outputs.into_iter().for_each(|(view, out)| self.views.read(self.images, view, image, out));
        Ok(())
    }

    fn check_view(&self, view: usize, out: &[u8]) -> Result<(), UnpackError> {
        let (format, views) = (self.images.format(), self.images.views());
        if view >= views {
            return Err(UnpackError::View { format, views, view });
        }
        unpack::check_output(format, self.image_size_px(), self.pixel_format(), out.len())
    }
}

impl ViewReader {
    /// Writes the grey levels of a view of an image whose sizes are checked.
    fn read(&mut self, images: DeviceImages, view: usize, image: RawImage<'_>, out: &mut [u8]) {
        let RawImage { format, stride_bytes, .. } = image;
        let bytes = image.bytes.get(self.view_offset(images.layout(), view, image)..).unwrap_or_default();
        let (samples, unpack) = (format.pixel_format(), unpack::row_converter(format, view));
        let interpolation = images.interpolation(self.readout.binning());
        if let (Some(grey), Some(order)) = (interpolation, format.bayer_order()) {
            let source = MosaicSource { bytes, stride_bytes, samples, unpack };
            return self.mosaic.interpolate(source, &self.readout, grey, order, out);
        }
        let [width, height] = self.readout.sensor_px();
        let row_bytes = width.saturating_mul(samples.bytes());
        match unpack {
            None => read_out(&self.readout, samples, bytes, stride_bytes, out),
            Some(row) if self.readout.is_whole() => rows::each(bytes, stride_bytes, row_bytes, out, row),
            Some(row) => {
                self.whole.resize(row_bytes * height, 0);
                rows::each(bytes, stride_bytes, row_bytes, &mut self.whole, row);
                read_out(&self.readout, samples, &self.whole, row_bytes, out);
            }
        }
    }

    /// First byte of a view.
    fn view_offset(&self, layout: Option<StereoLayout>, view: usize, image: RawImage<'_>) -> usize {
        let [width, height] = self.readout.sensor_px();
        match layout {
            None => 0,
            Some(StereoLayout::SideBySide) => view * image.format.least_stride_bytes(width),
            Some(StereoLayout::TopBottom) => (view * height).saturating_mul(image.stride_bytes),
        }
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
