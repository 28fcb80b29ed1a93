//! Formats in which cameras send images, and their sizes in bytes.

use fringeflow_base::grey::PixelFormat;

use super::bayer::{BayerOrder, BayerSamples};

/// A pixel format with grey levels, a colour mosaic, luma and colours, or red, green and blue. Most are those of V4L2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SourceFormat {
    /// 8 bits.
    #[default]
    Grey,
    /// 10 bits in the low bits of 16, little endian.
    Y10,
    /// 12 bits in the low bits of 16, little endian.
    Y12,
    /// 14 bits in the low bits of 16, little endian.
    Y14,
    /// 16 bits, little endian. Some drivers use this name for fewer bits in the low bits: the bytes of Y10, Y12 or Y14.
    Y16,
    /// 16 bits, big endian.
    Y16BigEndian,
    /// 12 bits in the high bits of 16, little endian.
    Y012,
    /// 10 bits, packed from the high bits downwards: four pixels in five bytes.
    Y10BitPacked,
    /// 10 bits in MIPI packing: the high bits of four pixels, then their low bits in a fifth byte.
    Y10Mipi,
    /// 12 bits in MIPI packing: the high bits of two pixels, then their low bits in a third byte.
    Y12Mipi,
    /// 14 bits in MIPI packing: the high bits of four pixels, then their low bits in three bytes.
    Y14Mipi,
    /// 10 bits in the packing of GenICam, from the low bits upwards: four pixels in five bytes.
    Mono10p,
    /// 12 bits in the packing of GenICam, from the low bits upwards: two pixels in three bytes.
    Mono12p,
    /// A mosaic of red, green and blue pixels.
    Bayer(BayerOrder, BayerSamples),
    /// 8 bits, a pixel of camera 1 and one of camera 2 in turn.
    Y8Interleaved,
    /// 12 bits, a pixel of camera 1 and one of camera 2 in three bytes, from the low bits upwards.
    Y12Interleaved,
    /// 16 bits, little endian, a pixel of camera 1 and one of camera 2 in turn.
    Y16Interleaved,
    /// Bytes R G B.
    Rgb24,
    /// Bytes B G R.
    Bgr24,
    /// Bytes B G R X.
    Xbgr32,
    /// Bytes B G R A.
    Abgr32,
    /// Bytes B G R and one without meaning.
    Bgr32,
    /// Bytes R G B X.
    Rgbx32,
    /// Bytes R G B A.
    Rgba32,
    /// Bytes X B G R.
    Bgrx32,
    /// Bytes A B G R.
    Bgra32,
    /// Bytes X R G B.
    Xrgb32,
    /// Bytes A R G B.
    Argb32,
    /// A byte without meaning, and R G B.
    Rgb32,
    /// Luma and colours in turn: Y U Y V.
    Yuyv,
    /// Luma and colours in turn: Y V Y U.
    Yvyu,
    /// Luma and colours in turn: U Y V Y.
    Uyvy,
    /// Luma and colours in turn: V Y U Y.
    Vyuy,
    /// A plane of luma, then one of colours at half the width and height.
    Nv12,
    /// As [`Self::Nv12`], with the colours in the other order.
    Nv21,
    /// A plane of luma, then one of colours at half the width.
    Nv16,
    /// As [`Self::Nv16`], with the colours in the other order.
    Nv61,
    /// A plane of luma, then two of colours at half the width and height.
    Yuv420,
    /// As [`Self::Yuv420`], with the colours in the other order.
    Yvu420,
    /// As [`Self::Nv12`], each plane in its own buffer.
    Nv12Planes,
    /// As [`Self::Nv21`], each plane in its own buffer.
    Nv21Planes,
    /// As [`Self::Yuv420`], each plane in its own buffer.
    Yuv420Planes,
    /// As [`Self::Yvu420`], each plane in its own buffer.
    Yvu420Planes,
    /// A JPEG image, possibly without Huffman tables.
    Mjpeg,
    /// A JPEG image.
    Jpeg,
}

impl SourceFormat {
    /// Order of the colours of a mosaic; `None` for other formats.
    #[must_use]
    pub fn bayer_order(self) -> Option<BayerOrder> {
        if let Self::Bayer(order, _) = self { Some(order) } else { None }
    }

    /// Whether pixels of two views are stored in turn. The width then counts the pixels of one view.
    #[must_use]
    pub fn is_interleaved(self) -> bool {
        matches!(self, Self::Y8Interleaved | Self::Y12Interleaved | Self::Y16Interleaved)
    }

    /// The format that stores the same values, without the meaning of a mosaic.
    #[must_use]
    pub fn samples(self) -> Self {
        if let Self::Bayer(_, samples) = self { samples.grey_format() } else { self }
    }

