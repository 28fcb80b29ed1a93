//! `[cameras]`: the source of images; for V4L2 devices, their names and settings.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use fringeflow_base::grey::PixelFormat;
use fringeflow_pixels::{BayerGrey, DeviceImages, DeviceImagesError, SourceFormat};

use super::ConfigurationProblem;
use super::extension_units::{self, ExtensionUnitSetting};
use super::raw::{RawCameras, RawV4l2Camera, checked, one_of};
use super::stereo;

/// Minimum default time without an image after which a camera counts as stalled, milliseconds.
const TIMEOUT_MS: u64 = 1000;
/// The same in frame periods. The longer time applies.
const TIMEOUT_PERIODS: f64 = 10.0;

/// Source of the images.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSource {
    /// The virtual scanner.
    Virtual,
    /// Another program, or a replay.
    External,
    /// Two V4L2 devices.
    V4l2(Box<[V4l2Camera; 2]>),
    /// One V4L2 device whose images hold the views of both cameras.
    V4l2Stereo(Box<V4l2Camera>),
}

/// A V4L2 device and its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct V4l2Camera {
    /// The device.
    pub device: DeviceName,
    /// Number of buffers that the driver and the service share.
    pub buffers: u32,
    /// Time without an image after which a free-running camera counts as stalled, nanoseconds.
    pub timeout_ns: u64,
    /// What starts an exposure.
    pub trigger: Trigger,
    /// The moment that the time stamps of the driver mark.
    pub stamp: StampMoment,
    /// Exposure time, nanoseconds; `None` to use the value that the device reports.
    pub exposure_ns: Option<u64>,
    /// Time from the end of the exposure to a time stamp at the end of an image, nanoseconds.
    pub readout_ns: u64,
    /// Whether the service sets the frame rate of the device.
    pub set_rate: bool,
    /// Timings of a digital video signal, for frame grabbers.
    pub video_timings: Option<VideoTimings>,
    /// Controls by the names that `v4l2-ctl` prints.
    pub controls: BTreeMap<String, ControlValue>,
    /// Settings of the extension units of a UVC device, in the order in which they are set.
    pub extension_units: Vec<ExtensionUnitSetting>,
}

/// How a device is named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// By path, which may be a link.
    Path(PathBuf),
    /// By its V4L2 `bus_info`.
    Bus(String),
    /// By its USB serial number.
    Serial(String),
}

/// A text that is not a device name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name:?} is not a device name; write a path (\"/dev/video0\", \"/dev/v4l/by-id/…\"), \"bus:\" and a V4L2 \
     bus_info, or \"serial:\" and a USB serial number; `fringeflow cameras` lists the devices"
)]
pub struct DeviceNameError {
    /// The text.
    pub name: String,
}

/// What starts an exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// The camera itself, at its own rate.
    Free,
    /// An external signal. A period without images is not a fault.
    External,
}

/// The moment that a time stamp marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampMoment {
    /// The moment that the driver reports for each image.
    Driver,
    /// Start of exposure.
    Start,
    /// End of the image, after exposure and readout.
    End,
}

/// Timings of a digital video signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VideoTimings {
    /// Use the timings of the signal at the device.
    Detect,
    /// A signal of this size and rate.
    Signal {
        /// Width and height, pixels.
        size_px: [u32; 2],
        /// Images per second.
        rate_hz: f64,
    },
}

/// Value of a control.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(untagged)]
pub enum ControlValue {
    /// A number; for a menu, the index of an item.
    Number(i64),
    /// On or off. `true` presses a button.
    Switch(bool),
    /// A text; for a menu, the name of an item.
    Text(String),
}

impl FromStr for DeviceName {
    type Err = DeviceNameError;

    fn from_str(name: &str) -> Result<Self, DeviceNameError> {
        let after = |prefix: &str| name.strip_prefix(prefix).filter(|rest| !rest.trim().is_empty());
        if let Some(bus) = after("bus:") {
            return Ok(Self::Bus(bus.to_owned()));
        }
        if let Some(serial) = after("serial:") {
            return Ok(Self::Serial(serial.to_owned()));
        }
        let is_path = name.starts_with('/') && name.len() > 1;
        if is_path { Ok(Self::Path(name.into())) } else { Err(DeviceNameError { name: name.to_owned() }) }
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => write!(f, "{}", path.display()),
            Self::Bus(bus) => write!(f, "bus:{bus}"),
            Self::Serial(serial) => write!(f, "serial:{serial}"),
        }
    }
}

