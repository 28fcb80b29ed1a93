//! Format and size of the images: set, read back, and compared with what is wanted.

use rustix::io::Errno;
use v4l::v4l_sys::{
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE as CAPTURE_MPLANE, v4l2_field_V4L2_FIELD_NONE as PROGRESSIVE,
    v4l2_format, v4l2_pix_format_mplane,
};

use fringeflow_pixels::SourceFormat;

use crate::ioctl::{
    BufferKind, CallError, Device, G_FMT, S_FMT, multi_planar, set_multi_planar, single_planar, zeroed,
};

use super::offer::{self, OfferedFormat, format_name};

/// Most planes that a buffer can have.
const MOST_PLANES: u32 = 8;

/// How images lie in buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// V4L2's code of the format.
    pub(crate) code: u32,
    /// Width and height, pixels.
    pub(crate) size_px: [u32; 2],
    /// `V4L2_FIELD_…`.
    pub(crate) field: u32,
    /// Bytes from one row of the (first) plane to the next.
    pub(crate) stride_bytes: u32,
    /// Bytes of an image, all planes.
    pub(crate) image_bytes: u64,
    /// The buffers that it needs.
    pub(crate) kind: BufferKind,
}

/// Why the images cannot be had as wanted.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The device answers with something else.
    #[error(
        "the device takes {answered} instead of {wanted}; it offers {}; change cameras.format, or take a device and a \
         calibration of the same image size",
        offer::summary(offered)
    )]
    Other {
        /// Format and size that are wanted.
        wanted: String,
        /// Those that the device took.
        answered: String,
        /// What it offers.
        offered: Vec<OfferedFormat>,
    },
    /// Rows of two moments in one image.
    #[error("the images are interlaced (field {field}); a scanner needs whole images, each of one moment")]
    Interlaced {
        /// `V4L2_FIELD_…`.
        field: u32,
    },
    /// An image has no room in what the driver states.
    #[error("the driver states {found} {what}; {wanted} needs at least {least}")]
    TooSmall {
        /// Of what.
        what: &'static str,
        /// What it states.
        found: u64,
        /// Size and format.
        wanted: String,
        /// Least value that can be.
        least: u64,
    },
    /// Buffers that cannot be.
    #[error("the driver states {count} planes a buffer; 1 to {MOST_PLANES} are possible")]
    Planes {
        /// What it states.
        count: u32,
    },
    /// A call was refused.
    #[error(transparent)]
    Call(#[from] CallError),
}

/// Sets format and size, and reads back what became of them.
///
/// # Errors
/// The device refuses them, or takes others.
pub(crate) fn set(
    device: &Device,
    kind: u32,
    format: SourceFormat,
    size_px: [usize; 2],
) -> Result<Layout, FormatError> {
    // A size that V4L2 cannot express is one that the device does not take.
    let size = size_px.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let mut asked = request(kind, format.code(), size);
    let layout = match device.call(&S_FMT, &mut asked) {
        Ok(()) => layout(kind, &mut asked),
        // Instead of taking another format, as it should; then it stays as it is.
        Err(error) if error.errno() == Some(Errno::INVAL) => read(device, kind).map_err(|_| error)?,
        Err(error) => return Err(error.into()),
    };
    if (layout.code, layout.size_px) != (format.code(), size) {
        return Err(FormatError::Other {
            wanted: named(format.code(), size),
            answered: named(layout.code, layout.size_px),
            offered: offer::formats(device, kind),
        });
    }
    check(&layout, format)?;
    Ok(layout)
}

/// The format at this moment.
///
/// # Errors
/// The device refuses to tell.
pub(crate) fn read(device: &Device, kind: u32) -> Result<Layout, CallError> {
    let mut answer = v4l2_format { type_: kind, ..zeroed() };
    device.call(&G_FMT, &mut answer)?;
    Ok(layout(kind, &mut answer))
}

fn request(kind: u32, code: u32, [width, height]: [u32; 2]) -> v4l2_format {
    let mut format = v4l2_format { type_: kind, ..zeroed() };
    if kind == CAPTURE_MPLANE {
        let planes: v4l2_pix_format_mplane = multi_planar(&format);
        let wanted = v4l2_pix_format_mplane { width, height, pixelformat: code, field: PROGRESSIVE, ..planes };
        set_multi_planar(&mut format, wanted);
    } else {
        let single = single_planar(&mut format);
        (single.width, single.height, single.pixelformat, single.field) = (width, height, code, PROGRESSIVE);
    }
    format
}

