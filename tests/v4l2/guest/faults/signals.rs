//! Signals: a burst of them, and a service that is stopped for some time.

use std::time::Duration;

use rustix::process::Signal;

use fringeflow_message::DropReason;

use crate::guest::capture::{Capture, Captured};
use crate::guest::vivid;
use crate::support::{Bench, send};

#[test]
#[ignore = "runs in the virtual machine"]
fn losses_in_a_burst_of_signals_are_counted() {
    let done = capture_during(|capture| {
        for _ in 0..2000 {
            send(capture.pid(), Signal::USR1);
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    assert_counted(&done);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stopped_service_continues_and_counts_missed_images() {
    let done = capture_during(|capture| {
        for _ in 0..3 {
            send(capture.pid(), Signal::STOP);
            std::thread::sleep(Duration::from_millis(700));
            send(capture.pid(), Signal::CONT);
            capture.wait_for_images(20);
        }
    });
    // While the service is stopped, the driver's buffers fill up.
    assert!(done.counts.dropped(DropReason::CameraLost) > 0, "{:?}", done.counts);
    assert_counted(&done);
}

fn capture_during(disturbance: impl FnOnce(&mut Capture<'_>)) -> Captured {
    let _vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(10);
    disturbance(&mut capture);
    capture.wait_for_images(10);
    capture.stop()
}

fn assert_counted(done: &Captured) {
    eprintln!("{:?}", done.counts);
    assert_eq!(done.sessions().len(), 1, "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}
