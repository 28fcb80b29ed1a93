//! Prepares a device for streaming: sets format, rate and controls as configured, and reads them back.
//!
//! In: an open device and its configuration. Out: the layout of its images in buffers, and the rate and exposure time
//! that the device reports. A setting that the device does not take as written is an error.

use std::collections::BTreeMap;

use rustix::io::Errno;
use v4l::v4l_sys::{V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_MODIFY_LAYOUT};

use fringeflow_config::{ControlValue, V4l2Camera};

use crate::ioctl::{BufferKind, CallError, Device};

use super::capability::Capability;
use super::controls::{self, Control};
use super::extension_units::{self, ExtensionUnitError};
use super::find::is_lasting;
use super::format::{self, FormatError, Layout, format_text};
use super::offer::{self, rate_text};
use super::rate::{self, RateError};
use super::setting::{self, ControlError, Joined};
use super::timings::{self, Signal, TimingsError};
use super::wanted::Wanted;

/// Unit of the exposure control, nanoseconds.
const EXPOSURE_UNIT_NS: u64 = 100_000;

/// A device that is ready to stream.
#[derive(Debug)]
pub(crate) struct Prepared {
    /// Kind of its buffers.
    pub(crate) kind: BufferKind,
    /// Bytes from one row of an image to the next.
    pub(crate) stride_bytes: usize,
    /// Exposure time, nanoseconds; `None` if neither the configuration nor the device states it.
    pub(crate) exposure_ns: Option<u64>,
    /// What was read back, and what is unknown, as text.
    pub(crate) notes: Vec<String>,
}

/// Why a device cannot be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// The device is not a camera.
    #[error("it is {what}; `fringeflow cameras` lists the cameras")]
    NoCamera {
        /// What it is instead.
        what: &'static str,
    },
    /// A loopback device without a writer.
    #[error("it is a loopback device, and no program writes into it yet")]
    NoWriter,
    /// The timings of the video signal.
    #[error(transparent)]
    Timings(#[from] TimingsError),
    /// The format or size of the images.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The frame rate.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// The controls.
    #[error("{}", Joined(.0))]
    Controls(Vec<ControlError>),
    /// A setting of an extension unit.
    #[error(transparent)]
    ExtensionUnit(#[from] ExtensionUnitError),
    /// A setting changed the format.
    #[error(
        "after all settings the device sends {found} instead of {wanted}; leave out the control that changes the format"
    )]
    FormatChanged {
        /// Format and size that were set.
        wanted: String,
        /// Format and size after all settings.
        found: String,
    },
    /// A call was refused.
    #[error(transparent)]
    Call(#[from] CallError),
}

impl PrepareError {
    /// Whether the configuration must change. Otherwise the device is gone, busy or without a signal, and a retry may
    /// help.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::NoWriter | Self::Timings(TimingsError::NoSignal(_)) => false,
            Self::Call(error)
            | Self::Format(FormatError::Call(error))
            | Self::Rate(RateError::Refused { source: error, .. })
            | Self::Timings(TimingsError::Call { source: error, .. }) => is_lasting(&error.source),
            Self::Controls(errors) => errors.iter().any(ControlError::is_lasting),
            Self::ExtensionUnit(error) => error.is_lasting(),
            Self::NoCamera { .. } | Self::Timings(_) | Self::Format(_) | Self::Rate(_) | Self::FormatChanged { .. } => {
                true
            }
        }
    }
}

