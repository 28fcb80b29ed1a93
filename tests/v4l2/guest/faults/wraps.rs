//! Sequence numbers and time stamps that wrap around, twenty times each.
//!
//! Time stamps of vivid wrap sixteen seconds after the start of a stream: ten cameras do so twice, side by side.
//! Meanwhile the sequence numbers of a fast camera wrap, 128 images after each start of its stream.

use std::time::{Duration, Instant};

use fringeflow_message::{DropReason, Incident};

use crate::guest::capture::Capture;
use crate::guest::driver::{Driver, FaultControl, press};
use crate::guest::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

/// Cameras whose time stamps wrap, and how often each.
const SLOW: usize = 10;
const ROUNDS: u64 = 2;
/// Time after which they have certainly wrapped.
const WRAPPED: Duration = Duration::from_secs(18);
/// How often the sequence numbers wrap.
const TIMES: u64 = 20;
/// Sequence numbers wrap to 0 here.
const WRAP: u64 = 1 << 32;

#[test]
#[ignore = "runs in the virtual machine"]
fn numbers_and_times_continue_after_they_wrap() {
    let _vivid = load();
    let benches: Vec<Bench> = (0..SLOW).map(|camera| Bench::from_configuration(&slow(camera))).collect();
    let mut cameras: Vec<Capture<'_>> = benches.iter().map(Capture::start).collect();
    cameras.iter_mut().for_each(|camera| camera.wait_for_images(1));
    let bench = Bench::from_configuration(&fast());
    let mut fast = Capture::start(&bench);
    for round in 1..=ROUNDS {
        let start = Instant::now();
        wrap_numbers(&mut fast, TIMES / ROUNDS);
        for camera in &mut cameras {
            // Two jumps per stream: at its start, because stamps are of another clock, and when they wrap.
            camera.wait_until("its time stamps wrap", |camera| {
                start.elapsed() > WRAPPED && camera.incidents(Incident::StampJump) >= 2 * round
            });
        }
        if round < ROUNDS {
            (0..SLOW).for_each(|camera| press(&format!("/dev/video{camera}"), &[FaultControl::Fatal]));
        }
    }
    assert_numbers_continued(fast);
    cameras.into_iter().for_each(assert_times_continued);
}

/// Lets the sequence numbers of a camera wrap this number of times, in a new stream each time.
fn wrap_numbers(camera: &mut Capture<'_>, times: u64) {
    for _ in 0..times {
        let restarts = camera.incidents(Incident::StreamRestart);
        camera.wait_until("its numbers wrap", |camera| camera.witness.last().is_some_and(|last| last.sequence > WRAP));
        let session = camera.witness.last().unwrap().session;
        press(&format!("/dev/video{SLOW}"), &[FaultControl::Fatal]);
        camera.wait_until("its stream is restarted", |camera| {
            let is_new = camera.witness.last().is_some_and(|last| last.session > session);
            is_new && camera.incidents(Incident::StreamRestart) == restarts + 1
        });
    }
}

fn assert_numbers_continued(camera: Capture<'_>) {
    let done = camera.stop();
    let streams = done.sessions();
    assert_eq!(streams.len() as u64, TIMES + 1);
    for stream in &streams[..TIMES as usize] {
        assert!(stream[0].sequence < WRAP && stream[stream.len() - 1].sequence > WRAP);
    }
    assert_eq!([Incident::StreamRestart, Incident::NumberingRestart].map(|i| done.incidents(i)), [TIMES, 0]);
    done.assert_losses_are_gaps(0);
}

fn assert_times_continued(camera: Capture<'_>) {
    let done = camera.stop();
    assert!(done.headers.is_sorted_by(|a, b| a.exposure_start_ns < b.exposure_start_ns));
    assert_eq!([Incident::StreamRestart, Incident::NumberingRestart].map(|i| done.incidents(i)), [ROUNDS - 1, 0]);
    // If the machine pauses, stamps jump too.
    assert!(done.incidents(Incident::StampJump) >= 2 * ROUNDS, "{:?}", done.counts);
    assert_eq!(done.counts.all_dropped(), done.counts.dropped(DropReason::CameraLost), "{:?}", done.counts);
}

/// Loads slow devices with an analogue input, whose rate can be set, and fast ones with a digital input.
fn load() -> Driver {
    let each = |name: &str, slow: &str, fast: &str| {
        let values: Vec<&str> = std::iter::repeat_n(slow, SLOW).chain([fast; 2]).collect();
        format!("{name}={}", values.join(","))
    };
    let parameters = [each("node_types", "0x1", "0x1"), each("num_inputs", "1", "1"), each("input_types", "0", "3")];
    let devices = format!("n_devs={}", SLOW + 2);
    Driver::load("vivid", &[&devices, &parameters[0], &parameters[1], &parameters[2]])
}

fn slow(camera: usize) -> String {
    scanner(2.0, camera, "", "wrap_timestamp = \"64 Bit\"")
}

fn fast() -> String {
    scanner(120.0, SLOW, "video_timings = \"800x600@120\"", "wrap_sequence_number = true")
}

/// A scanner with this device as camera 1. `settings` are appended to its table.
fn scanner(rate_hz: f64, device: usize, settings: &str, controls: &str) -> String {
    let cameras = format!(
        "rate_hz = {rate_hz:.1}\n[cameras.cam1]\ndevice = \"bus:platform:vivid-{device:03}\"\n{settings}\n\
         [cameras.cam1.controls]\ntimestamp_source = \"Start of Exposure\"\n{controls}\n\
         [cameras.cam2]\ndevice = \"bus:platform:vivid-{:03}\"\n",
        device + 1
    );
    configuration(&scenes::all()[0], &cameras, "")
}
