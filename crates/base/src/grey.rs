//! Grey levels: storage and unit.
//!
//! Grey levels have the same unit at every bit depth: that of 8-bit images. A value of b bits is value · 2^(8 − b) grey
//! levels. So thresholds, modulation, mean and noise are comparable between cameras; deeper images only have finer
//! fractions.

/// Format of the images in the channels: one grey level per pixel, rows without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelFormat {
    /// 8 bits.
    #[default]
    Grey,
    /// 10 bits in the low bits of 16, little endian.
    Y10,
    /// 12 bits in the low bits of 16, little endian.
    Y12,
    /// 14 bits in the low bits of 16, little endian.
    Y14,
    /// 16 bits, little endian.
    Y16,
}

impl PixelFormat {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::Grey, Self::Y10, Self::Y12, Self::Y14, Self::Y16];

    /// Name in V4L2.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Grey => "GREY",
            Self::Y10 => "Y10",
            Self::Y12 => "Y12",
            Self::Y14 => "Y14",
            Self::Y16 => "Y16",
        }
    }

    /// FourCC code in V4L2.
    #[must_use]
    pub fn code(self) -> u32 {
        u32::from_le_bytes(*match self {
            Self::Grey => b"GREY",
            Self::Y10 => b"Y10 ",
            Self::Y12 => b"Y12 ",
            Self::Y14 => b"Y14 ",
            Self::Y16 => b"Y16 ",
        })
    }

    /// Returns the format with this V4L2 code; `None` for an unknown code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }

    /// Returns the format with this number of bits per value; `None` if there is none.
    #[must_use]
    pub fn from_bits(bits: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.bits() == bits)
    }

    /// Number of bits of a value.
    #[must_use]
    pub fn bits(self) -> u8 {
        match self {
            Self::Grey => 8,
            Self::Y10 => 10,
            Self::Y12 => 12,
            Self::Y14 => 14,
            Self::Y16 => 16,
        }
    }

    /// Number of bytes of a pixel.
    #[must_use]
    pub fn bytes(self) -> usize {
        if self == Self::Grey { 1 } else { 2 }
    }

    /// Grey levels from one value to the next: 2^(8 − bits).
    #[must_use]
    pub fn grey_per_value(self) -> f32 {
        1.0 / (1_u32 << (self.bits() - 8)) as f32
    }

    /// Format of binned images. A binned value is the sum over a square with sides of `binning` pixels; with 16 bits,
    /// the mean.
    #[must_use]
    pub fn binned(self, binning: usize) -> Self {
        match (binning, self) {
            (1, format) => format,
            (_, Self::Grey) => Self::Y10,
            (_, Self::Y10) => Self::Y12,
            (_, Self::Y12) => Self::Y14,
            (_, Self::Y14 | Self::Y16) => Self::Y16,
        }
    }

    /// The largest value.
    #[must_use]
    pub fn max_value(self) -> u16 {
        u16::MAX >> (16 - self.bits())
    }
}

/// The values of an image in memory, row by row without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GreyLevels<'a> {
    /// Format of the values.
    pub format: PixelFormat,
    /// Bytes of the values.
    pub bytes: &'a [u8],
}

impl<'a> GreyLevels<'a> {
    /// Creates 8-bit grey levels.
    #[must_use]
    pub fn eight_bit(bytes: &'a [u8]) -> Self {
        Self { format: PixelFormat::Grey, bytes }
    }

    /// Number of whole pixels.
    #[must_use]
    pub fn pixels(self) -> usize {
        self.bytes.len() / self.format.bytes()
    }

    /// Grey level of a pixel. The index must be less than [`Self::pixels`].
    #[must_use]
    pub fn grey(self, pixel: usize) -> f32 {
        match self.format {
            PixelFormat::Grey => f32::from(self.bytes[pixel]),
            deep => {
                let value = u16::from_le_bytes([self.bytes[2 * pixel], self.bytes[2 * pixel + 1]]);
                f32::from(value) * deep.grey_per_value()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_levels_have_the_same_unit_at_every_depth() {
        let grey = |format, bytes: &[u8]| GreyLevels { format, bytes }.grey(0);
        assert_eq!(grey(PixelFormat::Grey, &[200]), 200.0);
        assert_eq!(grey(PixelFormat::Y10, &[0x23, 0x03]), 200.75);
        assert_eq!(grey(PixelFormat::Y12, &[0xff, 0x0f]), 255.9375);
        assert_eq!(grey(PixelFormat::Y14, &[0x01, 0x32]), 200.0 + 1.0 / 64.0);
        assert_eq!(grey(PixelFormat::Y16, &[0x01, 0xc8]), 200.0 + 1.0 / 256.0);
        assert_eq!(PixelFormat::ALL.map(PixelFormat::max_value), [255, 1023, 4095, 16383, 65535]);
        for format in PixelFormat::ALL {
            assert_eq!(PixelFormat::from_code(format.code()), Some(format));
            assert_eq!(PixelFormat::from_bits(format.bits()), Some(format));
        }
        assert_eq!(PixelFormat::from_bits(9), None);
    }
}
