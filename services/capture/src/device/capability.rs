//! What a device is: who drives it, where it sits, and whether images come out of it.

use v4l::v4l_sys::{
    V4L2_CAP_DEVICE_CAPS, V4L2_CAP_META_CAPTURE, V4L2_CAP_META_OUTPUT, V4L2_CAP_STREAMING, V4L2_CAP_VIDEO_CAPTURE,
    V4L2_CAP_VIDEO_CAPTURE_MPLANE, V4L2_CAP_VIDEO_M2M, V4L2_CAP_VIDEO_M2M_MPLANE, V4L2_CAP_VIDEO_OUTPUT,
    V4L2_CAP_VIDEO_OUTPUT_MPLANE, v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE,
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE as CAPTURE_MPLANE,
};

use crate::ioctl::{CallError, Device, QUERYCAP, zeroed};

/// Driver of devices that carry the images of another program.
const LOOPBACK: &str = "v4l2 loopback";

/// What a device says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Capability {
    /// Name of the driver.
    pub(crate) driver: String,
    /// Name of the device.
    pub(crate) card: String,
    /// Where it sits.
    pub(crate) bus_info: String,
    /// `V4L2_CAP_…` of this very node, not of the whole device.
    pub(crate) node: u32,
}

impl Capability {
    /// Asks a device.
    ///
    /// # Errors
    /// It is no V4L2 device, or it is gone.
    pub(crate) fn read(device: &Device) -> Result<Self, CallError> {
        let mut answer = zeroed();
        device.call(&QUERYCAP, &mut answer)?;
        let has_own = answer.capabilities & V4L2_CAP_DEVICE_CAPS != 0;
        Ok(Self {
            driver: text(&answer.driver),
            card: text(&answer.card),
            bus_info: text(&answer.bus_info),
            node: if has_own { answer.device_caps } else { answer.capabilities },
        })
    }

    /// The kind of its buffers; what it is instead where no images come out of it as a stream.
    ///
    /// # Errors
    /// The words for what it is.
    pub(crate) fn stream(&self) -> Result<u32, &'static str> {
        let is = |flags| self.node & flags != 0;
        if is(V4L2_CAP_VIDEO_M2M | V4L2_CAP_VIDEO_M2M_MPLANE) {
            return Err("a converter from memory to memory");
        }
        let kind = match () {
            () if is(V4L2_CAP_VIDEO_CAPTURE) => CAPTURE,
            () if is(V4L2_CAP_VIDEO_CAPTURE_MPLANE) => CAPTURE_MPLANE,
            () if is(V4L2_CAP_META_CAPTURE | V4L2_CAP_META_OUTPUT) => {
                return Err("a node for data about images; another node of the same camera sends the images");
            }
            () if self.is_unfed() => return Err("a loopback device that no program writes into"),
            () if is(V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_VIDEO_OUTPUT_MPLANE) => return Err("an output"),
            () => return Err("not a camera"),
        };
        if is(V4L2_CAP_STREAMING) { Ok(kind) } else { Err("a device that cannot stream into mapped buffers") }
    }

    /// Whether it is a camera, or will be one when a program writes into it.
    pub(crate) fn is_camera(&self) -> bool {
        self.stream().is_ok() || self.is_unfed()
    }

    /// Whether it is a loopback device that captures nothing: a program that writes into it may turn it into a camera.
    pub(crate) fn is_unfed(&self) -> bool {
        self.is_loopback() && self.node & V4L2_CAP_VIDEO_CAPTURE == 0
    }

    /// Whether it carries the images of another program.
    pub(crate) fn is_loopback(&self) -> bool {
        self.driver == LOOPBACK
    }
}

/// A text of a driver up to its end, whatever it consists of.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let shown = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    String::from_utf8_lossy(&bytes[..end]).trim().chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(driver: &str, flags: u32) -> Capability {
        Capability { driver: driver.into(), card: String::new(), bus_info: String::new(), node: flags }
    }

    #[test]
    fn only_capture_nodes_that_stream_are_cameras() {
        let camera = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        assert_eq!(node("uvcvideo", camera).stream(), Ok(1));
        assert_eq!(node("vivid", V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING).stream(), Ok(9));
        // The second node of every UVC camera.
        assert!(
            node("uvcvideo", V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING).stream().unwrap_err().contains("data about")
        );
        assert_eq!(node("vivid", V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING).stream(), Err("an output"));
        assert!(node("codec", camera | V4L2_CAP_VIDEO_M2M).stream().unwrap_err().contains("converter"));
        assert!(node("old", V4L2_CAP_VIDEO_CAPTURE).stream().unwrap_err().contains("cannot stream"));
        assert_eq!(node("radio", V4L2_CAP_STREAMING).stream(), Err("not a camera"));
        assert!(node("uvcvideo", camera).is_camera() && !node("radio", V4L2_CAP_STREAMING).is_camera());
    }

    #[test]
    fn a_loopback_device_waits_for_its_writer() {
        let unfed = node(LOOPBACK, V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING);
        assert!(unfed.is_camera() && unfed.is_unfed() && unfed.stream().unwrap_err().contains("no program writes"));
        assert!(!node(LOOPBACK, V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING).is_unfed());
        assert!(!node("vivid", V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING).is_unfed());
    }

    #[test]
    fn texts_of_drivers_are_readable_whatever_they_are() {
        assert_eq!(text(b"USB Camera\0\0rest"), "USB Camera");
        assert_eq!(text(b"no end"), "no end");
        assert_eq!(text(b" a\x1b[2J\xff "), "a\u{fffd}[2J\u{fffd}");
        assert_eq!(text(b""), "");
    }
}
