//! `[cameras.both]`: one device that gives the images of both cameras.
//!
//! In: the table of the device and the key `stereo_layout`. Out: the arrangement of both views in an image. Formats
//! that hold both views pixel by pixel in turn need no key. Keys that do not fit together are refused.

use fringeflow_pixels::{SourceFormat, StereoLayout};

use super::ConfigurationProblem;
use super::cameras::CameraSource;
use super::raw::{RawCameras, one_of};

/// Refuses keys of two devices beside the one that gives both images.
pub(super) fn check_only_device(raw: &RawCameras) -> Result<(), ConfigurationProblem> {
    if raw.cam1.is_some() || raw.cam2.is_some() {
        return Err(ConfigurationProblem::Value {
            key: "cameras.both",
            value: "given beside [cameras.cam1] or [cameras.cam2]".to_owned(),
            expected: "name either one device that gives both images, or two devices",
        });
    }
    match raw.max_skew_us {
        Some(max_skew_us) => Err(ConfigurationProblem::Value {
            key: "cameras.max_skew_us",
            value: max_skew_us.to_string(),
            expected: "it does not apply to [cameras.both], whose images are exposed together; remove it",
        }),
        None => Ok(()),
    }
}

/// Reads the arrangement of the views; `None` if an image has one view, or a format with an arrangement of its own.
pub(super) fn stereo_layout(
    source: &CameraSource,
    raw: &RawCameras,
    format: SourceFormat,
) -> Result<Option<StereoLayout>, ConfigurationProblem> {
    let known = StereoLayout::ALL.map(|layout| (layout.name(), layout));
    let layout = raw.stereo_layout.as_deref().map(|name| one_of("cameras.stereo_layout", name, &known)).transpose()?;
    let gives_both = matches!(source, CameraSource::V4l2Stereo(_));
    match layout {
        Some(layout) if !gives_both => Err(ConfigurationProblem::Value {
            key: "cameras.stereo_layout",
            value: format!("{:?}", layout.name()),
            expected: "only one device that gives both images has a layout; name it in the table [cameras.both] \
                       instead of two devices, or remove this key",
        }),
        None if !gives_both && format.is_interleaved() => Err(ConfigurationProblem::Value {
            key: "cameras.format",
            value: format!("{:?}", format.name()),
            expected: "each image of this format holds those of both cameras; name one device in the table \
                       [cameras.both] instead of two",
        }),
        None if gives_both && !format.is_interleaved() => Err(ConfigurationProblem::Missing {
            key: "cameras.stereo_layout",
            expected: "it must be \"side-by-side\" or \"top-bottom\", the arrangement of both images in one of the \
                       device",
        }),
        layout => Ok(layout),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{DeviceName, ScannerConfiguration};

    const BOTH: &str = "[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\n[cameras.both]\ndevice = \"/dev/video3\"\n";

    fn parse(text: &str) -> Result<ScannerConfiguration, String> {
        ScannerConfiguration::parse(text, Path::new("/")).map_err(|e| e.to_string())
    }

    fn with(keys: &str) -> Result<ScannerConfiguration, String> {
        parse(&BOTH.replace("rate_hz = 30.0", &format!("rate_hz = 30.0\n{keys}")))
    }

    #[test]
    fn one_device_gives_both_images() {
        let read = with("format = \"YUYV\"\nstereo_layout = \"top-bottom\"").unwrap();
        let CameraSource::V4l2Stereo(device) = &read.cameras else { panic!("{:?}", read.cameras) };
        assert_eq!(device.device, DeviceName::Path("/dev/video3".into()));
        assert_eq!(read.device_images.image_px([640, 480]), Ok([640, 960]));
        // Its recorded text needs no limit of the skew.
        assert_eq!(read.recorded_text(), read.text);
        let interleaved = with("format = \"Y8I\"").unwrap();
        assert_eq!((interleaved.device_images.views(), interleaved.device_images.layout()), (2, None));
    }

    #[test]
    fn keys_that_do_not_fit_together_are_refused() {
        let refused = |keys: &str| with(keys).unwrap_err();
        assert!(refused("").contains("key cameras.stereo_layout is missing; it must be \"side-by-side\""));
        assert!(refused("stereo_layout = \"left-right\"").contains("[\"side-by-side\", \"top-bottom\"]"));
        let interleaved = refused("format = \"Y12I\"\nstereo_layout = \"side-by-side\"");
        assert!(interleaved.contains("key cameras.stereo_layout: Y12I images hold both views"), "{interleaved}");
        let skew = refused("stereo_layout = \"side-by-side\"\nmax_skew_us = 10.0");
        assert!(skew.contains("key cameras.max_skew_us is 10; it does not apply to [cameras.both]"), "{skew}");
        let beside = parse(&format!("{BOTH}[cameras.cam2]\ndevice = \"/dev/video1\"\n")).unwrap_err();
        assert!(beside.contains("key cameras.both is given beside [cameras.cam1] or [cameras.cam2]"), "{beside}");
        let external = BOTH.replace("v4l2", "external");
        assert!(parse(&external).unwrap_err().contains("only the source \"v4l2\" has"));
        let bad = parse(&format!("{BOTH}buffers = 1\n")).unwrap_err();
        assert!(bad.contains("in [cameras.both]: key buffers is 1"), "{bad}");
    }

    #[test]
    fn two_devices_have_no_layout() {
        let two = "[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\n[cameras.cam1]\ndevice = \"/dev/video0\"\n\
                   [cameras.cam2]\ndevice = \"/dev/video1\"\n";
        let with = |key: &str| parse(&two.replace("rate_hz = 30.0", &format!("rate_hz = 30.0\n{key}"))).unwrap_err();
        let layout = with("stereo_layout = \"side-by-side\"");
        assert!(layout.contains("cameras.stereo_layout is \"side-by-side\"; only one device"), "{layout}");
        let format = with("format = \"Y8I\"");
        assert!(format.contains("key cameras.format is \"Y8I\"; each image of this format holds"), "{format}");
    }
}
