//! A capture service is killed: the driver frees its buffers, and the next service streams from the same device.

use fringeflow_message::Stage;

use crate::guest::capture::Capture;
use crate::guest::vivid;
use crate::support::Bench;

#[test]
#[ignore = "runs in the virtual machine"]
fn the_successor_of_a_killed_service_streams_and_continues_its_counts() {
    let _vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    for _ in 0..2 {
        let mut killed = Capture::start(&bench);
        killed.wait_for_images(10);
        // Kills the service, which cannot close anything.
        drop(killed);
    }
    let before = bench.counts(Stage::Camera1);
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(10);
    let done = capture.stop();
    assert_eq!(done.sessions().len(), 1, "{:?}", done.counts);
    assert!(done.headers[0].published >= before.passed && before.passed >= 20, "{before:?}, {:?}", done.counts);
    done.assert_losses_are_gaps(0);
}
