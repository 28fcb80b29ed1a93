//! A camera is unplugged, and returns under another number.

use std::time::{Duration, Instant};

use fringeflow_message::Incident;

use crate::guest::capture::Capture;
use crate::guest::driver::{Driver, v4l2_ctl};
use crate::guest::vivid;
use crate::support::{Bench, wait_until};

/// How long the CPU time of a service is measured without its camera.
const ABSENCE: Duration = Duration::from_secs(1);

#[test]
#[ignore = "runs in the virtual machine"]
fn a_camera_is_found_under_another_number() {
    let vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(10);
    vivid.unplug();
    capture.wait_until("its absence is noticed", |capture| capture.incidents(Incident::Unplugged) == 1);
    assert!(!capture.has_open_device());
    assert_idle(&capture);
    // This device takes the lowest free number.
    let _other = Driver::load("v4l2loopback", &["devices=1", "video_nr=0"]);
    vivid.plug_in();
    assert!(!v4l2_ctl(vivid::DEVICE, &["--info"]).contains("vivid"));
    capture.wait_until("its return is noticed", |capture| capture.incidents(Incident::Returned) == 1);
    capture.wait_for_images(10);
    let done = capture.stop();
    assert_eq!(done.sessions().len(), 2);
    assert_eq!(done.incidents(Incident::Unplugged), 1, "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_service_waits_for_a_missing_camera() {
    let vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    vivid.unplug();
    let mut capture = Capture::start(&bench);
    assert_idle(&capture);
    vivid.plug_in();
    capture.wait_for_images(10);
    capture.stop();
}

/// Asserts that the service looks for its camera only now and then, not in a busy loop.
fn assert_idle(capture: &Capture<'_>) {
    let is_idle = wait_until(|| {
        let (start, before_ns) = (Instant::now(), capture.cpu_ns());
        std::thread::sleep(ABSENCE);
        let (passed, busy) = (start.elapsed(), Duration::from_nanos(capture.cpu_ns() - before_ns));
        eprintln!("busy {busy:?} of {passed:?} without a camera");
        busy < passed / 4
    });
    assert!(is_idle, "the service is busy without a camera");
}
