//! Images that the driver drops: each is counted, and none besides.

use fringeflow::message::DropReason;

use super::super::capture::{Capture, gaps};
use crate::support::Bench;

/// Images that must have come.
const IMAGES: usize = 200;

#[test]
#[ignore = "runs in the virtual machine"]
fn one_image_in_a_hundred_is_dropped() {
    check(1, 1);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn one_image_in_ten_is_dropped() {
    check(10, 5);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn every_second_image_is_dropped() {
    check(50, 100);
}

/// The driver drops this percentage, at least so many while enough images come.
fn check(percentage: u64, least: u64) {
    let _vivid = super::load();
    let bench = Bench::of(&super::scanner(&format!("percentage_of_dropped_buffers = {percentage}")));
    let mut capture = Capture::start(&bench);
    capture.images(IMAGES);
    capture.until("enough is lost", |capture| capture.counts().dropped(DropReason::CameraLost) >= least);
    let (headers, counts) = capture.stop();
    eprintln!("{percentage} %: {} of {} images lost", counts.dropped(DropReason::CameraLost), counts.taken);
    assert_eq!(counts.dropped(DropReason::CameraLost), gaps(&headers), "{counts:?}");
    assert_eq!(counts.incidents().count(), 0, "{counts:?}");
}
