//! A few images of a device, for a check before a run. In: its settings. Out: grey images of each view. The device is
//! closed again.

use std::time::{Duration, Instant};

use fringeflow_config::V4l2Camera;
use fringeflow_dataset::GreyImage;
use fringeflow_pixels::ImageReader;

use crate::camera::Camera;
use crate::device::{CameraError, Wanted};

/// Wait before a device that is busy is tried again.
const RETRY: Duration = Duration::from_millis(50);

/// Why no images were sampled.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// The device cannot be used.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Too few images arrived.
    #[error("{arrived} of {wanted} images arrived within {timeout:?}; does the trigger run?")]
    TimedOut {
        /// Images that arrived.
        arrived: usize,
        /// Images that were wanted.
        wanted: usize,
        /// Time that was waited.
        timeout: Duration,
    },
    /// No grey images can be made of the format.
    #[error(transparent)]
    Format(#[from] fringeflow_pixels::DeviceImagesError),
    /// An image is damaged.
    #[error("an image is damaged: {0}")]
    Damaged(#[from] fringeflow_pixels::UnpackError),
}

/// Takes `count` images in a row, each with `views` views. Returns the images of each view.
///
/// # Errors
/// [`SampleError`].
pub fn sample_images(
    camera: &V4l2Camera,
    wanted: &Wanted,
    reader: &mut ImageReader,
    (views, count): (usize, usize),
    timeout: Duration,
) -> Result<Vec<Vec<GreyImage>>, SampleError> {
    let mut camera = Camera::new(camera.clone(), *wanted);
    let mut sampled = vec![Vec::with_capacity(count); views];
    let start = Instant::now();
    while sampled.first().is_some_and(|images| images.len() < count) {
        let Some(rest) = timeout.checked_sub(start.elapsed()) else {
            return Err(SampleError::TimedOut { arrived: sampled[0].len(), wanted: count, timeout });
        };
        camera.ensure_streaming()?;
        if !camera.wait(rest) {
            std::thread::sleep(rest.min(RETRY));
        }
        let Some(image) = camera.next_image() else { continue };
        let stride_bytes = camera.prepared().map_or(0, |prepared| prepared.stride_bytes);
        for (view, images) in sampled.iter_mut().enumerate() {
            images.push(grey_image(reader, view, camera.bytes(&image), stride_bytes)?);
        }
        camera.give_back(image);
    }
    Ok(sampled)
}

fn grey_image(
    reader: &mut ImageReader,
    view: usize,
    bytes: &[u8],
    stride_bytes: usize,
) -> Result<GreyImage, fringeflow_pixels::UnpackError> {
    let ([width, height], format) = (reader.image_size_px(), reader.pixel_format());
    let mut pixels = vec![0; reader.image_bytes()];
    reader.read(view, bytes, stride_bytes, &mut pixels)?;
    Ok(GreyImage { width, height, format, pixels })
}
