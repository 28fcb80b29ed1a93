//! Signals: a storm of them, and a service that is stopped for a while.

use std::time::Duration;

use rustix::process::Signal;

use fringeflow_message::DropReason;

use crate::guest::capture::{Capture, Done};
use crate::guest::vivid;
use crate::support::{Bench, send};

#[test]
#[ignore = "runs in the virtual machine"]
fn a_storm_of_signals_loses_nothing_uncounted() {
    let done = during(|capture| {
        for _ in 0..2000 {
            send(capture.pid(), Signal::USR1);
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    assert_counted(&done);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stopped_service_goes_on_and_counts_what_it_missed() {
    let done = during(|capture| {
        for _ in 0..3 {
            send(capture.pid(), Signal::STOP);
            std::thread::sleep(Duration::from_millis(700));
            send(capture.pid(), Signal::CONT);
            capture.images(20);
        }
    });
    // The driver's buffers are full after some of the images of this time.
    assert!(done.counts.dropped(DropReason::CameraLost) > 0, "{:?}", done.counts);
    assert_counted(&done);
}

fn during(trouble: impl FnOnce(&mut Capture<'_>)) -> Done {
    let _vivid = vivid::load();
    let bench = Bench::of(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.images(10);
    trouble(&mut capture);
    capture.images(10);
    capture.stop()
}

fn assert_counted(done: &Done) {
    eprintln!("{:?}", done.counts);
    assert_eq!(done.sessions().len(), 1, "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}
