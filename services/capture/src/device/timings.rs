//! Timings of a digital video signal: a grabber must be told which signal it gets before it tells its image size.

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

use super::offer::{list, shown};

/// Share by which two rates may differ and be the same: 60 and 59.94.
const SAME_RATE: f64 = 0.01;

/// A signal, as far as it matters here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Signal {
    /// Width and height, pixels.
    pub(crate) size_px: [u32; 2],
    /// Images a second.
    pub(crate) rate_hz: f64,
    /// Whether it sends every other row of an image.
    pub(crate) is_interlaced: bool,
}

/// Why the timings cannot be set.
#[derive(Debug, thiserror::Error)]
pub enum TimingsError {
    /// There is nothing to be detected.
    #[error("video_timings = \"detect\": no signal can be read ({0}); check source and cable")]
    NoSignal(#[source] CallError),
    /// The device knows no such timings.
    #[error("video_timings = \"{wanted}\": the device has no such timings; it has {}", known.join(", "))]
    Unknown {
        /// What is wanted.
        wanted: VideoTimings,
        /// What it has.
        known: Vec<String>,
    },
    /// The device took others.
    #[error("video_timings = \"{wanted}\": the device took {answered}")]
    Other {
        /// What is wanted.
        wanted: VideoTimings,
        /// What it took.
        answered: String,
    },
    /// A call was refused.
    #[error("video_timings = \"{wanted}\": {source}; leave video_timings out for a device without a video signal")]
    Call {
        /// What is wanted.
        wanted: VideoTimings,
        /// The call.
        #[source]
        source: CallError,
    },
}

/// Sets timings and reads them back.
///
/// # Errors
/// There is no signal, or the device has no such timings.
pub(crate) fn set(device: &Device, wanted: VideoTimings) -> Result<Signal, TimingsError> {
    let refused = |source| TimingsError::Call { wanted, source };
    let mut timings = match wanted {
        VideoTimings::Detect => detected(device).map_err(|error| match error.errno() {
            Some(Errno::NOLINK | Errno::NOLCK | Errno::RANGE) => TimingsError::NoSignal(error),
            _ => refused(error),
        })?,
        VideoTimings::Signal { size_px, rate_hz } => {
            choose(&known(device), size_px, rate_hz).map_err(|known| TimingsError::Unknown { wanted, known })?
        }
    };
    let asked = Signal::of(&timings);
    device.call(&S_DV_TIMINGS, &mut timings).map_err(refused)?;
    let answered = present(device).map_err(refused)?;
    if answered.size_px == asked.size_px && is_same_rate(answered.rate_hz, asked.rate_hz) {
        return Ok(answered);
    }
    Err(TimingsError::Other { wanted, answered: answered.to_string() })
}

/// The timings that the device is set to.
///
/// # Errors
/// It has none.
pub(crate) fn present(device: &Device) -> Result<Signal, CallError> {
    let mut timings = zeroed();
    device.call(&G_DV_TIMINGS, &mut timings)?;
    Ok(Signal::of(&timings))
}

/// The signal that the device sees.
///
/// # Errors
/// It sees none.
pub(crate) fn seen(device: &Device) -> Result<Signal, CallError> {
    detected(device).map(|timings| Signal::of(&timings))
}

/// Whether the input in use gets a digital video signal.
pub(crate) fn input_has_timings(device: &Device) -> bool {
    let mut index = 0;
    if device.call(&G_INPUT, &mut index).is_err() {
        return false;
    }
    let mut input = v4l2_input { index: index.unsigned_abs(), ..zeroed() };
    device.call(&ENUMINPUT, &mut input).is_ok() && input.capabilities & V4L2_IN_CAP_DV_TIMINGS != 0
}

/// All timings that the device knows.
pub(crate) fn known(device: &Device) -> Vec<v4l2_dv_timings> {
    let timings = |index| v4l2_enum_dv_timings { index, ..zeroed() };
    list(device, &ENUM_DV_TIMINGS, timings).into_iter().map(|found| found.timings).collect()
}

fn detected(device: &Device) -> Result<v4l2_dv_timings, CallError> {
    let mut timings = zeroed();
    device.call(&QUERY_DV_TIMINGS, &mut timings)?;
    Ok(timings)
}

/// The timings of this size whose rate is nearest; the names of all where there are none.
fn choose(known: &[v4l2_dv_timings], size_px: [u32; 2], rate_hz: f64) -> Result<v4l2_dv_timings, Vec<String>> {
    let distance = |timings: &v4l2_dv_timings| (Signal::of(timings).rate_hz - rate_hz).abs();
    let fits = |timings: &&v4l2_dv_timings| {
        let signal = Signal::of(timings);
        signal.size_px == size_px && !signal.is_interlaced && is_same_rate(signal.rate_hz, rate_hz)
    };
    let nearest = known.iter().filter(fits).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.copied().ok_or_else(|| known.iter().map(|timings| Signal::of(timings).to_string()).collect())
}

fn is_same_rate(rate_hz: f64, wanted_hz: f64) -> bool {
    (rate_hz - wanted_hz).abs() <= SAME_RATE * wanted_hz
}

impl Signal {
    fn of(timings: &v4l2_dv_timings) -> Self {
        let bt = video_timings(timings);
        Self {
            size_px: [bt.width, bt.height],
            rate_hz: rate_hz(&bt),
            is_interlaced: bt.interlaced == V4L2_DV_INTERLACED,
        }
    }
}

/// Images a second: pixels a second over the pixels of an image with its blanking; 0 for timings that are none.
fn rate_hz(bt: &v4l2_bt_timings) -> f64 {
    let sum = |parts: [u32; 4]| parts.into_iter().map(f64::from).sum::<f64>();
    let width = sum([bt.width, bt.hfrontporch, bt.hsync, bt.hbackporch]);
    let second_field = if bt.interlaced == V4L2_DV_INTERLACED {
        sum([bt.il_vfrontporch, bt.il_vsync, bt.il_vbackporch, 0])
    } else {
        0.0
    };
    let height = sum([bt.height, bt.vfrontporch, bt.vsync, bt.vbackporch]) + second_field;
    let slowed = if bt.flags & V4L2_DV_FL_REDUCED_FPS != 0 { 1000.0 / 1001.0 } else { 1.0 };
    let pixels = width * height;
    if pixels > 0.0 { bt.pixelclock as f64 * slowed / pixels } else { 0.0 }
}

impl std::fmt::Display for Signal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [width, height] = self.size_px;
        let interlaced = if self.is_interlaced { " interlaced" } else { "" };
        write!(f, "{width}x{height}@{}{interlaced}", shown(self.rate_hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CEA-861 1920x1080 at 60, and at 59.94 Hz by flag; SXGA; interlaced 1080.
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
        choose(&known(), size_px, rate_hz).map(|timings| Signal::of(&timings).to_string())
    }

    #[test]
    fn the_nearest_rate_of_the_size_is_chosen() {
        assert_eq!(rate_of([1920, 1080], 60.0).unwrap(), "1920x1080@60");
        assert_eq!(rate_of([1920, 1080], 59.94).unwrap(), "1920x1080@59.94");
        assert_eq!(rate_of([1280, 1024], 60.0).unwrap(), "1280x1024@60.02");
    }

    #[test]
    fn others_are_refused_with_what_there_is() {
        let known = rate_of([1280, 1024], 75.0).unwrap_err();
        assert_eq!(known.len(), 4);
        assert!(known[3].ends_with("interlaced"), "{known:?}");
        assert!(rate_of([1920, 540], 60.05).is_err());
    }

    #[test]
    fn timings_of_zeros_have_no_rate() {
        assert_eq!(Signal::of(&zeroed()).rate_hz, 0.0);
    }
}
