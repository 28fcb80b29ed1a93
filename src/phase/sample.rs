//! What a camera stores for a pixel, as the kernels read it: where it lies, without a copy.

use crate::grey::PixelFormat;

/// A stored value.
pub(super) trait Sample: Copy + Send + Sync + bytemuck::Pod {
    /// Its grey level; `grey_per_value` is that of its format, less where its image is brighter than the others of a window.
    fn grey(self, grey_per_value: f32) -> f32;

    /// The value from which on a grey level is at least `grey`.
    fn from_grey(grey: u8, format: PixelFormat) -> Self;

    /// Whether it is less than another.
    fn is_below(self, limit: Self) -> bool;
}

/// 8 bits.
impl Sample for u8 {
    fn grey(self, grey_per_value: f32) -> f32 {
        f32::from(self) * grey_per_value
    }

    fn from_grey(grey: u8, _: PixelFormat) -> Self {
        grey
    }

    fn is_below(self, limit: Self) -> bool {
        self < limit
    }
}

/// More than 8 bits, little endian; at any address.
impl Sample for [u8; 2] {
    fn grey(self, grey_per_value: f32) -> f32 {
        f32::from(u16::from_le_bytes(self)) * grey_per_value
    }

    fn from_grey(grey: u8, format: PixelFormat) -> Self {
        (u16::from(grey) << (format.bits() - 8)).to_le_bytes()
    }

    fn is_below(self, limit: Self) -> bool {
        u16::from_le_bytes(self) < u16::from_le_bytes(limit)
    }
}
