//! Timings of a digital video signal. A frame grabber knows its image size only after the signal was set.

use rustix::io::Errno;
use v4l::v4l_sys::{
    V4L2_DV_FL_REDUCED_FPS, V4L2_DV_INTERLACED, V4L2_IN_CAP_DV_TIMINGS, v4l2_bt_timings, v4l2_dv_timings,
    v4l2_enum_dv_timings, v4l2_input,
};

use fringeflow_config::VideoTimings;

use crate::ioctl::{
    CallError, Device, ENUM_DV_TIMINGS, ENUMINPUT, G_DV_TIMINGS, G_INPUT, QUERY_DV_TIMINGS, S_DV_TIMINGS,
    video_timings, zeroed,
};

use super::offer::{enumerate, rate_text};

/// Relative difference up to which two rates are the same, such as 60 and 59.94.
const RATE_TOLERANCE: f64 = 0.01;

/// A video signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Signal {
    /// Width and height, pixels.
    pub(crate) size_px: [u32; 2],
    /// Frame rate; 0 if the timings are invalid.
    pub(crate) rate_hz: f64,
    /// Whether each field holds only every other row of an image.
    pub(crate) is_interlaced: bool,
}

/// Why the timings cannot be set.
#[derive(Debug, thiserror::Error)]
pub enum TimingsError {
    /// The device detects no signal.
    #[error("video_timings = \"detect\": no signal can be read ({0}); check source and cable")]
    NoSignal(#[source] CallError),
    /// The device does not have these timings.
    #[error("video_timings = \"{wanted}\": the device has no such timings; it has {}", known.join(", "))]
    Unknown {
        /// The wanted timings.
        wanted: VideoTimings,
        /// The timings of the device.
        known: Vec<String>,
    },
    /// The device took other timings.
    #[error("video_timings = \"{wanted}\": the device took {answered}")]
    Other {
        /// The wanted timings.
        wanted: VideoTimings,
        /// The timings that it took.
        answered: String,
    },
    /// A call was refused.
    #[error("video_timings = \"{wanted}\": {source}; leave video_timings out for a device without a video signal")]
    Call {
        /// The wanted timings.
        wanted: VideoTimings,
        /// The refused call.
        #[source]
        source: CallError,
    },
}

/// Sets the timings and reads them back.
///
/// # Errors
/// There is no signal, or the device has no such timings.
pub(crate) fn set(device: &Device, wanted: VideoTimings) -> Result<Signal, TimingsError> {
    let refused = |source| TimingsError::Call { wanted, source };
    let mut timings = match wanted {
        VideoTimings::Detect => query_signal(device).map_err(|error| match error.errno() {
            Some(Errno::NOLINK | Errno::NOLCK | Errno::RANGE) => TimingsError::NoSignal(error),
            _ => refused(error),
        })?,
        VideoTimings::Signal { size_px, rate_hz } => {
            choose(&list_timings(device), size_px, rate_hz).map_err(|known| TimingsError::Unknown { wanted, known })?
        }
    };
    let requested = Signal::from_timings(&timings);
    device.call(&S_DV_TIMINGS, &mut timings).map_err(refused)?;
    let answered = read_current(device).map_err(refused)?;
    if answered.size_px == requested.size_px && is_same_rate(answered.rate_hz, requested.rate_hz) {
        return Ok(answered);
    }
    Err(TimingsError::Other { wanted, answered: answered.to_string() })
}

/// Reads the timings that the device is set to.
///
/// # Errors
/// The device has no timings.
pub(crate) fn read_current(device: &Device) -> Result<Signal, CallError> {
    let mut timings = zeroed();
    device.call(&G_DV_TIMINGS, &mut timings)?;
    Ok(Signal::from_timings(&timings))
}

/// Detects the signal at the device.
///
/// # Errors
/// The device detects no signal.
pub(crate) fn detect(device: &Device) -> Result<Signal, CallError> {
    query_signal(device).map(|timings| Signal::from_timings(&timings))
}

/// Whether the selected input takes a digital video signal.
pub(crate) fn input_has_timings(device: &Device) -> bool {
    let mut index = 0;
    if device.call(&G_INPUT, &mut index).is_err() {
        return false;
    }
    let mut input = v4l2_input { index: index.unsigned_abs(), ..zeroed() };
    device.call(&ENUMINPUT, &mut input).is_ok() && input.capabilities & V4L2_IN_CAP_DV_TIMINGS != 0
}

/// Lists the timings that the device supports.
pub(crate) fn list_timings(device: &Device) -> Vec<v4l2_dv_timings> {
    let timings = |index| v4l2_enum_dv_timings { index, ..zeroed() };
    enumerate(device, &ENUM_DV_TIMINGS, timings).into_iter().map(|found| found.timings).collect()
}

fn query_signal(device: &Device) -> Result<v4l2_dv_timings, CallError> {
    let mut timings = zeroed();
    device.call(&QUERY_DV_TIMINGS, &mut timings)?;
    Ok(timings)
}

/// Returns the progressive timings of a size with the nearest rate.
///
/// # Errors
/// There are none; the names of all known timings.
fn choose(known: &[v4l2_dv_timings], size_px: [u32; 2], rate_hz: f64) -> Result<v4l2_dv_timings, Vec<String>> {
    let distance = |timings: &v4l2_dv_timings| (Signal::from_timings(timings).rate_hz - rate_hz).abs();
    let fits = |timings: &&v4l2_dv_timings| {
        let signal = Signal::from_timings(timings);
        signal.size_px == size_px && !signal.is_interlaced && is_same_rate(signal.rate_hz, rate_hz)
    };
    let nearest = known.iter().filter(fits).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.copied().ok_or_else(|| known.iter().map(|timings| Signal::from_timings(timings).to_string()).collect())
}

fn is_same_rate(rate_hz: f64, wanted_hz: f64) -> bool {
    (rate_hz - wanted_hz).abs() <= RATE_TOLERANCE * wanted_hz
}

impl Signal {
    fn from_timings(timings: &v4l2_dv_timings) -> Self {
        let bt = video_timings(timings);
        Self {
            size_px: [bt.width, bt.height],
            rate_hz: rate_hz(&bt),
            is_interlaced: bt.interlaced == V4L2_DV_INTERLACED,
        }
    }
}

/// Returns the frame rate: the pixel clock divided by the pixels of an image with its blanking; 0 for invalid timings.
fn rate_hz(bt: &v4l2_bt_timings) -> f64 {
    let sum = |parts: [u32; 4]| parts.into_iter().map(f64::from).sum::<f64>();
    let width = sum([bt.width, bt.hfrontporch, bt.hsync, bt.hbackporch]);
    let second_field = if bt.interlaced == V4L2_DV_INTERLACED {
        sum([bt.il_vfrontporch, bt.il_vsync, bt.il_vbackporch, 0])
    } else {
        0.0
    };
    let height = sum([bt.height, bt.vfrontporch, bt.vsync, bt.vbackporch]) + second_field;
    // The flag turns rates such as 60 into 59.94.
    let slowed = if bt.flags & V4L2_DV_FL_REDUCED_FPS != 0 { 1000.0 / 1001.0 } else { 1.0 };
    let pixels = width * height;
    if pixels > 0.0 { bt.pixelclock as f64 * slowed / pixels } else { 0.0 }
}

impl std::fmt::Display for Signal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [width, height] = self.size_px;
        let interlaced = if self.is_interlaced { " interlaced" } else { "" };
        write!(f, "{width}x{height}@{}{interlaced}", rate_text(self.rate_hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CEA-861 1920x1080 at 60 Hz, the same at 59.94 Hz by flag, SXGA, and interlaced 1080.
    fn known() -> Vec<v4l2_dv_timings> {
        let timings = |size: [u32; 2], blanking: [u32; 2], pixelclock, flags, interlaced| {
            let bt = v4l2_bt_timings {
                width: size[0],
                height: size[1],
                hsync: blanking[0],
                vsync: blanking[1],
                pixelclock,
                flags,
                interlaced,
                ..video_timings(&zeroed())
            };
            let mut timings: v4l2_dv_timings = zeroed();
            timings.__bindgen_anon_1.bt = bt;
            timings
        };
        vec![
            timings([1920, 1080], [280, 45], 148_500_000, 0, 0),
            timings([1920, 1080], [280, 45], 148_500_000, V4L2_DV_FL_REDUCED_FPS, 0),
            timings([1280, 1024], [408, 42], 108_000_000, 0, 0),
            timings([1920, 540], [280, 22], 74_250_000, 0, V4L2_DV_INTERLACED),
        ]
    }

    fn rate_of(size_px: [u32; 2], rate_hz: f64) -> Result<String, Vec<String>> {
        choose(&known(), size_px, rate_hz).map(|timings| Signal::from_timings(&timings).to_string())
    }

    #[test]
    fn the_nearest_rate_of_the_size_is_chosen() {
        assert_eq!(rate_of([1920, 1080], 60.0).unwrap(), "1920x1080@60");
        assert_eq!(rate_of([1920, 1080], 59.94).unwrap(), "1920x1080@59.94");
        assert_eq!(rate_of([1280, 1024], 60.0).unwrap(), "1280x1024@60.02");
    }

    #[test]
    fn other_timings_are_refused_with_the_known_ones() {
        let known = rate_of([1280, 1024], 75.0).unwrap_err();
        assert_eq!(known.len(), 4);
        assert!(known[3].ends_with("interlaced"), "{known:?}");
        assert!(rate_of([1920, 540], 60.05).is_err());
    }

    #[test]
    fn timings_of_zeros_have_no_rate() {
        assert_eq!(Signal::from_timings(&zeroed()).rate_hz, 0.0);
    }
}
