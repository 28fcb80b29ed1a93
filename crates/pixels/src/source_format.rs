//! Formats in which V4L2 cameras send grey levels, and their sizes in bytes.

use fringeflow_base::grey::PixelFormat;

/// A V4L2 pixel format with grey levels, or with luma and colours.
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

/// A name that is not a known format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} is not a readable pixel format; it must be one of {}", known())]
pub struct UnknownFormat {
    /// The name.
    pub name: String,
}

/// Every format with the four letters of its V4L2 code, at the index of its discriminant.
/// [`SourceFormat::Y16BigEndian`] has the letters of [`SourceFormat::Y16`]; its code has the highest bit set.
const TABLE: [(SourceFormat, &[u8; 4]); 27] = [
    (SourceFormat::Grey, b"GREY"),
    (SourceFormat::Y10, b"Y10 "),
    (SourceFormat::Y12, b"Y12 "),
    (SourceFormat::Y14, b"Y14 "),
    (SourceFormat::Y16, b"Y16 "),
    (SourceFormat::Y16BigEndian, b"Y16 "),
    (SourceFormat::Y012, b"Y012"),
    (SourceFormat::Y10BitPacked, b"Y10B"),
    (SourceFormat::Y10Mipi, b"Y10P"),
    (SourceFormat::Y12Mipi, b"Y12P"),
    (SourceFormat::Y14Mipi, b"Y14P"),
    (SourceFormat::Yuyv, b"YUYV"),
    (SourceFormat::Yvyu, b"YVYU"),
    (SourceFormat::Uyvy, b"UYVY"),
    (SourceFormat::Vyuy, b"VYUY"),
    (SourceFormat::Nv12, b"NV12"),
    (SourceFormat::Nv21, b"NV21"),
    (SourceFormat::Nv16, b"NV16"),
    (SourceFormat::Nv61, b"NV61"),
    (SourceFormat::Yuv420, b"YU12"),
    (SourceFormat::Yvu420, b"YV12"),
    (SourceFormat::Nv12Planes, b"NM12"),
    (SourceFormat::Nv21Planes, b"NM21"),
    (SourceFormat::Yuv420Planes, b"YM12"),
    (SourceFormat::Yvu420Planes, b"YM21"),
    (SourceFormat::Mjpeg, b"MJPG"),
    (SourceFormat::Jpeg, b"JPEG"),
];

impl SourceFormat {
    /// All formats.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::Grey; TABLE.len()];
        let mut index = 0;
        while index < all.len() {
            all[index] = TABLE[index].0;
            index += 1;
        }
        all
    };

    fn letters(self) -> &'static [u8; 4] {
        TABLE[self as usize].1
    }

    /// FourCC code in V4L2.
    #[must_use]
    pub fn code(self) -> u32 {
        let big_endian = if self == Self::Y16BigEndian { 1 << 31 } else { 0 };
        u32::from_le_bytes(*self.letters()) | big_endian
    }

    /// Returns the format with this V4L2 code; `None` for an unknown code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }

    /// Name: the letters of the V4L2 code, as listed by `v4l2-ctl --list-formats`.
    #[must_use]
    pub fn name(self) -> &'static str {
        if self == Self::Y16BigEndian {
            return "Y16_BE";
        }
        std::str::from_utf8(self.letters()).unwrap_or_default().trim_end()
    }

    /// Name after `V4L2_PIX_FMT_` in the header of the kernel, if it differs.
    fn header_name(self) -> Option<&'static str> {
        match self {
            Self::Y10BitPacked => Some("Y10BPACK"),
            Self::Yuv420 => Some("YUV420"),
            Self::Yvu420 => Some("YVU420"),
            Self::Nv12Planes => Some("NV12M"),
            Self::Nv21Planes => Some("NV21M"),
            Self::Yuv420Planes => Some("YUV420M"),
            Self::Yvu420Planes => Some("YVU420M"),
            Self::Mjpeg => Some("MJPEG"),
            _ => None,
        }
    }

    /// Format of the unpacked images.
    #[must_use]
    pub fn pixel_format(self) -> PixelFormat {
        match self {
            Self::Y10 | Self::Y10BitPacked | Self::Y10Mipi => PixelFormat::Y10,
            Self::Y12 | Self::Y012 | Self::Y12Mipi => PixelFormat::Y12,
            Self::Y14 | Self::Y14Mipi => PixelFormat::Y14,
            Self::Y16 | Self::Y16BigEndian => PixelFormat::Y16,
            _ => PixelFormat::Grey,
        }
    }

    /// Whether the images are compressed, so that the length of a row is unknown.
    #[must_use]
    pub fn is_compressed(self) -> bool {
        matches!(self, Self::Mjpeg | Self::Jpeg)
    }

    /// The smallest group of pixels that fills whole bytes: number of pixels, number of bytes.
    fn group(self) -> [usize; 2] {
        match self {
            Self::Y10 | Self::Y12 | Self::Y14 | Self::Y16 | Self::Y16BigEndian | Self::Y012 => [1, 2],
            Self::Y10BitPacked | Self::Y10Mipi => [4, 5],
            Self::Y12Mipi => [2, 3],
            Self::Y14Mipi => [4, 7],
            Self::Yuyv | Self::Yvyu | Self::Uyvy | Self::Vyuy => [2, 4],
            _ => [1, 1],
        }
    }

    /// Size of a row without a gap, bytes; 0 for compressed formats.
    #[must_use]
    pub fn least_stride_bytes(self, width_px: usize) -> usize {
        let [pixels, bytes] = self.group();
        if self.is_compressed() { 0 } else { width_px.div_ceil(pixels).saturating_mul(bytes) }
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

impl std::fmt::Display for SourceFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for SourceFormat {
    type Err = UnknownFormat;

    /// Parses a name from `v4l2-ctl` or from the header of the kernel.
    fn from_str(name: &str) -> Result<Self, UnknownFormat> {
        let known = Self::ALL.into_iter().find(|format| format.name() == name || format.header_name() == Some(name));
        known.ok_or_else(|| UnknownFormat { name: name.to_owned() })
    }
}

/// Returns the names of all formats.
fn known() -> String {
    SourceFormat::ALL.map(SourceFormat::name).join(", ")
}
