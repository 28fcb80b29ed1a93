//! A device made ready to stream: format, rate, controls and exposure as configured, set and read back.
//!
//! In: an open device and what the configuration wants of it. Out: how its images will lie in buffers, and what the device
//! says of rate and exposure. A setting that a device does not take as it is written is an error, never a surprise in the
//! images.

use std::collections::BTreeMap;

use rustix::io::Errno;
use v4l::v4l_sys::{V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_MODIFY_LAYOUT};

use fringeflow_config::{ControlValue, V4l2Camera};
use fringeflow_pixels::SourceFormat;

use crate::ioctl::{BufferKind, CallError, Device};

use super::capability::Capability;
use super::controls::{self, Control};
use super::find::is_lasting;
use super::format::{self, FormatError, Layout, named};
use super::offer::{self, shown};
use super::rate::{self, RateError};
use super::setting::{self, ControlError, Joined};
use super::timings::{self, Signal, TimingsError};

/// Unit of the control of the exposure, nanoseconds.
const EXPOSURE_UNIT_NS: u64 = 100_000;

/// The images that are wanted of a camera.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// What it sends.
    pub format: SourceFormat,
    /// Width and height, pixels.
    pub size_px: [usize; 2],
    /// Images a second.
    pub rate_hz: f64,
}

/// A device that is ready to stream.
#[derive(Debug)]
pub(crate) struct Prepared {
    /// The buffers that it needs.
    pub(crate) kind: BufferKind,
    /// Bytes from one row to the next.
    pub(crate) stride_bytes: usize,
    /// Length of an exposure, nanoseconds, where configuration or device say so.
    pub(crate) exposure_ns: Option<u64>,
    /// What was read back, and what could not be, for people.
    pub(crate) notes: Vec<String>,
}

/// Why a device cannot be made ready.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// No images come out of it.
    #[error("it is {what}; `fringeflow cameras` lists the devices that are cameras")]
    NoCamera {
        /// What it is.
        what: &'static str,
    },
    /// A loopback device that nobody writes into.
    #[error("it is a loopback device, and no program writes into it yet")]
    Unfed,
    /// The timings of its signal.
    #[error(transparent)]
    Timings(#[from] TimingsError),
    /// Format or size of the images.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Images a second.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// Controls.
    #[error("{}", Joined(.0))]
    Controls(Vec<ControlError>),
    /// Something that was set changed the format.
    #[error(
        "after all settings the device sends {found} instead of {wanted}; leave out the control that changes the format"
    )]
    Unsettled {
        /// Format and size that were set.
        wanted: String,
        /// What the device says in the end.
        found: String,
    },
    /// A call was refused.
    #[error(transparent)]
    Call(#[from] CallError),
}

impl PrepareError {
    /// Whether the configuration must change; else the device is gone, busy or without a signal, and it may be tried again.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Unfed | Self::Timings(TimingsError::NoSignal(_)) => false,
            Self::Call(error)
            | Self::Format(FormatError::Call(error))
            | Self::Rate(RateError::Refused { source: error, .. })
            | Self::Timings(TimingsError::Call { source: error, .. }) => is_lasting(&error.source),
            Self::Controls(errors) => errors.iter().any(ControlError::is_lasting),
            Self::NoCamera { .. } | Self::Timings(_) | Self::Format(_) | Self::Rate(_) | Self::Unsettled { .. } => true,
        }
    }
}

