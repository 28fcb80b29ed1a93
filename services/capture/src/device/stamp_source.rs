//! What the time stamps of a device mark, as its driver declares it.
//!
//! A driver declares it with its buffers. So a buffer is requested, looked at and freed again; no image is taken.

use v4l::v4l_sys::{v4l2_memory_V4L2_MEMORY_MMAP as MEMORY_MMAP, v4l2_requestbuffers};

use crate::ioctl::{BufferKind, CallError, Device, REQBUFS, zeroed};
use crate::time_stamps::{is_monotonic, is_start_of_exposure};

use super::capability::Capability;

/// Parameter of the driver uvcvideo: whether it computes stamps from the clock of the camera.
const UVC_HARDWARE_STAMPS: &str = "/sys/module/uvcvideo/parameters/hwtimestamps";

/// Describes the time stamps of a device whose stream does not run, as one phrase.
pub(crate) fn describe(device: &Device, capability: &Capability, kind: BufferKind) -> String {
    // Each version of the loopback driver has its own way with buffers, and its stamps are those of a program.
    if capability.is_loopback() {
        return "time stamps of the program that writes the images".to_owned();
    }
    let flags = match flags(device, kind) {
        Ok(flags) => flags,
        Err(error) => return format!("time stamps unknown ({error})"),
    };
    let moment = if is_start_of_exposure(flags) { "the start of the exposure" } else { "the end of the image" };
    let clock = if is_monotonic(flags) { "" } else { ", by a clock that the driver does not name" };
    format!("time stamps of {moment}, as the driver declares{clock}{}", uvc_text(capability))
}

/// The driver uvcvideo always declares the start of the exposure, but has two ways to make stamps.
fn uvc_text(capability: &Capability) -> &'static str {
    if capability.driver != "uvcvideo" {
        return "";
    }
    let is_hardware = std::fs::read_to_string(UVC_HARDWARE_STAMPS).is_ok_and(|value| value.trim() == "1");
    if is_hardware {
        "; from the clock of the camera (hwtimestamps=1)"
    } else {
        "; uvcvideo stamps the arrival of the first data of an image, after the exposure (hwtimestamps=0)"
    }
}

/// Returns the flags of a buffer of the device.
fn flags(device: &Device, kind: BufferKind) -> Result<u32, CallError> {
    request(device, kind, 1)?;
    let flags = device.buffer_flags(kind, 0);
    request(device, kind, 0)?;
    flags
}

fn request(device: &Device, kind: BufferKind, count: u32) -> Result<(), CallError> {
    let mut request = v4l2_requestbuffers { count, type_: kind.code, memory: MEMORY_MMAP, ..zeroed() };
    device.call(&REQBUFS, &mut request)
}
