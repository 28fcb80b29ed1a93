//! Sets the frame rate, if the device supports it, and reads it back.

use v4l::v4l_sys::{V4L2_CAP_TIMEPERFRAME, v4l2_fract, v4l2_streamparm};

use super::offer::{rate_hz, rate_text, rates_text};
use crate::ioctl::{CallError, Device, G_PARM, S_PARM, capture_parameters, zeroed};

/// Relative tolerance of the rate.
const TOLERANCE: f64 = 0.01;
/// Numerator of a frame interval: drivers get rates with three decimals.
const NUMERATOR: f64 = 1000.0;

/// Why a device does not send at the wanted rate.
#[derive(Debug, thiserror::Error)]
pub enum RateError {
    /// The device sends at another rate.
    #[error(
        "the device sends {} images a second instead of {}{}; change cameras.rate_hz, shorten the exposure, or keep \
         the rate of the device with set_rate = false",
        rate_text(*answered_hz), rate_text(*wanted_hz), offer_text(offered_hz)
    )]
    Other {
        /// The wanted rate.
        wanted_hz: f64,
        /// The rate that the device reports.
        answered_hz: f64,
        /// Ranges that the device offers at this format and size, from slowest to fastest.
        offered_hz: Vec<[f64; 2]>,
    },
    /// The device refuses the rate.
    #[error("{} images a second: {source}; keep the rate of the device with set_rate = false", rate_text(*wanted_hz))]
    Refused {
        /// The wanted rate.
        wanted_hz: f64,
        /// The refused call.
        #[source]
        source: CallError,
    },
}

fn offer_text(rates_hz: &[[f64; 2]]) -> String {
    if rates_hz.is_empty() { String::new() } else { format!("; it offers {}", rates_text(rates_hz)) }
}

/// Sets the rate, if the device has a rate that can be set.
///
/// # Errors
/// The device refuses it.
pub(crate) fn set(device: &Device, kind: u32, rate_hz: f64) -> Result<(), RateError> {
    let mut parameters = v4l2_streamparm { type_: kind, ..zeroed() };
    if !has_rate(device, &mut parameters) {
        return Ok(());
    }
    capture_parameters(&mut parameters).timeperframe = interval(rate_hz);
    let refused = |source| RateError::Refused { wanted_hz: rate_hz, source };
    device.call(&S_PARM, &mut parameters).map_err(refused)
}

/// Reads the current rate. Returns `None` if the device does not report it.
pub(crate) fn read(device: &Device, kind: u32) -> Option<f64> {
    let mut parameters = v4l2_streamparm { type_: kind, ..zeroed() };
    let has_rate = has_rate(device, &mut parameters);
    has_rate.then(|| rate_hz(capture_parameters(&mut parameters).timeperframe)).flatten()
}

/// Reads the parameters of a stream. Returns whether they contain a frame rate.
fn has_rate(device: &Device, parameters: &mut v4l2_streamparm) -> bool {
    // A device without parameters refuses the call.
    let answered = device.call(&G_PARM, parameters).is_ok();
    answered && capture_parameters(parameters).capability & V4L2_CAP_TIMEPERFRAME != 0
}

/// Whether a rate is the wanted one within the tolerance.
pub(crate) fn is_close(answered_hz: f64, wanted_hz: f64) -> bool {
    (answered_hz - wanted_hz).abs() <= TOLERANCE * wanted_hz
}

/// Returns the frame interval as a fraction of seconds.
fn interval(rate_hz: f64) -> v4l2_fract {
    let is_whole = (rate_hz - rate_hz.round()).abs() < 1e-9;
    let numerator = if is_whole { 1.0 } else { NUMERATOR };
    v4l2_fract { numerator: numerator as u32, denominator: (rate_hz * numerator).round() as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_become_fractions_of_seconds() {
        let fraction = |rate| {
            let interval = interval(rate);
            [interval.numerator, interval.denominator]
        };
        assert_eq!((fraction(30.0), fraction(59.94), fraction(0.1)), ([1, 30], [1000, 59940], [1000, 100]));
        assert_eq!(fraction(1000.0), [1, 1000]);
    }

    #[test]
    fn rates_within_one_percent_are_accepted() {
        assert!(is_close(59.94, 60.0) && is_close(60.5, 60.0) && !is_close(59.0, 60.0) && !is_close(f64::NAN, 60.0));
    }

    #[test]
    fn the_error_lists_the_offered_rates() {
        let error =
            RateError::Other { wanted_hz: 60.0, answered_hz: 30.0, offered_hz: vec![[30.0, 30.0], [15.0, 15.0]] };
        assert!(error.to_string().starts_with("the device sends 30 images a second instead of 60; it offers 30, 15;"));
    }
}
