//! Scanners with cameras of the driver vivid.

use super::driver::Driver;
use super::scanner::configuration;
use crate::scenes;

/// The device of camera 1, unless another device takes its number.
pub(crate) const DEVICE: &str = "/dev/video0";

/// Loads vivid with two devices that have a digital input each.
pub(crate) fn load() -> Driver {
    Driver::load("vivid", &["n_devs=2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=3,3"])
}

/// A scanner with both devices at 50 Hz, which is a whole number of the guest's clock ticks. `controls` are those of
/// camera 1.
pub(crate) fn scanner(controls: &str) -> String {
    scanner_at("1280x720@50", controls)
}

/// A scanner with this video signal at both devices.
pub(crate) fn scanner_at(signal: &str, controls: &str) -> String {
    let (_, rate_hz) = signal.split_once('@').unwrap();
    let camera = |number: usize, controls: &str| {
        format!(
            "[cameras.cam{number}]\ndevice = \"bus:platform:vivid-00{}\"\nvideo_timings = \"{signal}\"\n\
             [cameras.cam{number}.controls]\ntimestamp_source = \"Start of Exposure\"\n{controls}\n",
            number - 1
        )
    };
    // Both devices run free, at the same rate, and start at any time.
    let max_skew_us = 5e5 / rate_hz.parse::<f64>().unwrap();
    let cameras = [camera(1, controls), camera(2, "")].concat();
    let cameras = format!("rate_hz = {rate_hz}.0\nmax_skew_us = {max_skew_us:.1}\n{cameras}");
    configuration(&scenes::all()[0], &cameras, "")
}
