//! Cameras of the driver v4l2loopback: they deliver the images that are written to them.

mod cost;
mod feeder;
mod free_running;
mod jpeg;
mod pipeline;
mod silence;
mod stereo;
mod ticking;
mod writer;

use std::time::Duration;

use super::driver::Driver;
use super::scanner::configuration;
use crate::scenes::{self, Scene};

pub(crate) use cost::SIZE as SIZE_OF_CAMERAS;
pub(crate) use jpeg::SIZE as SIZE_OF_JPEG;
pub(super) use ticking::{Shown, Ticking};

/// The devices of both cameras.
pub(super) const DEVICES: [&str; 2] = ["/dev/video10", "/dev/video11"];
/// Buffers of a device, for driver and reader. If the reader had fewer, the driver would overwrite images that are
/// being read.
pub(super) const BUFFERS: usize = 16;
/// Nominal images per second. An image that is half a period early or late breaks its window.
const RATE_HZ: f64 = 1.0;
/// Time from image to image: shorter than nominal, so a pause of this machine rarely makes one late.
const PERIOD: Duration = Duration::from_millis(600);

/// Loads the driver.
pub(super) fn load() -> Driver {
    Driver::load("v4l2loopback", &["devices=2", "video_nr=10,11", &format!("max_buffers={BUFFERS}")])
}

/// A scanner with the rig of a scene that uses every image once. `settings` are appended to the table of each camera.
fn scanner(scene: &Scene, format: &str, settings: &str) -> String {
    // Both images of a pair are written one after the other, and this machine may pause in between.
    let max_skew_us = 4e5 / RATE_HZ;
    let cameras = format!(
        "rate_hz = {RATE_HZ:.1}\nmax_skew_us = {max_skew_us:.1}\nformat = \"{format}\"\n{}{}",
        camera_table("cam1", DEVICES[0], settings),
        camera_table("cam2", DEVICES[1], settings)
    );
    let rest = format!("[window]\nevery = {}\nwhen_busy = \"wait\"\n", scenes::STEPS);
    configuration(scene, &cameras, &rest)
}

/// The table of a camera, `cam1`, `cam2` or `both`, with further keys.
pub(super) fn camera_table(name: &str, device: &str, settings: &str) -> String {
    format!("[cameras.{name}]\ndevice = \"{device}\"\nset_rate = false\nbuffers = {BUFFERS}\n{settings}\n")
}
