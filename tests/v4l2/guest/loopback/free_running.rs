//! Two cameras that run free at slightly different rates, so that they drift through each other.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use fringeflow_message::{DropReason, FrameHeader, Stage, Window};
use fringeflow_recording::{Content, Recording, Topic};

use crate::guest::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

use super::{DEVICES, Shown, Ticking, camera_table};

/// Images per second of camera 1. Camera 2 is slower by one per cent: they meet every 100 images.
const RATE_HZ: f64 = 10.0;
const PERIODS: [Duration; 2] = [Duration::from_micros(100_000), Duration::from_micros(101_000)];
/// The default limit of the skew: a twentieth of the period.
const MAX_SKEW_NS: u64 = 5_000_000;
/// Pairs of each kind that are waited for.
const ENOUGH_PAIRS: u64 = 20;

#[test]
#[ignore = "runs in the virtual machine"]
fn no_pair_beyond_the_limit_passes_and_it_is_told_once() {
    let _loopback = super::load();
    let writers = [1, 2].map(|camera| {
        let (_, size_px) = scenes::all()[0].image(camera, 0);
        let images = (0..scenes::STEPS).map(|step| scenes::all()[0].image(camera, step).0).collect();
        let index = camera as usize - 1;
        Shown::new(DEVICES[index], size_px, *b"GREY", images).tick(Instant::now(), PERIODS[index])
    });
    let bench = Bench::from_configuration(&scanner());
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_until("pairs have passed and were refused", || {
        let counts = bench.counts(Stage::Pairing);
        [counts.passed, counts.dropped(DropReason::Skewed)].into_iter().all(|images| images / 2 >= ENOUGH_PAIRS)
    });
    let ended = live.quit();
    let written = writers.map(Ticking::stop);
    ended.assert_balanced();
    let pairing = ended.stage("pairing");
    eprintln!("{written:?} images written; {pairing:?}");
    assert_eq!(ended.log.matches("more than cameras.max_skew_us allows").count(), 1, "{}", ended.log);
    assert_eq!(ended.log.matches("image pairs were dropped because the cameras").count(), 1, "{}", ended.log);
    let recorded = Recording::open(&recording).unwrap();
    let images = [1, 2].map(|camera| headers(&recorded, camera));
    assert_windows(&recorded, &images);
    // On a busy machine the recorder may miss messages; then it counts them.
    if ended.stage("recorder").dropped(DropReason::Overrun) == 0 {
        let within = images[0].values().filter(|first| is_met(first, &images[1])).count() as u64;
        // The last image of a camera may wait for its partner when the run ends.
        assert!(pairing.passed / 2 <= within && within <= pairing.passed / 2 + 1, "{within}: {pairing:?}");
    }
}

fn scanner() -> String {
    let [cam1, cam2] =
        [("cam1", DEVICES[0]), ("cam2", DEVICES[1])].map(|(name, device)| camera_table(name, device, ""));
    let cameras = format!("rate_hz = {RATE_HZ:.1}\n{cam1}{cam2}");
    configuration(&scenes::all()[0], &cameras, "phase_maps = true\n[window]\nevery = 1\n")
}

type Images = BTreeMap<(u64, u64), FrameHeader>;

/// Headers of the recorded images of a camera, by session and number.
fn headers(recorded: &Recording, camera: u32) -> Images {
    recorded.frame_headers(camera).map(|header| ((header.session, header.sequence), *header)).collect()
}

/// Whether an image of camera 2 starts within the limit.
fn is_met(first: &FrameHeader, others: &Images) -> bool {
    others.values().any(|other| other.exposure_start_ns.abs_diff(first.exposure_start_ns) <= MAX_SKEW_NS)
}

/// Asserts that there are windows, and that all their pairs are within the limit.
fn assert_windows(recorded: &Recording, images: &[Images; 2]) {
    let maps = recorded.messages_of(Topic::PhaseMaps).filter_map(|message| match message.unwrap().content {
        Content::Maps(header, _) => Some(header.window),
        _ => None,
    });
    let windows: Vec<Window> = maps.collect();
    assert!(!windows.is_empty());
    for window in &windows {
        for [cam1, cam2] in window.pairs() {
            let [first, second] = [&images[0][&(window.cam1_session, cam1)], &images[1][&(window.cam2_session, cam2)]];
            let skew_ns = first.exposure_start_ns.abs_diff(second.exposure_start_ns);
            assert!(skew_ns <= MAX_SKEW_NS, "{skew_ns}: {window:?}");
        }
    }
}
