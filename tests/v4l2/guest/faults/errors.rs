//! Errors that vivid injects at the press of a button, twenty times each. Each error is counted, images arrive again,
//! and every lost image is counted.

use fringeflow_message::{Counts, DropReason, Incident};

use crate::guest::capture::{Capture, Captured};
use crate::guest::driver::{FaultControl, press};
use crate::guest::vivid;
use crate::support::Bench;

/// How often each error is injected.
const TIMES: u64 = 20;
/// Consecutive refused calls after which a stream is restarted.
const REFUSALS: u64 = 3;

#[test]
#[ignore = "runs in the virtual machine"]
fn damaged_images_are_dropped() {
    let done = inject(&[FaultControl::Damaged], |counts| counts.dropped(DropReason::BadImage));
    assert_eq!(done.counts.dropped(DropReason::BadImage), TIMES);
    assert_eq!(done.sessions().len(), 1);
    done.assert_losses_are_gaps(TIMES);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn refused_buffers_are_queued_again() {
    let done = inject(&[FaultControl::Qbuf], |counts| incidents(counts, Incident::CallRefused));
    assert_eq!(done.incidents(Incident::CallRefused), TIMES);
    assert_eq!(done.sessions().len(), 1);
    done.assert_losses_are_gaps(0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_fatal_error_restarts_the_stream() {
    assert_stream_restarts(&[FaultControl::Fatal], REFUSALS);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stream_without_buffers_is_restarted() {
    assert_stream_restarts(&[FaultControl::Reqbufs, FaultControl::Fatal], REFUSALS + 1);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stream_that_does_not_start_is_restarted() {
    assert_stream_restarts(&[FaultControl::Streamon, FaultControl::Fatal], REFUSALS + 1);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn an_unplugged_camera_is_used_again() {
    let done = inject(&[FaultControl::Disconnect], |counts| incidents(counts, Incident::Returned));
    assert_eq!([Incident::Unplugged, Incident::Returned].map(|i| done.incidents(i)), [TIMES; 2], "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}

/// Asserts that each error restarts the stream, after this number of refused calls.
fn assert_stream_restarts(buttons: &[FaultControl], refused: u64) {
    let done = inject(buttons, |counts| incidents(counts, Incident::StreamRestart));
    assert_eq!(done.incidents(Incident::StreamRestart), TIMES, "{:?}", done.counts);
    assert_eq!(done.incidents(Incident::CallRefused), TIMES * refused, "{:?}", done.counts);
    assert_eq!(done.sessions().len() as u64, TIMES + 1);
    done.assert_losses_are_gaps(0);
}

/// Presses buttons repeatedly. Each time `count` must increase by one, and images must arrive afterwards.
fn inject(buttons: &[FaultControl], count: fn(&Counts) -> u64) -> Captured {
    let _vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    for time in 1..=TIMES {
        press(vivid::DEVICE, buttons);
        capture.wait_until("the error is counted", |capture| count(&capture.counts()) == time);
        capture.wait_for_images(1);
    }
    capture.stop()
}

fn incidents(counts: &Counts, incident: Incident) -> u64 {
    counts.incidents[incident as usize]
}
