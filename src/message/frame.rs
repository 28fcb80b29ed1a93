//! One image of one camera.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// V4L2's code of 8-bit grey, `GREY`.
pub const PIXEL_FORMAT_GREY: u32 = u32::from_le_bytes(*b"GREY");

/// Format of the images in the channels: one grey level a pixel, rows without gaps.
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

    /// V4L2's name.
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

    /// V4L2's code.
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

    /// The format of a V4L2 code; `None` for one that is none of these.
    #[must_use]
    pub fn of(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }

    /// Bits of a grey level.
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

    /// Bytes from one pixel to the next.
    #[must_use]
    pub fn bytes(self) -> usize {
        if self == Self::Grey { 1 } else { 2 }
    }
}

/// Bits of [`FrameHeader::flags`].
pub mod flags {
    /// The driver marked the image as damaged.
    pub const DAMAGED: u32 = 1;
    /// `exposure_start_ns` was reckoned from the end of the exposure or of the transfer.
    pub const START_RECKONED: u32 = 2;
    /// The image comes from a recording.
    pub const REPLAYED: u32 = 4;
}

/// Describes the image that travels with it: `height_px` rows of `stride_bytes`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.FrameHeader.1")]
pub struct FrameHeader {
    /// Start of the camera's stream; images of different sessions never meet in a window.
    pub session: u64,
    /// Number that the driver gave the image; gaps are images the camera lost.
    pub sequence: u64,
    /// Images this channel has carried before.
    pub published: u64,
    /// Start of the exposure.
    pub exposure_start_ns: u64,
    /// When the image had reached this machine.
    pub received_ns: u64,
    /// Duration of the exposure, nanoseconds; 0 if unknown.
    pub exposure_ns: u64,
    /// Width, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// Bytes from one row to the next.
    pub stride_bytes: u32,
    /// V4L2 code of the pixel format.
    pub pixel_format: u32,
    /// See [`flags`].
    pub flags: u32,
    /// 1 or 2.
    pub camera: u32,
}
