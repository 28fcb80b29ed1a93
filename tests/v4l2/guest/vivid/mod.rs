//! Cameras of the driver vivid: what they send, what can be set, and all that it can make go wrong.

mod cost;
mod errors;
mod losses;
mod signals;
mod unplugging;
mod wraps;

use super::driver::Driver;
use super::scanner::configuration;

/// The device of camera 1, as long as nothing takes its number.
const DEVICE: &str = "/dev/video0";
/// What V4L2 calls the place where vivid's first device sits.
const BUS: &str = "bus:platform:vivid-000";

/// Two devices with a digital input each.
fn load() -> Driver {
    Driver::load("vivid", &["n_devs=2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=3,3"])
}

/// A scanner with both devices at 50 Hz, a rate that is a whole number of the guest's clock ticks; `controls` of camera 1.
fn scanner(controls: &str) -> String {
    let camera = |number: usize, controls: &str| {
        format!(
            "[cameras.cam{}]\ndevice = \"bus:platform:vivid-00{number}\"\nvideo_timings = \"1280x720@50\"\n\
             [cameras.cam{}.controls]\ntimestamp_source = \"Start of Exposure\"\n{controls}\n",
            number + 1,
            number + 1
        )
    };
    configuration(&format!("rate_hz = 50.0\n{}{}", camera(0, controls), camera(1, "")), "")
}
