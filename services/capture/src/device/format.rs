//! Sets format and size of the images, reads them back, and compares them with the wanted ones.

use rustix::io::Errno;
use v4l::v4l_sys::{
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE as CAPTURE_MPLANE, v4l2_field_V4L2_FIELD_NONE as PROGRESSIVE,
    v4l2_format, v4l2_pix_format_mplane,
};

use fringeflow_pixels::{DeviceImagesError, SourceFormat};

use crate::ioctl::{
    BufferKind, CallError, Device, G_FMT, MAX_PLANES, S_FMT, multi_planar, set_multi_planar, single_planar, zeroed,
};

use super::offer::{self, OfferedFormat, format_name};
use super::wanted::Wanted;

/// Layout of the images in buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// V4L2 code of the format.
    pub(crate) code: u32,
    /// Width and height, pixels.
    pub(crate) size_px: [u32; 2],
    /// `V4L2_FIELD_…`.
    pub(crate) field: u32,
    /// Bytes from one row of the (first) plane to the next.
    pub(crate) stride_bytes: u32,
    /// Bytes of an image, all planes.
    pub(crate) image_bytes: u64,
    /// Kind of the buffers.
    pub(crate) kind: BufferKind,
}

/// Why a device cannot send the wanted images.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The device takes another format or size.
    #[error(
        "the device takes {answered} instead of {wanted}; it offers {}; change cameras.format, or use a device and a \
         calibration whose image sizes fit",
        offer::formats_text(offered)
    )]
    Other {
        /// Wanted format and size.
        wanted: String,
        /// Format and size that the device took.
        answered: String,
        /// Formats that the device offers.
        offered: Vec<OfferedFormat>,
    },
    /// The rows of an image belong to two exposures.
    #[error("the images are interlaced (field {field}); a scanner needs progressive images")]
    Interlaced {
        /// `V4L2_FIELD_…`.
        field: u32,
    },
    /// An image does not fit into the reported rows or buffers.
    #[error("the driver reports {found} {what}; {wanted} needs at least {least}")]
    TooSmall {
        /// The quantity.
        what: &'static str,
        /// The reported value.
        found: u64,
        /// Size and format of the images.
        wanted: String,
        /// The least possible value.
        least: u64,
    },
    /// An impossible number of planes.
    #[error("the driver reports {count} planes per buffer; 1 to {MAX_PLANES} are possible")]
    Planes {
        /// The reported number.
        count: u32,
    },
    /// The views of an image do not fit its format.
    #[error(transparent)]
    Views(#[from] DeviceImagesError),
    /// A call was refused.
    #[error(transparent)]
    Call(#[from] CallError),
}

/// Sets format and size, and returns the resulting layout.
///
/// # Errors
/// The device refuses them, or takes others.
pub(crate) fn set(device: &Device, kind: u32, wanted: &Wanted) -> Result<Layout, FormatError> {
    let format = wanted.images.format();
    let size_px = wanted.images.image_px(wanted.view_px)?;
    // A size beyond 32 bits becomes one that no device takes.
    let size = size_px.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let mut requested = format_request(kind, format.code(), size);
    let layout = match device.call(&S_FMT, &mut requested) {
        Ok(()) => layout_from(kind, &mut requested),
        // The driver should have taken another format instead; it keeps its current one.
        Err(error) if error.errno() == Some(Errno::INVAL) => read(device, kind).map_err(|_| error)?,
        Err(error) => return Err(error.into()),
    };
    if (layout.code, layout.size_px) != (format.code(), size) {
        return Err(FormatError::Other {
            wanted: format_text(format.code(), size) + &views_text(wanted),
            answered: format_text(layout.code, layout.size_px),
            offered: offer::list_formats(device, kind),
        });
    }
    check_layout(&layout, format)?;
    Ok(layout)
}

/// Reads the current format.
///
/// # Errors
/// The device refuses the call.
pub(crate) fn read(device: &Device, kind: u32) -> Result<Layout, CallError> {
    let mut answer = v4l2_format { type_: kind, ..zeroed() };
    device.call(&G_FMT, &mut answer)?;
    Ok(layout_from(kind, &mut answer))
}

fn format_request(kind: u32, code: u32, [width, height]: [u32; 2]) -> v4l2_format {
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

fn layout_from(kind: u32, format: &mut v4l2_format) -> Layout {
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

/// Refuses a layout that cannot hold a whole progressive image of a format.
fn check_layout(layout: &Layout, format: SourceFormat) -> Result<(), FormatError> {
    if layout.field != PROGRESSIVE {
        return Err(FormatError::Interlaced { field: layout.field });
    }
    let [width, height] = layout.size_px.map(|n| n as usize);
    let least_bytes = |stride_bytes: u32| format.least_bytes([width, height], stride_bytes as usize);
    let reported = [
        ("bytes per row", u64::from(layout.stride_bytes), format.least_stride_bytes(width) as u64),
        ("bytes per image", layout.image_bytes, least_bytes(layout.stride_bytes) as u64),
    ];
    if let Some(&(what, found, least)) = reported.iter().find(|(_, found, least)| found < least) {
        return Err(FormatError::TooSmall { what, found, wanted: format_text(layout.code, layout.size_px), least });
    }
    match layout.kind.planes {
        Some(count) if !(1..=MAX_PLANES).contains(&(count as usize)) => Err(FormatError::Planes { count }),
        _ => Ok(()),
    }
}

/// Explains the size of an image with two views; empty for one view.
fn views_text(wanted: &Wanted) -> String {
    let [width, height] = wanted.view_px;
    match wanted.images.layout() {
        Some(layout) => format!(" (two images of {width}x{height} {layout}, the size in the calibration)"),
        None => String::new(),
    }
}

/// Formats an image size and a format: `640x480 Y10`.
pub(crate) fn format_text(code: u32, [width, height]: [u32; 2]) -> String {
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
    fn a_request_reads_back_for_both_kinds_of_buffers() {
        for (kind, planes) in [(1, None), (CAPTURE_MPLANE, Some(0))] {
            let read = layout_from(kind, &mut format_request(kind, 7, [640, 480]));
            let kind = BufferKind { code: kind, planes };
            let wanted =
                Layout { code: 7, size_px: [640, 480], field: PROGRESSIVE, stride_bytes: 0, image_bytes: 0, kind };
            assert_eq!(read, wanted);
        }
    }

    #[test]
    fn the_reported_sizes_must_hold_an_image() {
        check_layout(&layout_of(1280, 1280 * 480), SourceFormat::Y10).unwrap();
        // The last row needs no padding.
        check_layout(&layout_of(1536, 1536 * 479 + 1280), SourceFormat::Y10).unwrap();
        let refused = |layout: Layout| check_layout(&layout, SourceFormat::Y10).unwrap_err().to_string();
        assert_eq!(
            refused(layout_of(0, 1280 * 480)),
            "the driver reports 0 bytes per row; 640x480 Y10 needs at least 1280"
        );
        assert!(refused(layout_of(1280, 1280 * 480 - 1)).contains("reports 614399 bytes per image"));
        assert!(refused(Layout { field: 4, ..layout_of(1280, 614_400) }).contains("interlaced (field 4)"));
        let planes = |n| BufferKind { code: CAPTURE_MPLANE, planes: Some(n) };
        assert!(refused(Layout { kind: planes(0), ..layout_of(1280, 614_400) }).contains("reports 0 planes"));
        assert!(refused(Layout { kind: planes(9), ..layout_of(1280, 614_400) }).contains("reports 9 planes"));
        check_layout(&Layout { code: SourceFormat::Mjpeg.code(), ..layout_of(0, 1000) }, SourceFormat::Mjpeg).unwrap();
    }
}
