//! Names and V4L2 codes of the formats.

use super::bayer::BayerOrder::{Bggr, Gbrg, Grbg, Rggb};
use super::bayer::BayerSamples;
use super::source_format::SourceFormat;

/// A name that is not a known format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} is not a readable pixel format; it must be one of {}", known())]
pub struct UnknownFormat {
    /// The name.
    pub name: String,
}

/// Bit of a code: the bytes of a value are in reverse order.
const BIG_ENDIAN: u32 = 1 << 31;

/// Every format with its name, and its name after `V4L2_PIX_FMT_` in the header of the kernel. The name, padded with
/// spaces, is the V4L2 code. The exceptions are in [`SourceFormat::code`].
const TABLE: &[(SourceFormat, &str, &str)] = &[
    (SourceFormat::Grey, "GREY", "GREY"),
    (SourceFormat::Y10, "Y10", "Y10"),
    (SourceFormat::Y12, "Y12", "Y12"),
    (SourceFormat::Y14, "Y14", "Y14"),
    (SourceFormat::Y16, "Y16", "Y16"),
    (SourceFormat::Y16BigEndian, "Y16_BE", "Y16_BE"),
    (SourceFormat::Y012, "Y012", "Y012"),
    (SourceFormat::Y10BitPacked, "Y10B", "Y10BPACK"),
    (SourceFormat::Y10Mipi, "Y10P", "Y10P"),
    (SourceFormat::Y12Mipi, "Y12P", "Y12P"),
    (SourceFormat::Y14Mipi, "Y14P", "Y14P"),
    (SourceFormat::Mono10p, "Mono10p", "Mono10p"),
    (SourceFormat::Mono12p, "Mono12p", "Mono12p"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Grey), "RGGB", "SRGGB8"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Grey), "GRBG", "SGRBG8"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Grey), "GBRG", "SGBRG8"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Grey), "BA81", "SBGGR8"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y10), "RG10", "SRGGB10"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y10), "BA10", "SGRBG10"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y10), "GB10", "SGBRG10"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y10), "BG10", "SBGGR10"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y10Mipi), "pRAA", "SRGGB10P"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y10Mipi), "pgAA", "SGRBG10P"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y10Mipi), "pGAA", "SGBRG10P"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y10Mipi), "pBAA", "SBGGR10P"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Mono10p), "BayerRG10p", "BayerRG10p"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Mono10p), "BayerGR10p", "BayerGR10p"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Mono10p), "BayerGB10p", "BayerGB10p"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Mono10p), "BayerBG10p", "BayerBG10p"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y12), "RG12", "SRGGB12"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y12), "BA12", "SGRBG12"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y12), "GB12", "SGBRG12"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y12), "BG12", "SBGGR12"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y12Mipi), "pRCC", "SRGGB12P"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y12Mipi), "pgCC", "SGRBG12P"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y12Mipi), "pGCC", "SGBRG12P"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y12Mipi), "pBCC", "SBGGR12P"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Mono12p), "BayerRG12p", "BayerRG12p"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Mono12p), "BayerGR12p", "BayerGR12p"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Mono12p), "BayerGB12p", "BayerGB12p"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Mono12p), "BayerBG12p", "BayerBG12p"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y14), "RG14", "SRGGB14"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y14), "GR14", "SGRBG14"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y14), "GB14", "SGBRG14"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y14), "BG14", "SBGGR14"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y14Mipi), "pREE", "SRGGB14P"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y14Mipi), "pgEE", "SGRBG14P"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y14Mipi), "pGEE", "SGBRG14P"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y14Mipi), "pBEE", "SBGGR14P"),
    (SourceFormat::Bayer(Rggb, BayerSamples::Y16), "RG16", "SRGGB16"),
    (SourceFormat::Bayer(Grbg, BayerSamples::Y16), "GR16", "SGRBG16"),
    (SourceFormat::Bayer(Gbrg, BayerSamples::Y16), "GB16", "SGBRG16"),
    (SourceFormat::Bayer(Bggr, BayerSamples::Y16), "BYR2", "SBGGR16"),
    (SourceFormat::Y8Interleaved, "Y8I", "Y8I"),
    (SourceFormat::Y12Interleaved, "Y12I", "Y12I"),
    (SourceFormat::Y16Interleaved, "Y16I", "Y16I"),
    (SourceFormat::Rgb24, "RGB3", "RGB24"),
    (SourceFormat::Bgr24, "BGR3", "BGR24"),
    (SourceFormat::Xbgr32, "XR24", "XBGR32"),
    (SourceFormat::Abgr32, "AR24", "ABGR32"),
    (SourceFormat::Bgr32, "BGR4", "BGR32"),
    (SourceFormat::Rgbx32, "XB24", "RGBX32"),
    (SourceFormat::Rgba32, "AB24", "RGBA32"),
    (SourceFormat::Bgrx32, "RX24", "BGRX32"),
    (SourceFormat::Bgra32, "RA24", "BGRA32"),
    (SourceFormat::Xrgb32, "BX24", "XRGB32"),
    (SourceFormat::Argb32, "BA24", "ARGB32"),
    (SourceFormat::Rgb32, "RGB4", "RGB32"),
    (SourceFormat::Yuyv, "YUYV", "YUYV"),
    (SourceFormat::Yvyu, "YVYU", "YVYU"),
    (SourceFormat::Uyvy, "UYVY", "UYVY"),
    (SourceFormat::Vyuy, "VYUY", "VYUY"),
    (SourceFormat::Nv12, "NV12", "NV12"),
    (SourceFormat::Nv21, "NV21", "NV21"),
    (SourceFormat::Nv16, "NV16", "NV16"),
    (SourceFormat::Nv61, "NV61", "NV61"),
    (SourceFormat::Yuv420, "YU12", "YUV420"),
    (SourceFormat::Yvu420, "YV12", "YVU420"),
    (SourceFormat::Nv12Planes, "NM12", "NV12M"),
    (SourceFormat::Nv21Planes, "NM21", "NV21M"),
    (SourceFormat::Yuv420Planes, "YM12", "YUV420M"),
    (SourceFormat::Yvu420Planes, "YM21", "YVU420M"),
    (SourceFormat::Mjpeg, "MJPG", "MJPEG"),
    (SourceFormat::Jpeg, "JPEG", "JPEG"),
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

    /// FourCC code in V4L2. It has none for the packing of GenICam: drivers that pass on the bytes of such a camera use
    /// the code of the MIPI packing with the same depth.
    #[must_use]
    pub fn code(self) -> u32 {
        match self {
            Self::Y16BigEndian => Self::Y16.code() | BIG_ENDIAN,
            Self::Mono10p => Self::Y10Mipi.code(),
            Self::Mono12p => Self::Y12Mipi.code(),
            Self::Bayer(order, BayerSamples::Mono10p) => Self::Bayer(order, BayerSamples::Y10Mipi).code(),
            Self::Bayer(order, BayerSamples::Mono12p) => Self::Bayer(order, BayerSamples::Y12Mipi).code(),
            _ => {
                let mut letters = [b' '; 4];
                letters.iter_mut().zip(self.name().bytes()).for_each(|(letter, byte)| *letter = byte);
                u32::from_le_bytes(letters)
            }
        }
    }

    /// Returns the format with this V4L2 code; `None` for an unknown code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }

    /// Name: the letters of the V4L2 code, as listed by `v4l2-ctl --list-formats`; for the packing of GenICam, its name
    /// there.
    #[must_use]
    pub fn name(self) -> &'static str {
        TABLE.iter().find(|(format, ..)| *format == self).map_or("", |(_, name, _)| name)
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
        let known = TABLE.iter().find(|(_, short, long)| [*short, *long].contains(&name));
        known.map(|(format, ..)| *format).ok_or_else(|| UnknownFormat { name: name.to_owned() })
    }
}

/// Returns the names of all formats.
fn known() -> String {
    SourceFormat::ALL.map(SourceFormat::name).join(", ")
}