impl fmt::Display for VideoTimings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Detect => write!(f, "detect"),
            Self::Signal { size_px: [width, height], rate_hz } => write!(f, "{width}x{height}@{rate_hz}"),
        }
    }
}

impl fmt::Display for ControlValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Switch(is_on) => write!(f, "{is_on}"),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

/// Reads the source of the images. `rate_hz` is already checked.
pub(super) fn camera_source(raw: &RawCameras, rate_hz: f64) -> Result<CameraSource, ConfigurationProblem> {
    #[derive(Clone, Copy)]
    enum Source {
        Virtual,
        External,
        V4l2,
    }
    let virtual_or_external = |source| match (&raw.cam1, &raw.cam2, &raw.both) {
        (None, None, None) => Ok(source),
        _ => Err(ConfigurationProblem::Value {
            key: "cameras.source",
            value: format!("{:?}", raw.source),
            expected: "only the source \"v4l2\" has [cameras.cam1], [cameras.cam2] and [cameras.both]: remove them, or use \
                       that source. To simulate a rig with devices, keep its file and give `run` the option --virtual",
        }),
    };
    let known = [("virtual", Source::Virtual), ("external", Source::External), ("v4l2", Source::V4l2)];
    match one_of("cameras.source", &raw.source, &known)? {
        Source::Virtual => virtual_or_external(CameraSource::Virtual),
        Source::External => virtual_or_external(CameraSource::External),
        Source::V4l2 => match &raw.both {
            Some(both) => {
                stereo::check_only_device(raw)?;
                let device = device_in_table("both", both, rate_hz)?;
                Ok(CameraSource::V4l2Stereo(Box::new(device)))
            }
            None => v4l2(raw, rate_hz).map(|cameras| CameraSource::V4l2(Box::new(cameras))),
        },
    }
}

/// Returns what the devices send.
pub(super) fn device_images(source: &CameraSource, raw: &RawCameras) -> Result<DeviceImages, ConfigurationProblem> {
    let format = source_format(source, raw.format.as_deref())?;
    let known = BayerGrey::ALL.map(|grey| (grey.name(), grey));
    let bayer = raw.bayer.as_deref().map(|name| one_of("cameras.bayer", name, &known)).transpose()?;
    let layout = stereo::stereo_layout(source, raw, format)?;
    let problem = |error: DeviceImagesError| {
        let is_layout = matches!(error, DeviceImagesError::Interleaved { .. });
        let key = if is_layout { "cameras.stereo_layout" } else { "cameras.bayer" };
        ConfigurationProblem::Named { key, problem: error.to_string() }
    };
    let images = DeviceImages::new(format, bayer, layout).map_err(problem)?;
    images.check_binning(raw.binning.unwrap_or(1)).map_err(problem)?;
    Ok(images)
}

/// Returns the source format with this name.
fn source_format(source: &CameraSource, name: Option<&str>) -> Result<SourceFormat, ConfigurationProblem> {
    let Some(name) = name else { return Ok(SourceFormat::Grey) };
    match source {
        // These sources write their images into the channels themselves, in one of the formats of the channels.
        CameraSource::Virtual | CameraSource::External => {
            let formats = PixelFormat::ALL.map(|format| (format.name(), SourceFormat::from(format)));
            one_of("cameras.format", name, &formats)
        }
        CameraSource::V4l2(_) | CameraSource::V4l2Stereo(_) => {
            let format = name.parse::<SourceFormat>();
            format.map_err(|e| ConfigurationProblem::Named { key: "cameras.format", problem: e.to_string() })
        }
    }
}

fn v4l2(raw: &RawCameras, rate_hz: f64) -> Result<[V4l2Camera; 2], ConfigurationProblem> {
    let missing = |key| ConfigurationProblem::Missing {
        key,
        expected: "it must be a table whose key device names a V4L2 device; `fringeflow cameras` lists the devices. One \
                   device that gives both images has the table [cameras.both] instead of two",
    };
    let cam1 = device_in_table("cam1", raw.cam1.as_ref().ok_or_else(|| missing("cameras.cam1"))?, rate_hz)?;
    let cam2 = device_in_table("cam2", raw.cam2.as_ref().ok_or_else(|| missing("cameras.cam2"))?, rate_hz)?;
    if cam1.device == cam2.device {
        return Err(ConfigurationProblem::Value {
            key: "cameras.cam2.device",
            value: format!("\"{}\"", cam2.device),
            expected: "this is also the device of camera 1; use another one",
        });
    }
    Ok([cam1, cam2])
}

