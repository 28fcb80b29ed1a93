//! The capture service: takes images from one V4L2 device and publishes them in shared memory.
//!
//! Each device has its own process. If a driver hangs or its process dies, the other camera loses no image. An image is
//! copied once, from the driver's buffer into the memory that the phase service reads. A device that gives the images of
//! both cameras has one process, which publishes both views of each image.

mod camera;
mod camera_channel;
mod capture;
mod captured_cameras;
mod device;
mod incident_log;
mod ioctl;
mod numbering;
mod queue;
mod sample;
mod time_stamps;

pub use captured_cameras::CapturedCameras;
pub use device::{
    CameraError, Control, ControlError, ControlKind, ControlProblem, ExtensionUnitError, ExtensionUnitProblem,
    FindError, FormatError, ListedControl, Listing, MenuItem, OfferedFormat, OfferedSize, OpenError, PrepareError,
    RateError, ReadyCamera, TimingsError, VideoSignal, Wanted, cameras, check_cameras, check_stereo_camera, describe,
    rates_text,
};
pub use ioctl::CallError;
pub use sample::{SampleError, sample_images};

use fringeflow_runtime::{Host, ServiceArgs, ServiceError};

use capture::Capture;

/// Runs the capture service of a device until it is asked to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs, cameras: CapturedCameras) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, cameras.service())?;
    let mut capture = Capture::open(&host, cameras)?;
    loop {
        // Checked before the buffers are read, so that buffers filled before the request are still published.
        let is_last = host.stop.is_requested();
        capture.run_once(&mut host, is_last)?;
        if is_last {
            break;
        }
        if host.is_heartbeat_due() {
            capture.report(&mut host);
        }
        host.check_connections(|_, now_ns| capture.ensure_connected(now_ns));
    }
    capture.report(&mut host);
    Ok(())
}