    /// Format of the unpacked images; of a mosaic, that of its values. The sum R + 2 G + B of 8-bit colours has 10
    /// bits.
    #[must_use]
    pub fn pixel_format(self) -> PixelFormat {
        match self.samples() {
            Self::Y10 | Self::Y10BitPacked | Self::Y10Mipi | Self::Mono10p => PixelFormat::Y10,
            Self::Y12 | Self::Y012 | Self::Y12Mipi | Self::Mono12p | Self::Y12Interleaved => PixelFormat::Y12,
            Self::Y14 | Self::Y14Mipi => PixelFormat::Y14,
            Self::Y16 | Self::Y16BigEndian | Self::Y16Interleaved => PixelFormat::Y16,
            format if format.is_rgb() => PixelFormat::Y10,
            _ => PixelFormat::Grey,
        }
    }

    /// Whether a pixel has red, green and blue.
    #[must_use]
    pub fn is_rgb(self) -> bool {
        self.colour_bytes().is_some()
    }

    /// Bytes of a pixel with red, green and blue, and the first of these; green is always between the others. `None`
    /// for other formats.
    pub(super) fn colour_bytes(self) -> Option<[usize; 2]> {
        match self {
            Self::Rgb24 | Self::Bgr24 => Some([3, 0]),
            Self::Xbgr32 | Self::Abgr32 | Self::Bgr32 | Self::Rgbx32 | Self::Rgba32 => Some([4, 0]),
            Self::Bgrx32 | Self::Bgra32 | Self::Xrgb32 | Self::Argb32 | Self::Rgb32 => Some([4, 1]),
            _ => None,
        }
    }

    /// Whether the images are compressed, so that the length of a row is unknown.
    #[must_use]
    pub fn is_compressed(self) -> bool {
        matches!(self, Self::Mjpeg | Self::Jpeg)
    }

    /// The smallest group of pixels that fills whole bytes: number of pixels, number of bytes.
    fn group(self) -> [usize; 2] {
        match self.samples() {
            Self::Y10 | Self::Y12 | Self::Y14 | Self::Y16 | Self::Y16BigEndian | Self::Y012 => [1, 2],
            Self::Y8Interleaved => [1, 2],
            Self::Y12Interleaved => [1, 3],
            Self::Y16Interleaved => [1, 4],
            Self::Y10BitPacked | Self::Y10Mipi | Self::Mono10p => [4, 5],
            Self::Y12Mipi | Self::Mono12p => [2, 3],
            Self::Y14Mipi => [4, 7],
            Self::Yuyv | Self::Yvyu | Self::Uyvy | Self::Vyuy => [2, 4],
            format => [1, format.colour_bytes().map_or(1, |[bytes, _]| bytes)],
        }
    }

    /// Number of pixels that are stored together.
    pub(super) fn group_px(self) -> usize {
        self.group()[0]
    }

    /// Size of a row without a gap, bytes; 0 for compressed formats.
    #[must_use]
    pub fn least_stride_bytes(self, width_px: usize) -> usize {
        let [pixels, bytes] = self.group();
        if self.is_compressed() { 0 } else { width_px.div_ceil(pixels).saturating_mul(bytes) }
    }

    /// Size of a complete image without gaps, bytes: with the planes of the colours, if they are in the same buffer; 0
    /// for compressed formats.
    #[must_use]
    pub fn whole_bytes(self, [width_px, height_px]: [usize; 2]) -> usize {
        let first = self.least_stride_bytes(width_px).saturating_mul(height_px);
        let half_width = width_px.div_ceil(2);
        let colours = match self {
            Self::Nv12 | Self::Nv21 | Self::Yuv420 | Self::Yvu420 => half_width.saturating_mul(height_px.div_ceil(2)),
            Self::Nv16 | Self::Nv61 => half_width.saturating_mul(height_px),
            _ => 0,
        };
        first.saturating_add(colours.saturating_mul(2))
    }

    /// Whether the rows of an image without gaps are those of a format of the channels.
    #[must_use]
    pub fn stores_values_as(self, format: PixelFormat) -> bool {
        self.samples() == format.into()
    }

    /// Minimum size of an image, bytes: up to the end of the last row of luma, without the gap after it. A compressed
    /// image has at least a start and an end marker.
    #[must_use]
    pub fn least_bytes(self, [width_px, height_px]: [usize; 2], stride_bytes: usize) -> usize {
        if self.is_compressed() {
            return 4;
        }
        let before_last = height_px.saturating_sub(1).saturating_mul(stride_bytes);
        before_last.saturating_add(self.least_stride_bytes(width_px))
    }
}

impl From<PixelFormat> for SourceFormat {
    fn from(format: PixelFormat) -> Self {
        match format {
            PixelFormat::Grey => Self::Grey,
            PixelFormat::Y10 => Self::Y10,
            PixelFormat::Y12 => Self::Y12,
            PixelFormat::Y14 => Self::Y14,
            PixelFormat::Y16 => Self::Y16,
        }
    }
}
