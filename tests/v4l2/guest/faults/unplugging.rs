//! A camera that is gone for a while, and comes back under another number.

use std::time::{Duration, Instant};

use fringeflow_message::Incident;

use crate::guest::capture::Capture;
use crate::guest::driver::{Driver, v4l2_ctl};
use crate::guest::vivid;
use crate::support::{Bench, wait};

/// How long a service is watched without its camera.
const ABSENCE: Duration = Duration::from_secs(1);

#[test]
#[ignore = "runs in the virtual machine"]
fn a_camera_is_found_under_another_number() {
    let vivid = vivid::load();
    let bench = Bench::of(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.images(10);
    vivid.unplug();
    capture.until("its absence is noticed", |capture| capture.incidents(Incident::Unplugged) == 1);
    assert!(!capture.holds_a_device());
    assert_idle(&capture);
    // It takes the lowest number that is free.
    let _other = Driver::load("v4l2loopback", &["devices=1", "video_nr=0"]);
    vivid.plug_in();
    assert!(!v4l2_ctl(vivid::DEVICE, &["--info"]).contains("vivid"));
    capture.until("its return is noticed", |capture| capture.incidents(Incident::Returned) == 1);
    capture.images(10);
    let done = capture.stop();
    assert_eq!(done.sessions().len(), 2);
    assert_eq!(done.incidents(Incident::Unplugged), 1, "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_camera_that_is_not_there_is_waited_for() {
    let vivid = vivid::load();
    let bench = Bench::of(&vivid::scanner(""));
    vivid.unplug();
    let mut capture = Capture::start(&bench);
    assert_idle(&capture);
    vivid.plug_in();
    capture.images(10);
    capture.stop();
}

/// Looking for a camera now and then is no work; trying all the time would be.
fn assert_idle(capture: &Capture<'_>) {
    let is_idle = wait(|| {
        let (start, before_ns) = (Instant::now(), capture.processor_ns());
        std::thread::sleep(ABSENCE);
        let (passed, busy) = (start.elapsed(), Duration::from_nanos(capture.processor_ns() - before_ns));
        eprintln!("busy {busy:?} of {passed:?} without a camera");
        busy < passed / 4
    });
    assert!(is_idle, "the service is busy without a camera");
}
