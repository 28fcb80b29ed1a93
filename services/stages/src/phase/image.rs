//! A received image: in shared memory, or copied if its rows have gaps.

use std::rc::Rc;

use fringeflow_base::grey::GreyLevels;
use fringeflow_message::{DropReason, FrameHeader, PixelFormat, flags};
use fringeflow_transport::Received;

/// Grey levels of an image, row by row without gaps. Clones share them.
#[derive(Clone, Debug)]
pub(crate) enum Image {
    /// In shared memory.
    Shared(PixelFormat, Rc<Received<FrameHeader, [u8]>>),
    /// Copied, because its rows have gaps.
    Packed(PixelFormat, Rc<[u8]>),
}

impl Image {
    /// Takes a received image. `size_px` is the image size of the rig, `format` that of the configuration.
    ///
    /// # Errors
    /// The image is damaged, or has another size or format.
    pub(crate) fn from_received(
        received: Received<FrameHeader, [u8]>,
        size_px: [usize; 2],
        format: PixelFormat,
    ) -> Result<Self, DropReason> {
        let header = received.header();
        let (row_bytes, height) = (size_px[0] * format.bytes(), size_px[1]);
        let stride = header.stride_bytes as usize;
        let fits = [header.width_px as usize, header.height_px as usize] == size_px
            && header.pixel_format == format.code()
            && header.flags & flags::DAMAGED == 0
            && stride >= row_bytes
            && stride.checked_mul(height) == Some(received.payload().len());
        if !fits {
            return Err(DropReason::BadImage);
        }
        if stride == row_bytes {
            return Ok(Self::Shared(format, Rc::new(received)));
        }
        let rows = received.payload().chunks_exact(stride).flat_map(|row| &row[..row_bytes]);
        Ok(Self::Packed(format, rows.copied().collect()))
    }

    /// Returns the grey levels.
    pub(crate) fn levels(&self) -> GreyLevels<'_> {
        match self {
            Self::Shared(format, received) => GreyLevels { format: *format, bytes: received.payload() },
            Self::Packed(format, bytes) => GreyLevels { format: *format, bytes },
        }
    }
}
