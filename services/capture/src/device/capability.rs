//! Identity of a device node: driver, name, `bus_info`, and whether it delivers images.

use v4l::v4l_sys::{
    V4L2_CAP_DEVICE_CAPS, V4L2_CAP_META_CAPTURE, V4L2_CAP_META_OUTPUT, V4L2_CAP_STREAMING, V4L2_CAP_VIDEO_CAPTURE,
    V4L2_CAP_VIDEO_CAPTURE_MPLANE, V4L2_CAP_VIDEO_M2M, V4L2_CAP_VIDEO_M2M_MPLANE, V4L2_CAP_VIDEO_OUTPUT,
    V4L2_CAP_VIDEO_OUTPUT_MPLANE, v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE,
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE as CAPTURE_MPLANE,
};

use crate::ioctl::{CallError, Device, QUERYCAP, zeroed};

/// Name of the loopback driver, whose devices carry the images of another program.
const LOOPBACK: &str = "v4l2 loopback";

/// What a device node reports about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Capability {
    /// Name of the driver.
    pub(crate) driver: String,
    /// Name of the device.
    pub(crate) card: String,
    /// Where the device is connected.
    pub(crate) bus_info: String,
    /// `V4L2_CAP_…` of this node, not of the whole device.
    pub(crate) node: u32,
}

impl Capability {
    /// Queries a device node.
    ///
    /// # Errors
    /// It is not a V4L2 device, or it is gone.
    pub(crate) fn read(device: &Device) -> Result<Self, CallError> {
        let mut answer = zeroed();
        device.call(&QUERYCAP, &mut answer)?;
        let has_node_capabilities = answer.capabilities & V4L2_CAP_DEVICE_CAPS != 0;
        Ok(Self {
            driver: text(&answer.driver),
            card: text(&answer.card),
            bus_info: text(&answer.bus_info),
            node: if has_node_capabilities { answer.device_caps } else { answer.capabilities },
        })
    }

    /// Returns the `v4l2_buf_type` of a node that streams images.
    ///
    /// # Errors
    /// What the node is instead, in words.
    pub(crate) fn buffer_type(&self) -> Result<u32, &'static str> {
        let is = |flags| self.node & flags != 0;
        if is(V4L2_CAP_VIDEO_M2M | V4L2_CAP_VIDEO_M2M_MPLANE) {
            return Err("a memory-to-memory device");
        }
        let kind = match () {
            () if is(V4L2_CAP_VIDEO_CAPTURE) => CAPTURE,
            () if is(V4L2_CAP_VIDEO_CAPTURE_MPLANE) => CAPTURE_MPLANE,
            () if is(V4L2_CAP_META_CAPTURE | V4L2_CAP_META_OUTPUT) => {
                return Err("a metadata node; another node of the same camera sends the images");
            }
            () if self.lacks_writer() => return Err("a loopback device that no program writes into"),
            () if is(V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_VIDEO_OUTPUT_MPLANE) => return Err("an output device"),
            () => return Err("not a camera"),
        };
        if is(V4L2_CAP_STREAMING) { Ok(kind) } else { Err("a device that cannot stream into mapped buffers") }
    }

    /// Whether it is a camera, or becomes one when a program writes into it.
    pub(crate) fn is_camera(&self) -> bool {
        self.buffer_type().is_ok() || self.lacks_writer()
    }

    /// Whether it is a loopback device that no program writes into yet. A writer may turn it into a camera.
    pub(crate) fn lacks_writer(&self) -> bool {
        self.is_loopback() && self.node & V4L2_CAP_VIDEO_CAPTURE == 0
    }

    /// Whether it is a loopback device.
    pub(crate) fn is_loopback(&self) -> bool {
        self.driver == LOOPBACK
    }
}

/// Decodes a zero-terminated text of a driver. Invalid and control characters are replaced.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let printable = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    String::from_utf8_lossy(&bytes[..end]).trim().chars().map(printable).collect()
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
        assert_eq!(node("uvcvideo", camera).buffer_type(), Ok(1));
        assert_eq!(node("vivid", V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING).buffer_type(), Ok(9));
        // Every UVC camera has such a second node.
        assert!(
            node("uvcvideo", V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING)
                .buffer_type()
                .unwrap_err()
                .contains("metadata")
        );
        assert_eq!(node("vivid", V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING).buffer_type(), Err("an output device"));
        assert!(node("codec", camera | V4L2_CAP_VIDEO_M2M).buffer_type().unwrap_err().contains("memory-to-memory"));
        assert!(node("old", V4L2_CAP_VIDEO_CAPTURE).buffer_type().unwrap_err().contains("cannot stream"));
        assert_eq!(node("radio", V4L2_CAP_STREAMING).buffer_type(), Err("not a camera"));
        assert!(node("uvcvideo", camera).is_camera() && !node("radio", V4L2_CAP_STREAMING).is_camera());
    }

    #[test]
    fn a_loopback_device_waits_for_its_writer() {
        let loopback = node(LOOPBACK, V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING);
        assert!(
            loopback.is_camera()
                && loopback.lacks_writer()
                && loopback.buffer_type().unwrap_err().contains("no program writes")
        );
        assert!(!node(LOOPBACK, V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING).lacks_writer());
        assert!(!node("vivid", V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING).lacks_writer());
    }

    #[test]
    fn texts_of_drivers_are_always_printable() {
        assert_eq!(text(b"USB Camera\0\0rest"), "USB Camera");
        assert_eq!(text(b"no end"), "no end");
        assert_eq!(text(b" a\x1b[2J\xff "), "a\u{fffd}[2J\u{fffd}");
        assert_eq!(text(b""), "");
    }
}