fn layout(kind: u32, format: &mut v4l2_format) -> Layout {
    if kind == CAPTURE_MPLANE {
        let answer = multi_planar(format);
        let planes = answer.plane_fmt;
        let count = u32::from(answer.num_planes);
        return Layout {
            code: answer.pixelformat,
            size_px: [answer.width, answer.height],
            field: answer.field,
            stride_bytes: planes[0].bytesperline,
            image_bytes: planes.iter().take(count as usize).map(|plane| u64::from(plane.sizeimage)).sum(),
            kind: BufferKind { code: kind, planes: Some(count) },
        };
    }
    let answer = single_planar(format);
    Layout {
        code: answer.pixelformat,
        size_px: [answer.width, answer.height],
        field: answer.field,
        stride_bytes: answer.bytesperline,
        image_bytes: u64::from(answer.sizeimage),
        kind: BufferKind { code: kind, planes: None },
    }
}

/// Refuses a layout in which no whole image of a format has room.
fn check(layout: &Layout, format: SourceFormat) -> Result<(), FormatError> {
    if layout.field != PROGRESSIVE {
        return Err(FormatError::Interlaced { field: layout.field });
    }
    let [width, height] = layout.size_px.map(|n| n as usize);
    let least_bytes = |stride_bytes: u32| format.least_bytes([width, height], stride_bytes as usize);
    let stated = [
        ("bytes of a row", u64::from(layout.stride_bytes), format.least_stride_bytes(width) as u64),
        ("bytes of an image", layout.image_bytes, least_bytes(layout.stride_bytes) as u64),
    ];
    if let Some(&(what, found, least)) = stated.iter().find(|(_, found, least)| found < least) {
        return Err(FormatError::TooSmall { what, found, wanted: named(layout.code, layout.size_px), least });
    }
    match layout.kind.planes {
        Some(count) if !(1..=MOST_PLANES).contains(&count) => Err(FormatError::Planes { count }),
        _ => Ok(()),
    }
}

/// Size and format in words.
pub(crate) fn named(code: u32, [width, height]: [u32; 2]) -> String {
    format!("{width}x{height} {}", format_name(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SINGLE: BufferKind = BufferKind { code: 1, planes: None };

    fn layout_of(stride_bytes: u32, image_bytes: u64) -> Layout {
        let code = SourceFormat::Y10.code();
        Layout { code, size_px: [640, 480], field: PROGRESSIVE, stride_bytes, image_bytes, kind: SINGLE }
    }

    #[test]
    fn a_request_is_read_as_it_was_made_for_both_kinds_of_buffers() {
        for (kind, planes) in [(1, None), (CAPTURE_MPLANE, Some(0))] {
            let made = layout(kind, &mut request(kind, 7, [640, 480]));
            let kind = BufferKind { code: kind, planes };
            let wanted =
                Layout { code: 7, size_px: [640, 480], field: PROGRESSIVE, stride_bytes: 0, image_bytes: 0, kind };
            assert_eq!(made, wanted);
        }
    }

    #[test]
    fn what_the_driver_states_must_hold_an_image() {
        check(&layout_of(1280, 1280 * 480), SourceFormat::Y10).unwrap();
        // The last row needs no gap after it.
        check(&layout_of(1536, 1536 * 479 + 1280), SourceFormat::Y10).unwrap();
        let refused = |layout: Layout| check(&layout, SourceFormat::Y10).unwrap_err().to_string();
        assert_eq!(
            refused(layout_of(0, 1280 * 480)),
            "the driver states 0 bytes of a row; 640x480 Y10 needs at least 1280"
        );
        assert!(refused(layout_of(1280, 1280 * 480 - 1)).contains("states 614399 bytes of an image"));
        assert!(refused(Layout { field: 4, ..layout_of(1280, 614_400) }).contains("interlaced (field 4)"));
        let planes = |n| BufferKind { code: CAPTURE_MPLANE, planes: Some(n) };
        assert!(refused(Layout { kind: planes(0), ..layout_of(1280, 614_400) }).contains("states 0 planes"));
        assert!(refused(Layout { kind: planes(9), ..layout_of(1280, 614_400) }).contains("states 9 planes"));
        check(&Layout { code: SourceFormat::Mjpeg.code(), ..layout_of(0, 1000) }, SourceFormat::Mjpeg).unwrap();
    }
}
