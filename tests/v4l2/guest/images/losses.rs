//! Images that the driver drops: exactly these are counted, and no window has a gap.

use fringeflow_message::{DropReason, FrameHeader, Stage, Window};
use fringeflow_recording::{Content, Recording, Topic};

use crate::guest::capture::{Capture, gaps};
use crate::guest::driver::{FaultControl, set_control};
use crate::guest::vivid;
use crate::support::Bench;

/// Percentages of images to drop, and the least number of drops for each.
const PERCENTAGES: [(i64, u64); 3] = [(1, 1), (10, 5), (50, 60)];
/// Images to receive for each.
const IMAGES: usize = 120;
/// Windows that must be complete despite the losses.
const WINDOWS: u64 = 5;

#[test]
#[ignore = "runs in the virtual machine"]
fn dropped_images_are_counted_one_by_one() {
    let _vivid = vivid::load();
    let bench = Bench::from_configuration(&vivid::scanner(""));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    for (percentage, least) in PERCENTAGES {
        let before = capture.counts();
        set_control(vivid::DEVICE, FaultControl::DroppedPercentage, percentage);
        capture.wait_for_images(IMAGES);
        let enough = before.dropped(DropReason::CameraLost) + least;
        capture
            .wait_until("enough images are lost", |capture| capture.counts().dropped(DropReason::CameraLost) >= enough);
        let now = capture.counts();
        let lost = now.dropped(DropReason::CameraLost) - before.dropped(DropReason::CameraLost);
        eprintln!("{percentage} %: {lost} of {} images lost", now.taken - before.taken);
    }
    let done = capture.stop();
    assert_eq!(done.sessions().len(), 1);
    done.assert_losses_are_gaps(0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_dropped_image_drops_its_windows() {
    let _vivid = vivid::load();
    let percentage = "percentage_of_dropped_buffers = 10";
    let scanner = vivid::scanner_at("1280x720@25", percentage);
    let bench = Bench::from_configuration(&format!("{scanner}phase_maps = true\n"));
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_until("there are windows", || bench.counts(Stage::Phase).passed >= WINDOWS);
    let ended = live.quit();
    ended.assert_balanced();
    assert_eq!(ended.summary["restarts"], 0, "{ended:?}");
    let recorded = Recording::open(&recording).unwrap();
    let headers: Vec<FrameHeader> = recorded.frame_headers(1).copied().collect();
    let [lost, passed] = [ended.stage("camera1").dropped(DropReason::CameraLost), ended.stage("camera1").passed];
    let is_whole = headers[0].published == 0 && headers[headers.len() - 1].published + 1 == passed;
    assert!(if is_whole { lost == gaps(&headers) } else { lost >= gaps(&headers) }, "{} {ended:?}", gaps(&headers));
    let windows: Vec<Window> = recorded
        .messages_of(Topic::PhaseMaps)
        .filter_map(|message| match message.unwrap().content {
            Content::Maps(header, _) => Some(header.window),
            _ => None,
        })
        .collect();
    // On a busy machine the recorder may miss messages; then it counts them.
    let unseen = ended.stage("phase").passed - windows.len() as u64;
    assert!(
        unseen <= ended.stage("recorder").dropped(DropReason::Overrun) && !windows.is_empty(),
        "{unseen}: {ended:?}"
    );
    for window in &windows {
        let mut pairs: Vec<[u64; 2]> = window.pairs().collect();
        // The pairs are in the order of the steps, and a window may start with any step.
        pairs.sort_unstable();
        assert!(pairs.is_sorted_by(|a, b| b[0] == a[0] + 1 && b[1] == a[1] + 1), "{window:?}");
    }
}