/// Reads the table of a device, `[cameras.NAME]`.
fn device_in_table(name: &'static str, raw: &RawV4l2Camera, rate_hz: f64) -> Result<V4l2Camera, ConfigurationProblem> {
    let in_table = |problem| ConfigurationProblem::Camera { camera: name, problem: Box::new(problem) };
    v4l2_camera(raw, rate_hz).map_err(in_table)
}

fn v4l2_camera(raw: &RawV4l2Camera, rate_hz: f64) -> Result<V4l2Camera, ConfigurationProblem> {
    let device = raw.device.parse();
    let device =
        device.map_err(|e: DeviceNameError| ConfigurationProblem::Named { key: "device", problem: e.to_string() })?;
    let default_timeout_ms = TIMEOUT_MS.max((TIMEOUT_PERIODS * 1e3 / rate_hz).ceil() as u64);
    Ok(V4l2Camera {
        device,
        buffers: checked(
            "buffers",
            raw.buffers.unwrap_or(8),
            |v| (2..=32).contains(v),
            "it must lie between 2 and 32",
        )?,
        timeout_ns: checked(
            "timeout_ms",
            raw.timeout_ms.unwrap_or(default_timeout_ms),
            |v| (10..=3_600_000).contains(v),
            "it must lie between 10 ms and an hour",
        )? * 1_000_000,
        trigger: one_of(
            "trigger",
            raw.trigger.as_deref().unwrap_or("free"),
            &[("free", Trigger::Free), ("external", Trigger::External)],
        )?,
        stamp: one_of(
            "stamp",
            raw.stamp.as_deref().unwrap_or("driver"),
            &[("driver", StampMoment::Driver), ("start", StampMoment::Start), ("end", StampMoment::End)],
        )?,
        exposure_ns: raw.exposure_us.map(|us| nanoseconds("exposure_us", us)).transpose()?,
        readout_ns: nanoseconds("readout_us", raw.readout_us.unwrap_or(0.0))?,
        set_rate: raw.set_rate.unwrap_or(true),
        video_timings: raw.video_timings.as_deref().map(video_timings).transpose()?,
        controls: raw.controls.iter().map(control).collect::<Result<_, _>>()?,
        extension_units: raw.extension_units.iter().map(extension_units::setting).collect::<Result<_, _>>()?,
    })
}

/// Converts a duration in microseconds to nanoseconds.
fn nanoseconds(key: &'static str, us: f64) -> Result<u64, ConfigurationProblem> {
    let us = checked(key, us, |v| (0.0..=1e7).contains(v), "it must lie between 0 and 10000000 µs")?;
    Ok((us * 1e3).round() as u64)
}

fn video_timings(word: &str) -> Result<VideoTimings, ConfigurationProblem> {
    let signal = || {
        let (size, rate) = word.split_once('@')?;
        let (width, height) = size.split_once('x')?;
        let size_px: [u32; 2] = [width.trim().parse().ok()?, height.trim().parse().ok()?];
        let rate_hz: f64 = rate.trim().parse().ok()?;
        let is_valid = size_px.iter().all(|n| (1..=16384).contains(n)) && (0.1..=1000.0).contains(&rate_hz);
        is_valid.then_some(VideoTimings::Signal { size_px, rate_hz })
    };
    let timings = if word == "detect" { Some(VideoTimings::Detect) } else { signal() };
    timings.ok_or_else(|| ConfigurationProblem::Value {
        key: "video_timings",
        value: format!("{word:?}"),
        expected: "it must be \"detect\", or the size and rate of a signal, for example \"1280x1024@60\"",
    })
}

