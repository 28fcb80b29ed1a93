//! One image of one camera.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Bits of [`FrameHeader::flags`].
pub mod flags {
    /// The driver marked the image as damaged.
    pub const DAMAGED: u32 = 1;
    /// `exposure_start_ns` was computed from the end of the exposure or of the transfer.
    pub const START_RECKONED: u32 = 2;
    /// The image comes from a recording.
    pub const REPLAYED: u32 = 4;
}

/// Describes the image in the payload: `height_px` rows of `stride_bytes`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.FrameHeader.1")]
pub struct FrameHeader {
    /// Identifies the start of the camera stream. Images of different sessions never share a window.
    pub session: u64,
    /// Number of the image, from the driver. Gaps are images that the camera lost.
    pub sequence: u64,
    /// Number of images published on the channel before this one.
    pub published: u64,
    /// Start of the exposure.
    pub exposure_start_ns: u64,
    /// Arrival of the image on this computer.
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
