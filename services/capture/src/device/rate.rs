//! Images a second: set where the device can be told, and read back.

use v4l::v4l_sys::{V4L2_CAP_TIMEPERFRAME, v4l2_fract, v4l2_streamparm};

use super::offer::{rate_hz, rates_text, shown};
use crate::ioctl::{CallError, Device, G_PARM, S_PARM, capture_parameters, zeroed};

/// Share by which the rate may be off.
const TOLERANCE: f64 = 0.01;
/// Thousandths: rates are told to drivers so exactly.
const PARTS: f64 = 1000.0;

/// Why the images do not come at the rate that is wanted.
#[derive(Debug, thiserror::Error)]
pub enum RateError {
    /// The device sends at another rate.
    #[error(
        "the device sends {} images a second instead of {}{}; change cameras.rate_hz, shorten the exposure, or keep the \
         rate of the device with set_rate = false", shown(*answered_hz), shown(*wanted_hz), offer(offered_hz)
    )]
    Other {
        /// What is wanted.
        wanted_hz: f64,
        /// What the device says.
        answered_hz: f64,
        /// What it offers at this format and size, slowest and fastest of each.
        offered_hz: Vec<[f64; 2]>,
    },
    /// It cannot be told.
    #[error("{} images a second: {source}; keep the rate of the device with set_rate = false", shown(*wanted_hz))]
    Refused {
        /// What is wanted.
        wanted_hz: f64,
        /// The call.
        #[source]
        source: CallError,
    },
}

fn offer(rates_hz: &[[f64; 2]]) -> String {
    if rates_hz.is_empty() { String::new() } else { format!("; it offers {}", rates_text(rates_hz)) }
}

/// Tells the device the rate, if it can be told.
///
/// # Errors
/// The device refuses it.
pub(crate) fn set(device: &Device, kind: u32, rate_hz: f64) -> Result<(), RateError> {
    let mut parameters = v4l2_streamparm { type_: kind, ..zeroed() };
    if !can_be_told(device, &mut parameters) {
        return Ok(());
    }
    capture_parameters(&mut parameters).timeperframe = interval(rate_hz);
    let refused = |source| RateError::Refused { wanted_hz: rate_hz, source };
    device.call(&S_PARM, &mut parameters).map_err(refused)
}

/// The rate at this moment; `None` where the device does not tell.
pub(crate) fn read(device: &Device, kind: u32) -> Option<f64> {
    let mut parameters = v4l2_streamparm { type_: kind, ..zeroed() };
    let tells = can_be_told(device, &mut parameters);
    tells.then(|| rate_hz(capture_parameters(&mut parameters).timeperframe)).flatten()
}

fn can_be_told(device: &Device, parameters: &mut v4l2_streamparm) -> bool {
    // A device that knows no parameters refuses the call.
    let answered = device.call(&G_PARM, parameters).is_ok();
    answered && capture_parameters(parameters).capability & V4L2_CAP_TIMEPERFRAME != 0
}

/// Whether a rate is the one that is wanted.
pub(crate) fn is_kept(answered_hz: f64, wanted_hz: f64) -> bool {
    (answered_hz - wanted_hz).abs() <= TOLERANCE * wanted_hz
}

/// The time from image to image as a fraction of seconds.
fn interval(rate_hz: f64) -> v4l2_fract {
    let whole = (rate_hz - rate_hz.round()).abs() < 1e-9;
    let parts = if whole { 1.0 } else { PARTS };
    v4l2_fract { numerator: parts as u32, denominator: (rate_hz * parts).round() as u32 }
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
    fn a_percent_is_let_through() {
        assert!(is_kept(59.94, 60.0) && is_kept(60.5, 60.0) && !is_kept(59.0, 60.0) && !is_kept(f64::NAN, 60.0));
    }

    #[test]
    fn what_is_offered_instead_is_told() {
        let error =
            RateError::Other { wanted_hz: 60.0, answered_hz: 30.0, offered_hz: vec![[30.0, 30.0], [15.0, 15.0]] };
        assert!(error.to_string().starts_with("the device sends 30 images a second instead of 60; it offers 30, 15;"));
    }
}
