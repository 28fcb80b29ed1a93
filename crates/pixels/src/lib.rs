//! What cameras send, made into the images of the channels.
//!
//! In: the bytes of an image as a V4L2 driver delivers them, in a [`SourceFormat`], rows with gaps as they may be. Out:
//! tight rows of grey levels in a [`PixelFormat`](fringeflow_base::grey::PixelFormat), no bit less deep than the camera sent
//! them, of the whole image or of what a [`Readout`](fringeflow::geometry::Readout) leaves of it. Of colour formats the luma is
//! taken, as it is: whether black is 0 or 16 does not matter to a phase.
//!
//! Cost: the one copy of an image on its way from the driver's buffer to shared memory. Formats that need no unpacking
//! cost as much as copying memory.

#![forbid(unsafe_code)]

mod jpeg;
mod jpeg_structure;
mod read_out;
mod rows;
mod source_format;
mod unpack;

#[cfg(test)]
mod tests;

pub use read_out::ImageReader;
pub use source_format::{SourceFormat, UnknownFormat};
pub use unpack::{UnpackError, unpack};
