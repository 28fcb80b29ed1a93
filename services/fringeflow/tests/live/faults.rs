//! Images and events that the virtual scanner loses, duplicates, swaps or delays.

use std::collections::HashMap;

use fringeflow_message::{CloudHeader, DropReason, FrameHeader, PatternEvent};
use fringeflow_recording::{Content, Recording, Topic};

use crate::support::Bench;

const STEPS: u32 = 4;
const PERIOD_NS: u64 = 40_000_000;

#[test]
fn every_fault_is_counted_and_no_window_mixes_steps() {
    let faults = "lost = 0.05\nduplicated = 0.05\nswapped = 0.1\nlate = 0.05\nevents_lost = 0.05";
    let bench = Bench::with_changes(&[("lost = 0.0", faults)]);
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"5", &"--record", &recording]);
    run.assert_undisturbed();
    bench.assert_nothing_left();
    for (stage, reason) in [
        ("camera1", DropReason::Injected),
        ("camera2", DropReason::Injected),
        ("projector", DropReason::Injected),
        ("pairing", DropReason::Duplicate),
        ("pairing", DropReason::Unpaired),
        ("pairing", DropReason::NoPattern),
        ("windowing", DropReason::Incomplete),
    ] {
        assert!(run.stage(stage).dropped(reason) > 0, "{stage} {reason:?}: {run:?}");
    }
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() > 0);
    // The replay forms the same windows, in spite of duplicates and images out of order.
    let replayed = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
    assert_eq!(compared["same"], verified["same"], "{replayed:?}");
    assert_windows_in_step(&Recording::open(&recording).unwrap());
}

#[test]
fn pairs_beyond_the_limit_of_the_skew_are_refused_live_and_in_a_replay() {
    // The virtual camera 2 exposes 40 µs after camera 1.
    let bench = Bench::with_changes(&[("rate_hz = 25.0", "rate_hz = 25.0\nmax_skew_us = 39.0")]);
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"2", &"--record", &recording]);
    run.assert_undisturbed();
    let pairing = run.stage("pairing");
    assert!(pairing.dropped(DropReason::Skewed) > 0 && pairing.passed == 0, "{run:?}");
    let told = "camera 2 exposes 0.040 ms after camera 1, more than cameras.max_skew_us allows (0.039 ms)";
    assert_eq!(run.log.matches(told).count(), 1, "{run:?}");
    let replayed = bench.replay(&[&"replay", &recording, &"--rate", &"max"]);
    replayed.assert_balanced();
    let pairing = replayed.stage("pairing");
    assert!(pairing.dropped(DropReason::Skewed) > 0 && pairing.passed == 0, "{replayed:?}");
}

#[test]
fn faults_without_gaps_in_the_numbering_are_detected_in_the_images() {
    let slow = "poses = 240\ntremor_mm = 0.0\ntremor_deg = 0.0";
    let faults = "hidden_lost = 0.02\nhidden_duplicated = 0.03\nhidden_swapped = 0.03";
    let bench = Bench::with_changes(&[("poses = 8", slow), ("lost = 0.0", faults)]);
    let run = bench.run(&[&"--seconds", &"6"]);
    run.assert_undisturbed();
    let reasons = [DropReason::HiddenLoss, DropReason::HiddenDuplicate, DropReason::HiddenSwap];
    let detected: Vec<DropReason> =
        reasons.into_iter().filter(|&reason| run.stage("phase").dropped(reason) > 0).collect();
    assert!(detected.len() >= 2, "{run:?}");
    assert!(run.log.contains("the images do not show the declared pattern steps: camera"), "{run:?}");
}

/// Asserts that the images of each cloud's window show the steps in order, according to the times of the recorded
/// pattern events. Asserts that some of these images arrived out of order.
fn assert_windows_in_step(recording: &Recording) {
    let images: HashMap<(u32, u64), FrameHeader> = [1, 2]
        .into_iter()
        .flat_map(|camera| recording.frame_headers(camera).map(move |h| ((camera, h.sequence), *h)))
        .collect();
    let events = events(recording);
    let out_of_order = [1, 2].map(|camera| out_of_order(recording, camera));
    let mut used_out_of_order = 0;
    for cloud in recording.cloud_headers() {
        assert_eq!(cloud.window.images, STEPS + 2);
        for (place, pair) in (0..).zip(cloud.window.pairs()) {
            let step = (cloud.window.first_step + place) % STEPS;
            assert_in_step(cloud, step, [1, 2].map(|camera| images.get(&(camera, pair[camera as usize - 1]))), &events);
            used_out_of_order += out_of_order.iter().zip(pair).filter(|(images, image)| images.contains(image)).count();
        }
    }
    assert!(used_out_of_order > 0, "of {out_of_order:?} in {} clouds", recording.count(Topic::Cloud));
}

/// Asserts that both images of a pair were exposed together, and that the pattern events announced this step.
fn assert_in_step(cloud: &CloudHeader, step: u32, pair: [Option<&FrameHeader>; 2], events: &[PatternEvent]) {
    // A busy recorder may have lost an image. Then it has counted the loss.
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

/// Returns the numbers of the images of a camera that arrived after a later image.
fn out_of_order(recording: &Recording, camera: u32) -> Vec<u64> {
    let images: Vec<&FrameHeader> = recording.frame_headers(camera).collect();
    let is_overtaken = |image: &&&FrameHeader| {
        images.iter().any(|other| other.sequence > image.sequence && other.received_ns < image.received_ns)
    };
    images.iter().filter(is_overtaken).map(|image| image.sequence).collect()
}
