//! Sensors and files of a camera that sends images of a format.

use fringeflow_base::grey::PixelFormat;
use fringeflow_pixels::{DeviceImages, SourceFormat};

use super::SimulationError;
use super::colour_filter::{Colour, ColourFilter};

/// Checks that images of this format can be made and have this size.
pub(super) fn check(images: DeviceImages, size_px: [usize; 2]) -> Result<(), SimulationError> {
    let format = images.format();
    if format.is_compressed() {
        return Err(SimulationError::Compressed { format });
    }
    images.image_px(size_px)?;
    Ok(())
}

/// Depth of the sensor behind images of a format.
pub(super) fn sensor_format(format: SourceFormat) -> PixelFormat {
    if format.is_rgb() { PixelFormat::Grey } else { format.pixel_format() }
}

/// Filters of the sensors of a camera that sends this format.
pub(super) fn filters(format: SourceFormat) -> Vec<ColourFilter> {
    match format.bayer_order() {
        Some(order) => vec![ColourFilter::Mosaic(order)],
        None if format.is_rgb() => Colour::ALL.map(ColourFilter::Uniform).to_vec(),
        None => vec![ColourFilter::None],
    }
}

/// Format and arrangement of the files of a dataset; `None` if they are grey images of each camera.
pub(super) fn source_of_files(images: DeviceImages) -> Option<DeviceImages> {
    let is_grey = !images.holds_both_views() && images.format() == images.format().pixel_format().into();
    Some(images).filter(|_| !is_grey)
}
