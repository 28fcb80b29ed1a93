//! An image as it came, held in shared memory, or packed where its rows have gaps.

use std::rc::Rc;

use fringeflow::message::{DropReason, FrameHeader, PIXEL_FORMAT_GREY, flags};
use fringeflow::transport::Received;

/// Grey levels of an image, row by row without gaps; clones share them.
#[derive(Clone, Debug)]
pub(crate) enum Image {
    /// In shared memory.
    Shared(Rc<Received<FrameHeader, [u8]>>),
    /// Copied, since its rows have gaps.
    Packed(Rc<[u8]>),
}

impl Image {
    /// Takes an image of the size that the rig has.
    ///
    /// # Errors
    /// It is damaged, or of another size or format.
    pub(crate) fn of(received: Received<FrameHeader, [u8]>, size_px: [usize; 2]) -> Result<Self, DropReason> {
        let header = received.header();
        let [width, height] = size_px;
        let stride = header.stride_bytes as usize;
        let fits = [header.width_px as usize, header.height_px as usize] == size_px
            && header.pixel_format == PIXEL_FORMAT_GREY
            && header.flags & flags::DAMAGED == 0
            && stride >= width
            && stride.checked_mul(height) == Some(received.payload().len());
        if !fits {
            return Err(DropReason::BadImage);
        }
        if stride == width {
            return Ok(Self::Shared(Rc::new(received)));
        }
        let rows = received.payload().chunks_exact(stride).flat_map(|row| &row[..width]);
        Ok(Self::Packed(rows.copied().collect()))
    }

    /// The grey levels.
    pub(crate) fn pixels(&self) -> &[u8] {
        match self {
            Self::Shared(received) => received.payload(),
            Self::Packed(pixels) => pixels,
        }
    }
}
