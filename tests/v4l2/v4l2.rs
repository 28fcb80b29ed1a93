//! Capture from real V4L2 devices. They live in a small virtual machine, which boots Debian's kernel and this repository's
//! programs on the host's root: vivid simulates cameras with all their faults, v4l2loopback carries given images.
//!
//! On the host the tests here boot the machine and wait for its result. In it this same executable runs the tests of
//! [`guest`], which are ignored on the host:
//!
//! | boot | devices | shows |
//! |---|---|---|
//! | `guest::images` | two vivid cameras | formats, controls, rates, exact counts of what is dropped |
//! | `guest::faults` | up to twelve vivid cameras | every error that vivid can inject, twenty times; signals |
//! | `guest::loopback` | two v4l2loopback devices, fed with images of the virtual scanner | the same clouds as from files; JPEG; cost |
//!
//! Nothing about rates or latencies is asserted: the machine is emulated, and slow.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used, clippy::panic)]
// What a test measures or says when it fails belongs on standard error.
#![allow(clippy::print_stderr)]

mod guest;
mod machine;
mod scenes;
// The guest does not need all of it.
#[allow(dead_code)]
#[path = "../../services/fringeflow/tests/live/support/mod.rs"]
mod support;

#[test]
fn images_of_vivid_cameras() {
    machine::run("guest::images", scenes::make);
}

#[test]
fn faults_of_vivid_cameras() {
    machine::run("guest::faults", scenes::make);
}

#[test]
fn the_pipeline_on_loopback_cameras() {
    machine::run("guest::loopback", |share| {
        scenes::make(share);
        scenes::make_of_size(share, guest::SIZE_OF_CAMERAS);
        scenes::make_of_size(share, guest::SIZE_OF_JPEG);
    });
}
