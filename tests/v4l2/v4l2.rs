//! Capture from V4L2 devices in a small virtual machine. It boots Debian's kernel and runs this repository's programs
//! on the host's root. The driver vivid simulates cameras and their faults; v4l2loopback delivers given images.
//!
//! On the host, these tests boot the machine and wait for its result. In the machine, the same executable runs the
//! tests of [`guest`], which are ignored on the host:
//!
//! | boot | devices | tests |
//! |---|---|---|
//! | `guest::images` | two vivid cameras | formats, controls, rates, exact counts of dropped images |
//! | `guest::faults` | up to twelve vivid cameras | each error that vivid can inject, twenty times; signals |
//! | `guest::loopback` | two v4l2loopback devices | clouds as from files; both views of one device; JPEG; skew; cost |
//! | `guest::long_run` | one or two of the same | by hand: any format, rate and duration, with exact accounts |
//!
//! The loopback devices deliver images of the virtual scanner. Rates and latencies are not asserted: the machine is
//! emulated and slow.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used, clippy::panic)]
// Tests print measurements and failures to standard error.
#![allow(clippy::print_stderr)]

mod guest;
mod machine;
mod scenes;
// The guest uses only part of it.
#[allow(dead_code)]
#[path = "../../services/fringeflow/tests/live/support/mod.rs"]
mod support;

#[test]
fn images_of_vivid_cameras() {
    machine::run("guest::images", scenes::make_scenes);
}

#[test]
fn faults_of_vivid_cameras() {
    machine::run("guest::faults", scenes::make_scenes);
}

#[test]
fn the_pipeline_on_loopback_cameras() {
    machine::run("guest::loopback", |share| {
        scenes::make_scenes(share);
        scenes::make_scene_of_size(share, guest::SIZE_OF_CAMERAS);
        scenes::make_scene_of_size(share, guest::SIZE_OF_JPEG);
    });
}

#[test]
#[ignore = "by hand, see guest/long_run.rs"]
fn a_long_run() {
    let runs = guest::LongRuns::parse(std::env::var("LONG_RUN").unwrap());
    machine::run_longer("guest::long_run", runs.limit_s(), |share| runs.make(share));
}
