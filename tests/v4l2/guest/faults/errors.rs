//! Errors that vivid injects at the press of a button, twenty times each: every one is counted, the images come again, and
//! nothing is lost that is not counted.

use fringeflow_message::{Counts, DropReason, Incident};

use crate::guest::capture::{Capture, Done};
use crate::guest::driver::{Knob, press};
use crate::guest::vivid;
use crate::support::Bench;

/// How often each error is injected.
const TIMES: u64 = 20;
/// Refused calls in a row after which a stream is begun anew.
const REFUSALS: u64 = 3;

#[test]
#[ignore = "runs in the virtual machine"]
fn damaged_images_are_dropped() {
    let done = inject(&[Knob::Damaged], |counts| counts.dropped(DropReason::BadImage));
    assert_eq!(done.counts.dropped(DropReason::BadImage), TIMES);
    assert_eq!(done.sessions().len(), 1);
    done.assert_losses_are_gaps(TIMES);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn buffers_that_are_refused_are_offered_again() {
    let done = inject(&[Knob::Qbuf], |counts| incidents(counts, Incident::CallRefused));
    assert_eq!(done.incidents(Incident::CallRefused), TIMES);
    assert_eq!(done.sessions().len(), 1);
    done.assert_losses_are_gaps(0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_fatal_error_of_the_stream_begins_it_anew() {
    assert_begun_anew(&[Knob::Fatal], REFUSALS);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stream_that_gets_no_buffers_is_begun_anew() {
    assert_begun_anew(&[Knob::Reqbufs, Knob::Fatal], REFUSALS + 1);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_stream_that_does_not_start_is_begun_anew() {
    assert_begun_anew(&[Knob::Streamon, Knob::Fatal], REFUSALS + 1);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn an_unplugged_camera_is_taken_up_again() {
    let done = inject(&[Knob::Disconnect], |counts| incidents(counts, Incident::Returned));
    assert_eq!([Incident::Unplugged, Incident::Returned].map(|i| done.incidents(i)), [TIMES; 2], "{:?}", done.counts);
    done.assert_losses_are_gaps(0);
}

/// Errors that end in a new stream, after so many refused calls each.
fn assert_begun_anew(buttons: &[Knob], refused: u64) {
    let done = inject(buttons, |counts| incidents(counts, Incident::StreamRestart));
    assert_eq!(done.incidents(Incident::StreamRestart), TIMES, "{:?}", done.counts);
    assert_eq!(done.incidents(Incident::CallRefused), TIMES * refused, "{:?}", done.counts);
    assert_eq!(done.sessions().len() as u64, TIMES + 1);
    done.assert_losses_are_gaps(0);
}

/// Presses buttons again and again; each time images must come after `reached` has counted it.
fn inject(buttons: &[Knob], reached: fn(&Counts) -> u64) -> Done {
    let _vivid = vivid::load();
    let bench = Bench::of(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.images(1);
    for time in 1..=TIMES {
        press(vivid::DEVICE, buttons);
        capture.until("the error was counted", |capture| reached(&capture.counts()) == time);
        capture.images(1);
    }
    capture.stop()
}

fn incidents(counts: &Counts, incident: Incident) -> u64 {
    counts.incidents[incident as usize]
}
