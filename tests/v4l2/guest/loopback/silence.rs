//! A camera stops sending: the writer of its images ends, and another one takes its place.

use fringeflow_message::Incident;

use crate::guest::capture::Capture;
use crate::scenes;
use crate::support::Bench;

use super::feeder::Feeder;

#[test]
#[ignore = "runs in the virtual machine"]
fn a_silent_camera_times_out_and_is_used_again() {
    let scene = &scenes::all()[0];
    let _loopback = super::load();
    let mut feeder = Feeder::new();
    let bench = Bench::from_configuration(&super::scanner(scene, "GREY", "timeout_ms = 1500"));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    for _ in 0..3 {
        capture.act_and_wait_for_images(1, || feeder.show_next());
    }
    drop(feeder);
    let session = capture.witness.last().unwrap().session;
    capture.wait_until("its silence is noticed", |capture| capture.incidents(Incident::StreamRestart) >= 1);
    let mut feeder = Feeder::new();
    // Depending on its version, the driver drops images without a reader, or refuses readers without images. So keep
    // writing until the service reads again.
    capture.wait_until("it sends again", |capture| {
        feeder.show_next();
        capture.witness.last().unwrap().session > session
    });
    let done = capture.stop();
    assert!(done.incidents(Incident::TimeOut) >= 1, "{:?}", done.counts);
}