/// Sets a device as configured, and reads the settings back.
///
/// # Errors
/// The device is not a camera, does not take a setting as written, or is gone or busy.
pub(crate) fn prepare(
    device: &Device,
    capability: &Capability,
    camera: &V4l2Camera,
    wanted: &Wanted,
) -> Result<Prepared, PrepareError> {
    let rate_hz = wanted.rate_hz;
    let kind = buffer_type(capability)?;
    let signal = camera.video_timings.map(|wanted| timings::set(device, wanted)).transpose()?;
    let controls = controls::list_controls(device)?;
    let [before, after] = split_settings(&controls, &camera.controls);
    // Controls that rotate or crop the images change the format, so they are set before it.
    setting::set(device, &controls, &before).map_err(PrepareError::Controls)?;
    let layout = format::set(device, kind, wanted).map_err(|error| format_error(capability, error))?;
    if camera.set_rate {
        rate::set(device, kind, rate_hz)?;
    }
    setting::set(device, &controls, &after).map_err(PrepareError::Controls)?;
    let units = extension_units::set(device, capability, &camera.extension_units)?;
    let mut notes = vec![format_text(layout.code, layout.size_px)];
    // Only now: a later setting may have changed an earlier one, or the format.
    let read = setting::read_back(device, &controls, &camera.controls).map_err(PrepareError::Controls)?;
    let found = format::read(device, kind)?;
    if found != layout {
        return Err(format_changed(&layout, &found));
    }
    let found_hz = final_rate(device, camera, signal, &layout, rate_hz)?;
    notes.push(found_hz.map_or_else(
        || "the device does not state its rate".to_owned(),
        |found_hz| format!("{} images a second", rate_text(found_hz)),
    ));
    let exposure_ns = exposure_ns(device, camera);
    notes.push(
        exposure_ns
            .map_or_else(|| "exposure time unknown".to_owned(), |ns| format!("exposure {} ms", ns as f64 * 1e-6)),
    );
    notes.extend(read);
    notes.extend(units);
    Ok(Prepared { kind: layout.kind, stride_bytes: layout.stride_bytes as usize, exposure_ns, notes })
}

fn buffer_type(capability: &Capability) -> Result<u32, PrepareError> {
    capability.buffer_type().map_err(|what| match capability.lacks_writer() {
        true => PrepareError::NoWriter,
        false => PrepareError::NoCamera { what },
    })
}

/// Converts an error of the format. Some loopback devices report that they are cameras, but take no format before a
/// program writes into them.
fn format_error(capability: &Capability, error: FormatError) -> PrepareError {
    match error {
        FormatError::Call(error) if capability.is_loopback() && error.errno() == Some(Errno::BUSY) => {
            PrepareError::NoWriter
        }
        error => error.into(),
    }
}

fn format_changed(wanted: &Layout, found: &Layout) -> PrepareError {
    let text = |layout: &Layout| {
        let Layout { stride_bytes, image_bytes, .. } = layout;
        format!("{} ({image_bytes} bytes, {stride_bytes} per row)", format_text(layout.code, layout.size_px))
    };
    PrepareError::FormatChanged { wanted: text(wanted), found: text(found) }
}

/// Separates the settings that change the format from the others.
fn split_settings(
    controls: &[Control],
    settings: &BTreeMap<String, ControlValue>,
) -> [BTreeMap<String, ControlValue>; 2] {
    let changes_format = |name: &str| {
        controls.iter().any(|control| control.name == name && control.has_flag(V4L2_CTRL_FLAG_MODIFY_LAYOUT))
    };
    let (before, after) = settings.clone().into_iter().partition(|(name, _)| changes_format(name));
    [before, after]
}

/// Returns the frame rate after all settings; `None` if the device does not report it.
///
/// # Errors
/// The rate was set and is another one now.
fn final_rate(
    device: &Device,
    camera: &V4l2Camera,
    signal: Option<Signal>,
    layout: &Layout,
    wanted_hz: f64,
) -> Result<Option<f64>, RateError> {
    let found = rate::read(device, layout.kind.code).or(signal.map(|signal| signal.rate_hz));
    match found {
        Some(answered_hz) if camera.set_rate && !rate::is_close(answered_hz, wanted_hz) => {
            let offered_hz = offer::list_rates(device, layout.code, layout.size_px);
            Err(RateError::Other { wanted_hz, answered_hz, offered_hz })
        }
        found => Ok(found),
    }
}

/// Returns the configured exposure time, or that of the device; `None` if the exposure is automatic or unknown.
fn exposure_ns(device: &Device, camera: &V4l2Camera) -> Option<u64> {
    let read = || {
        let control = controls::query_control(device, V4L2_CID_EXPOSURE_ABSOLUTE).ok()?;
        if control.has_flag(V4L2_CTRL_FLAG_INACTIVE) {
            return None;
        }
        match control.read(device).ok()?? {
            ControlValue::Number(units) => u64::try_from(units).ok()?.checked_mul(EXPOSURE_UNIT_NS),
            _ => None,
        }
    };
    camera.exposure_ns.or_else(read)
}
