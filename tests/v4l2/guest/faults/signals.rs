//! Signals: a storm of them, and a service that is stopped for a while.

use std::time::Duration;

use fringeflow::message::{Counts, DropReason, FrameHeader};
use rustix::process::Signal;

use super::super::capture::{Capture, gaps, sessions};
use super::super::vivid;
use crate::support::{Bench, send};

#[test]
#[ignore = "runs in the virtual machine"]
fn a_storm_of_signals_loses_nothing_uncounted() {
    let (headers, counts) = during(|capture| {
        let pid = capture.pid();
        capture.during(|| {
            for _ in 0..2000 {
                send(pid, Signal::USR1);
                std::thread::sleep(Duration::from_millis(1));
            }
        });
    });
    assert_counted(&headers, &counts);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stopped_service_goes_on_and_counts_what_it_missed() {
    let (headers, counts) = during(|capture| {
        for _ in 0..3 {
            send(capture.pid(), Signal::STOP);
            std::thread::sleep(Duration::from_millis(700));
            send(capture.pid(), Signal::CONT);
            capture.images(20);
        }
    });
    // The driver's buffers are full after some of the images of this time.
    assert!(counts.dropped(DropReason::CameraLost) > 0, "{counts:?}");
    assert_counted(&headers, &counts);
}

fn during(trouble: impl FnOnce(&mut Capture<'_>)) -> (Vec<FrameHeader>, Counts) {
    let _vivid = vivid::load();
    let bench = Bench::of(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.images(10);
    trouble(&mut capture);
    capture.images(10);
    capture.stop()
}

fn assert_counted(headers: &[FrameHeader], counts: &Counts) {
    eprintln!("{counts:?}");
    assert_eq!(sessions(headers).len(), 1, "{counts:?}");
    assert_eq!(counts.dropped(DropReason::CameraLost), gaps(headers), "{counts:?}");
}
