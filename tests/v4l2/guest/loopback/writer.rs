//! Writes images to a loopback device, which delivers them as a camera.

use std::io::Write;
use std::os::fd::BorrowedFd;

use rustix::io::{FdFlags, fcntl_setfd};
use v4l::video::Output;
use v4l::{Device, Format, FourCC};

/// Writer of a device. While it exists, readers find its format.
pub(crate) struct Writer {
    device: Device,
}

impl Writer {
    /// Opens a device for images of this size and format.
    pub(crate) fn open(path: &str, [width, height]: [u32; 2], format: &[u8; 4]) -> Self {
        let device = Device::with_path(path).unwrap();
        keep_from_children(&device);
        let wanted = Format::new(width, height, FourCC::new(format));
        let set = device.set_format(&wanted).unwrap();
        assert_eq!((set.width, set.height, set.fourcc), (width, height, wanted.fourcc));
        Self { device }
    }

    /// Writes an image.
    pub(crate) fn show(&mut self, image: &[u8]) {
        assert_eq!(self.device.write(image).unwrap(), image.len());
    }
}

/// Closes the device in child processes. By default they would inherit it, and it would stay in use.
#[allow(unsafe_code)]
fn keep_from_children(device: &Device) {
    // SAFETY: the descriptor is open as long as the device, which is borrowed for longer.
    let fd = unsafe { BorrowedFd::borrow_raw(device.handle().fd()) };
    fcntl_setfd(fd, FdFlags::CLOEXEC).unwrap();
}