/// Sets a device as configured, and reads back what became of it.
///
/// # Errors
/// It is no camera, does not take a setting as written, or is gone or busy.
pub(crate) fn prepare(device: &Device, camera: &V4l2Camera, wanted: &Wanted) -> Result<Prepared, PrepareError> {
    let Wanted { format, size_px, rate_hz } = *wanted;
    let capability = Capability::read(device)?;
    let kind = stream_of(&capability)?;
    let signal = camera.video_timings.map(|wanted| timings::set(device, wanted)).transpose()?;
    let controls = controls::all(device)?;
    let [before, after] = split(&controls, &camera.controls);
    // What turns or crops the images is part of their format.
    setting::set(device, &controls, &before).map_err(PrepareError::Controls)?;
    let layout = format::set(device, kind, format, size_px).map_err(|error| unfed(&capability, error))?;
    if camera.set_rate {
        rate::set(device, kind, rate_hz)?;
    }
    setting::set(device, &controls, &after).map_err(PrepareError::Controls)?;
    let mut notes = vec![named(layout.code, layout.size_px)];
    let read = setting::read_back(device, &controls, &camera.controls).map_err(PrepareError::Controls)?;
    let settled = format::read(device, kind)?;
    if settled != layout {
        return Err(unsettled(&layout, &settled));
    }
    let found_hz = settled_rate(device, camera, signal, &layout, rate_hz)?;
    notes.push(found_hz.map_or_else(
        || "the device does not state its rate".to_owned(),
        |found_hz| format!("{} images a second", shown(found_hz)),
    ));
    let exposure_ns = exposure_ns(device, camera);
    notes.push(
        exposure_ns
            .map_or_else(|| "length of exposure unknown".to_owned(), |ns| format!("exposure {} ms", ns as f64 * 1e-6)),
    );
    notes.extend(read);
    Ok(Prepared { kind: layout.kind, stride_bytes: layout.stride_bytes as usize, exposure_ns, notes })
}

fn stream_of(capability: &Capability) -> Result<u32, PrepareError> {
    capability.stream().map_err(|what| match capability.is_unfed() {
        true => PrepareError::Unfed,
        false => PrepareError::NoCamera { what },
    })
}

/// A loopback device that calls itself a camera, but takes no format before somebody writes into it.
fn unfed(capability: &Capability, error: FormatError) -> PrepareError {
    match error {
        FormatError::Call(error) if capability.is_loopback() && error.errno() == Some(Errno::BUSY) => {
            PrepareError::Unfed
        }
        error => error.into(),
    }
}

fn unsettled(wanted: &Layout, found: &Layout) -> PrepareError {
    let told = |layout: &Layout| {
        let Layout { stride_bytes, image_bytes, .. } = layout;
        format!("{} ({image_bytes} bytes, {stride_bytes} a row)", named(layout.code, layout.size_px))
    };
    PrepareError::Unsettled { wanted: told(wanted), found: told(found) }
}

/// Settings that change the format, and the others.
fn split(controls: &[Control], settings: &BTreeMap<String, ControlValue>) -> [BTreeMap<String, ControlValue>; 2] {
    let changes_format =
        |name: &str| controls.iter().any(|control| control.name == name && control.has(V4L2_CTRL_FLAG_MODIFY_LAYOUT));
    let (before, after) = settings.clone().into_iter().partition(|(name, _)| changes_format(name));
    [before, after]
}

/// The rate that the device has in the end, which must be the one it was told.
fn settled_rate(
    device: &Device,
    camera: &V4l2Camera,
    signal: Option<Signal>,
    layout: &Layout,
    wanted_hz: f64,
) -> Result<Option<f64>, RateError> {
    let found = rate::read(device, layout.kind.code).or(signal.map(|signal| signal.rate_hz));
    match found {
        Some(answered_hz) if camera.set_rate && !rate::is_kept(answered_hz, wanted_hz) => {
            let offered_hz = offer::rates(device, layout.code, layout.size_px);
            Err(RateError::Other { wanted_hz, answered_hz, offered_hz })
        }
        found => Ok(found),
    }
}

/// Length of an exposure: as configured, or as the device has it; an automatic one is none.
fn exposure_ns(device: &Device, camera: &V4l2Camera) -> Option<u64> {
    let read = || {
        let control = controls::query(device, V4L2_CID_EXPOSURE_ABSOLUTE).ok()?;
        if control.has(V4L2_CTRL_FLAG_INACTIVE) {
            return None;
        }
        match control.read(device).ok()?? {
            ControlValue::Number(units) => u64::try_from(units).ok()?.checked_mul(EXPOSURE_UNIT_NS),
            _ => None,
        }
    };
    camera.exposure_ns.or_else(read)
}
