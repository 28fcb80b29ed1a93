//! The images that the configuration wants from a device.

use fringeflow_pixels::DeviceImages;

/// The images that are wanted from a device.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Format, and arrangement of the views.
    pub images: DeviceImages,
    /// Width and height of a view, pixels.
    pub view_px: [usize; 2],
    /// Frame rate.
    pub rate_hz: f64,
}
