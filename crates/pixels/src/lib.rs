//! Conversion of camera images to the grey-level images of the channels.
//!
//! ```text
//! image of a device: DeviceImages ──► ImageReader ──► one or two views, tight rows of a PixelFormat
//!   SourceFormat, BayerGrey, StereoLayout   └── region and binning of a Readout, in each view
//! ```
//!
//! No bit of the depth is lost. Of formats with luma and colours only the luma is kept, unscaled: a constant offset
//! such as a black level of 16 does not change the phase. Of red, green and blue the sum R + 2 G + B is kept, with two
//! more bits than each of them.
//!
//! ```
//! use fringeflow::geometry::Readout;
//! use fringeflow_pixels::{DeviceImages, ImageReader, SourceFormat, StereoLayout};
//!
//! // Two rows of four pixels, Y U Y V: the left two of camera 1, the others of camera 2.
//! let yuyv = [10, 128, 20, 128, 11, 128, 21, 128, 30, 128, 40, 128, 31, 128, 41, 128];
//! let images = DeviceImages::new(SourceFormat::Yuyv, None, Some(StereoLayout::SideBySide))?;
//! let mut reader = ImageReader::new(images, Readout::whole([2, 2]))?;
//! let (mut camera1, mut camera2) = ([0; 4], [0; 4]);
//! reader.read_both(&yuyv, 8, [&mut camera1, &mut camera2])?;
//! assert_eq!((camera1, camera2), ([10, 20, 30, 40], [11, 21, 31, 41]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod bayer;
mod device_images;
mod error;
mod format_names;
mod jpeg;
mod jpeg_structure;
mod mosaic;
mod read_out;
mod rows;
mod source_format;
mod stereo;
mod unpack;

#[cfg(test)]
mod tests;

pub use bayer::{BayerGrey, BayerOrder, BayerSamples};
pub use device_images::{DeviceImages, DeviceImagesError};
pub use error::UnpackError;
pub use format_names::UnknownFormat;
pub use read_out::ImageReader;
pub use source_format::SourceFormat;
pub use stereo::StereoLayout;
