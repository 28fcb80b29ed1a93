//! Images and events that are lost, doubled, swapped or late on purpose.

use std::collections::HashMap;

use fringeflow_message::{CloudHeader, DropReason, FrameHeader, PatternEvent};
use fringeflow_recording::{Content, Recording, Topic};

use crate::support::Bench;

const STEPS: u32 = 4;
const PERIOD_NS: u64 = 40_000_000;

#[test]
fn every_fault_is_counted_and_no_window_mixes_steps() {
    let faults = "lost = 0.05\nduplicated = 0.05\nswapped = 0.1\nlate = 0.05\nevents_lost = 0.05";
    let bench = Bench::with(&[("lost = 0.0", faults)]);
    let recording = bench.path("scan.mcap");
    let ended = bench.run(&[&"--seconds", &"5", &"--record", &recording]);
    ended.assert_undisturbed();
    assert_eq!(ended.code, Some(3));
    bench.assert_nothing_left();
    for (stage, reason) in [
        ("camera1", DropReason::CameraLost),
        ("camera2", DropReason::CameraLost),
        ("projector", DropReason::Injected),
        ("pairing", DropReason::Duplicate),
        ("pairing", DropReason::Unpaired),
        ("pairing", DropReason::NoPattern),
        ("windowing", DropReason::Incomplete),
    ] {
        assert!(ended.stage(stage).dropped(reason) > 0, "{stage} {reason:?}: {ended:?}");
    }
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() > 0);
    // Played again, the same images are put together, whatever came double or out of turn.
    let replayed = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
    assert_eq!(compared["same"], verified["same"], "{replayed:?}");
    assert_windows_are_in_step(&Recording::open(&recording).unwrap());
}

#[test]
fn faults_without_a_trace_are_told_by_the_images() {
    let slow = "poses = 240\ntremor_mm = 0.0\ntremor_deg = 0.0";
    let faults = "hidden_lost = 0.02\nhidden_duplicated = 0.03\nhidden_swapped = 0.03";
    let bench = Bench::with(&[("poses = 8", slow), ("lost = 0.0", faults)]);
    let ended = bench.run(&[&"--seconds", &"6"]);
    ended.assert_undisturbed();
    let reasons = [DropReason::HiddenLoss, DropReason::HiddenDuplicate, DropReason::HiddenSwap];
    let told: Vec<DropReason> =
        reasons.into_iter().filter(|&reason| ended.stage("phase").dropped(reason) > 0).collect();
    assert!(told.len() >= 2, "{ended:?}");
    assert!(ended.log.contains("the images do not show the declared pattern steps: camera"), "{ended:?}");
}

/// Asserts that the images of each cloud's window show the steps in order, by the times of the recorded pattern events,
/// and that images that came out of turn were used.
fn assert_windows_are_in_step(recording: &Recording) {
    let images: HashMap<(u32, u64), FrameHeader> = [1, 2]
        .into_iter()
        .flat_map(|camera| recording.frame_headers(camera).map(move |h| ((camera, h.sequence), *h)))
        .collect();
    let events = events(recording);
    let out_of_turn = [1, 2].map(|camera| out_of_turn(recording, camera));
    let mut used_out_of_turn = 0;
    for cloud in recording.cloud_headers() {
        assert_eq!(cloud.window.images, STEPS + 2);
        for (place, pair) in (0..).zip(cloud.window.pairs()) {
            let step = (cloud.window.first_step + place) % STEPS;
            assert_in_step(cloud, step, [1, 2].map(|camera| images.get(&(camera, pair[camera as usize - 1]))), &events);
            used_out_of_turn += out_of_turn.iter().zip(pair).filter(|(images, image)| images.contains(image)).count();
        }
    }
    assert!(used_out_of_turn > 0, "of {out_of_turn:?} in {} clouds", recording.count(Topic::Cloud));
}

/// Asserts that both images of a pair were exposed together, and were announced as this step.
fn assert_in_step(cloud: &CloudHeader, step: u32, pair: [Option<&FrameHeader>; 2], events: &[PatternEvent]) {
    // A busy recorder may have lost an image, and has said so.
    let [Some(first), Some(second)] = pair else { return };
    let near = |time_ns: u64| time_ns.abs_diff(first.exposure_start_ns) < PERIOD_NS / 2;
    assert!(near(second.exposure_start_ns), "{cloud:?}");
    let steps: Vec<u32> = events.iter().filter(|e| near(e.exposure_start_ns)).map(|event| event.step).collect();
    assert_eq!(steps, [step], "{cloud:?}");
}

fn events(recording: &Recording) -> Vec<PatternEvent> {
    let event = |content| match content {
        Content::Pattern(event) => Some(event),
        _ => None,
    };
    recording.messages_of(Topic::Pattern).filter_map(|message| event(message.unwrap().content)).collect()
}

/// Numbers of the images of a camera that came after a later one.
fn out_of_turn(recording: &Recording, camera: u32) -> Vec<u64> {
    let came: Vec<&FrameHeader> = recording.frame_headers(camera).collect();
    let overtaken = |image: &&&FrameHeader| {
        came.iter().any(|other| other.sequence > image.sequence && other.received_ns < image.received_ns)
    };
    came.iter().filter(overtaken).map(|image| image.sequence).collect()
}
