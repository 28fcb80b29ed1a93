//! Conversion of camera images to the grey-level images of the channels.
//!
//! ```text
//! V4L2 buffer in a SourceFormat ──► unpack ──► tight rows of a PixelFormat
//!      rows with gaps                  └──► ImageReader: region and binning of a Readout ──► the same
//! ```
//!
//! No bit of the depth is lost. Of colour formats only the luma is kept, unscaled: a constant offset such as a black
//! level of 16 does not change the phase.
//!
//! ```
//! use fringeflow_pixels::{SourceFormat, unpack};
//!
//! // Two rows of two pixels, Y U Y V.
//! let yuyv = [10, 128, 20, 128, 30, 128, 40, 128];
//! let mut grey = [0; 4];
//! unpack(SourceFormat::Yuyv, &yuyv, 4, [2, 2], &mut grey)?;
//! assert_eq!(grey, [10, 20, 30, 40]);
//! # Ok::<(), fringeflow_pixels::UnpackError>(())
//! ```

#![forbid(unsafe_code)]

mod error;
mod jpeg;
mod jpeg_structure;
mod read_out;
mod rows;
mod source_format;
mod unpack;

#[cfg(test)]
mod tests;

pub use error::UnpackError;
pub use read_out::ImageReader;
pub use source_format::{SourceFormat, UnknownFormat};
pub use unpack::unpack;