fn control((name, value): (&String, &toml::Value)) -> Result<(String, ControlValue), ConfigurationProblem> {
    let value = match value {
        toml::Value::Integer(number) => ControlValue::Number(*number),
        toml::Value::Boolean(is_on) => ControlValue::Switch(*is_on),
        toml::Value::String(text) => ControlValue::Text(text.clone()),
        other => {
            let problem = format!("{name} is {other}; a control must be an integer, a boolean or a string");
            return Err(ConfigurationProblem::Named { key: "controls", problem });
        }
    };
    Ok((name.clone(), value))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::ScannerConfiguration;

    const TWO_DEVICES: &str = "[cameras]\nsource = \"v4l2\"\nrate_hz = 5.0\n[cameras.cam1]\ndevice = \"/dev/video0\"\n\
                       [cameras.cam2]\ndevice = \"serial:7\"\n";

    /// The required keys of the example. All its other keys state defaults.
    const REQUIRED: &str = "[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\n[cameras.cam1]\ndevice = \"/dev/video0\"\n\
                            [cameras.cam2]\ndevice = \"/dev/video2\"\n[pattern]\nsteps = 4\nperiod_px = 16.0\n[rig]\n\
                            calibration = \"rigs/scanner.yml\"\nunit = \"mm\"\n[measurement_volume]\nunit = \"mm\"\n\
                            [measurement_volume.box]\nR_v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT_v = [0, 0, 300]\n\
                            min = [-50, -40, -20]\nmax = [50, 40, 25]\n";

    #[test]
    fn the_example_states_the_defaults() {
        let parse = |text| ScannerConfiguration::parse(text, Path::new("/configs")).unwrap();
        let example = parse(include_str!("../../../configs/scanner.toml"));
        assert_eq!(ScannerConfiguration { text: REQUIRED.to_owned(), ..example }, parse(REQUIRED));
    }

    fn cameras(text: &str) -> Result<[V4l2Camera; 2], String> {
        match ScannerConfiguration::parse(text, Path::new("/")).map_err(|e| e.to_string())?.cameras {
            CameraSource::V4l2(cameras) => Ok(*cameras),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_device_alone_gets_the_defaults() {
        let [cam1, cam2] = cameras(TWO_DEVICES).unwrap();
        assert_eq!(cam1.device, DeviceName::Path("/dev/video0".into()));
        assert_eq!(cam2.device, DeviceName::Serial("7".into()));
        let same = V4l2Camera { device: cam2.device.clone(), ..cam1.clone() };
        assert_eq!(same, cam2);
        // Ten periods of 200 ms.
        assert_eq!((cam1.buffers, cam1.timeout_ns, cam1.readout_ns), (8, 2_000_000_000, 0));
        assert_eq!((cam1.trigger, cam1.stamp), (Trigger::Free, StampMoment::Driver));
        assert_eq!((cam1.exposure_ns, cam1.video_timings, cam1.set_rate), (None, None, true));
        assert!(cam1.controls.is_empty() && cam1.extension_units.is_empty());
    }

    #[test]
    fn all_keys_of_a_camera_are_read() {
        let keys = "buffers = 16\ntimeout_ms = 250\ntrigger = \"external\"\nstamp = \"end\"\nexposure_us = 8333.5\n\
                    readout_us = 20\nset_rate = false\nextension_units = [{ unit = 3, selector = 2, bytes = \"01 00\" }, \
                    { unit = 3, selector = 1, bytes = \"0f\" }]\nvideo_timings = \"1280x1024@59.94\"\n[cameras.cam2.controls]\n\
                    gain = 4\nauto_exposure = \"Manual Mode\"\nhorizontal_flip = true\n";
        let [_, cam2] = cameras(&format!("{TWO_DEVICES}{keys}")).unwrap();
        assert_eq!((cam2.buffers, cam2.timeout_ns), (16, 250_000_000));
        assert_eq!((cam2.trigger, cam2.stamp, cam2.set_rate), (Trigger::External, StampMoment::End, false));
        assert_eq!((cam2.exposure_ns, cam2.readout_ns), (Some(8_333_500), 20_000));
        assert_eq!(cam2.video_timings, Some(VideoTimings::Signal { size_px: [1280, 1024], rate_hz: 59.94 }));
        let controls: Vec<String> = cam2.controls.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let settings =
            cam2.extension_units.iter().map(|setting| (setting.unit, setting.selector, setting.bytes.clone()));
        assert_eq!(settings.collect::<Vec<_>>(), [(3, 2, vec![1, 0]), (3, 1, vec![15])]);
        assert_eq!(controls, ["auto_exposure=\"Manual Mode\"", "gain=4", "horizontal_flip=true"]);
    }

    #[test]
    fn invalid_values_are_named_with_their_camera() {
        let with = |line: &str| cameras(&format!("{TWO_DEVICES}{line}\n")).unwrap_err();
        assert_eq!(with("buffers = 1"), "in [cameras.cam2]: key buffers is 1; it must lie between 2 and 32");
        assert!(with("timeout_ms = 1").contains("key timeout_ms is 1;"));
        assert!(with("exposure_us = -1.0").contains("key exposure_us is -1;"));
        assert!(with("readout_us = nan").contains("key readout_us is NaN;"));
        assert!(with("trigger = \"none\"").contains("[\"free\", \"external\"]"));
        assert!(with("stamp = \"middle\"").contains("[\"driver\", \"start\", \"end\"]"));
        assert!(with("video_timings = \"1280@60\"").contains("\"1280x1024@60\""));
        assert!(
            with("extension_units = [{ unit = 1, selector = 1, bytes = \"1\" }]")
                .contains("in [cameras.cam2]: key extension_units.bytes is \"1\"")
        );
        assert!(with("buffer = 3").contains("buffer"));
        assert!(with("[cameras.cam2.controls]\ngain = 1.5").contains("gain is 1.5; a control must be an integer"));
    }

    #[test]
    fn only_devices_may_send_formats_that_channels_do_not_have() {
        let format = |source: &str| {
            let text = TWO_DEVICES.replace("rate_hz", "format = \"MJPG\"\nrate_hz");
            let text = if source == "v4l2" { text } else { text.replace("v4l2", source) };
            let text = if source == "v4l2" { text.as_str() } else { text.split("[cameras.cam1]").next().unwrap() };
            ScannerConfiguration::parse(text, Path::new("/")).map(|read| read.device_images.format())
        };
        assert_eq!(format("v4l2").unwrap(), SourceFormat::Mjpeg);
        assert!(format("external").unwrap_err().to_string().contains("cameras.format is \"MJPG\"; it must be one of"));
    }

    #[test]
    fn the_grey_level_of_a_mosaic_is_chosen_only_for_mosaics() {
        let images = |keys: &str| {
            let text = TWO_DEVICES.replace("rate_hz", &format!("{keys}\nrate_hz"));
            let read = ScannerConfiguration::parse(&text, Path::new("/")).map_err(|e| e.to_string());
            read.map(|read| (read.device_images, read.pixel_format()))
        };
        let of = |name: &str, grey| DeviceImages::new(name.parse().unwrap(), grey, None).unwrap();
        assert_eq!(images("format = \"RGGB\"").unwrap(), (of("RGGB", None), PixelFormat::Grey));
        let green = images("format = \"BA10\"\nbayer = \"green\"").unwrap();
        assert_eq!(green, (of("BA10", Some(BayerGrey::Green)), PixelFormat::Y12));
        assert_eq!(images("format = \"RGGB\"\nbayer = \"weighted\"").unwrap().1, PixelFormat::Y12);
        assert_eq!(images("format = \"RGGB\"\nbinning = 2").unwrap().1, PixelFormat::Y10);
        let refused = |keys: &str| images(keys).unwrap_err();
        let grey = refused("format = \"Y10\"\nbayer = \"raw\"");
        assert!(
            grey.contains("key cameras.bayer: Y10 images are no Bayer mosaic: remove the choice \"raw\""),
            "{grey}"
        );
        let word = refused("format = \"RGGB\"\nbayer = \"red\"");
        assert!(
            word.contains("cameras.bayer is \"red\"; it must be one of [\"weighted\", \"green\", \"raw\"]"),
            "{word}"
        );
        let binned = refused("format = \"RGGB\"\nbayer = \"green\"\nbinning = 2");
        assert!(binned.contains("remove the choice \"green\", or use binning 1"), "{binned}");
    }

    #[test]
    fn the_two_cameras_must_have_different_devices() {
        let changed = |from: &str, to: &str| cameras(&TWO_DEVICES.replace(from, to)).unwrap_err();
        assert!(
            changed("serial:7", "serial:").contains("in [cameras.cam2]: key device: \"serial:\" is not a device name")
        );
        assert!(changed("serial:7", "video1").contains("\"video1\" is not a device name"));
        assert!(changed("serial:7", "/dev/video0").contains("this is also the device of camera 1"));
        assert!(changed("[cameras.cam2]\ndevice = \"serial:7\"\n", "").contains("key cameras.cam2 is missing"));
        assert!(changed("\"v4l2\"", "\"external\"").contains("only the source \"v4l2\" has"));
        assert!(changed("\"v4l2\"", "\"v4l\"").contains("[\"virtual\", \"external\", \"v4l2\"]"));
    }
}
