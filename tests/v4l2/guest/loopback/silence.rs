//! A camera that falls silent: whoever writes its images dies, and another one takes its place.

use fringeflow_message::Incident;

use crate::guest::capture::Capture;
use crate::scenes;
use crate::support::Bench;

use super::feeder::Feeder;

#[test]
#[ignore = "runs in the virtual machine"]
fn a_silent_camera_times_out_and_is_taken_up_again() {
    let scene = &scenes::all()[0];
    let _loopback = super::load();
    let mut feeder = Feeder::new();
    let bench = Bench::of(&super::scanner(scene, "GREY", "timeout_ms = 1500"));
    let mut capture = Capture::start(&bench);
    capture.images(1);
    for _ in 0..3 {
        capture.images_of(1, || feeder.show_next());
    }
    drop(feeder);
    let session = capture.witness.last().unwrap().session;
    capture.until("its silence is noticed", |capture| capture.incidents(Incident::StreamRestart) >= 1);
    let mut feeder = Feeder::new();
    // By its version, the driver drops what comes while nobody reads, or lets nobody read while nothing comes.
    capture.until("it sends again", |capture| {
        feeder.show_next();
        capture.witness.last().unwrap().session > session
    });
    let done = capture.stop();
    assert!(done.incidents(Incident::TimeOut) >= 1, "{:?}", done.counts);
}
