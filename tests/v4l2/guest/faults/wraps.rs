//! Numbers and time stamps that run over, twenty times each.
//!
//! Time stamps of vivid wrap sixteen seconds after the start of a stream: ten cameras do so twice, side by side. In the
//! meantime the numbers of a fast camera wrap, 128 images after each start of its stream.

use fringeflow::message::{DropReason, Incident};

use super::super::capture::{Capture, gaps, sessions};
use super::super::driver::{Driver, Knob, press};
use super::super::scanner::configuration;
use crate::scenes;
use crate::support::{Bench, wait};

/// Cameras whose time stamps wrap, and how often each.
const SLOW: usize = 10;
const ROUNDS: u64 = 2;
/// How often the numbers wrap.
const TIMES: u64 = 20;
/// Numbers end here and begin at 0.
const WRAP: u64 = 1 << 32;

#[test]
#[ignore = "runs in the virtual machine"]
fn numbers_go_on_and_times_begin_anew() {
    let _vivid = load();
    let benches: Vec<Bench> = (0..SLOW).map(|camera| Bench::of(&slow(camera))).collect();
    let mut cameras: Vec<Capture<'_>> = benches.iter().map(Capture::start).collect();
    until_all(&mut cameras, "it sends images", |camera| !camera.headers.is_empty());
    let bench = Bench::of(&fast());
    let mut fast = Capture::start(&bench);
    for round in 1..=ROUNDS {
        wrap_numbers(&mut fast, TIMES / ROUNDS);
        // Stamps are of another clock from the start of a stream; then they run back. Where this machine held up the first
        // image, by whose arrival times are reckoned, the next one begins time anew once more.
        until_all(&mut cameras, "its time stamps wrap", |camera| camera.incidents(Incident::StampJump) >= 2 * round);
        if round < ROUNDS {
            (0..SLOW).for_each(|camera| press(&format!("/dev/video{camera}"), &[Knob::Fatal]));
        }
    }
    assert_numbers_went_on(fast);
    cameras.into_iter().for_each(assert_times_went_on);
}

/// Lets the numbers of a camera wrap so many times, each in a stream of its own.
fn wrap_numbers(camera: &mut Capture<'_>, times: u64) {
    for _ in 0..times {
        let restarts = camera.incidents(Incident::StreamRestart);
        camera.until("its numbers wrap", |camera| camera.headers.last().is_some_and(|last| last.sequence > WRAP));
        let session = camera.headers.last().unwrap().session;
        camera.during(|| press(&format!("/dev/video{SLOW}"), &[Knob::Fatal]));
        camera.until("its stream begins anew", |camera| {
            let is_new = camera.headers.last().is_some_and(|last| last.session > session);
            is_new && camera.incidents(Incident::StreamRestart) == restarts + 1
        });
    }
}

fn assert_numbers_went_on(camera: Capture<'_>) {
    let (headers, counts) = camera.stop();
    let streams = sessions(&headers);
    assert_eq!(streams.len() as u64, TIMES + 1);
    for stream in &streams[..TIMES as usize] {
        assert!(stream[0].sequence < WRAP && stream[stream.len() - 1].sequence > WRAP);
    }
    let lost: u64 = streams.into_iter().map(gaps).sum();
    assert_eq!(counts.dropped(DropReason::CameraLost), lost, "{counts:?}");
    let incidents = [Incident::StreamRestart, Incident::NumberingRestart, Incident::StampJump];
    assert_eq!(incidents.map(|incident| counts.incidents[incident as usize]), [TIMES, 0, 0], "{counts:?}");
}

fn assert_times_went_on(camera: Capture<'_>) {
    let (headers, counts) = camera.stop();
    assert!(headers.is_sorted_by(|a, b| a.exposure_start_ns < b.exposure_start_ns));
    let incidents = [Incident::StreamRestart, Incident::NumberingRestart];
    assert_eq!(incidents.map(|incident| counts.incidents[incident as usize]), [ROUNDS - 1, 0], "{counts:?}");
    assert!(counts.incidents[Incident::StampJump as usize] >= 2 * ROUNDS, "{counts:?}");
    assert_eq!(counts.all_dropped(), counts.dropped(DropReason::CameraLost), "{counts:?}");
}

/// Takes images of all cameras until something is so of each.
fn until_all(cameras: &mut [Capture<'_>], what: &str, is: impl Fn(&Capture<'_>) -> bool) {
    let reached = wait(|| {
        cameras.iter_mut().fold(true, |all, camera| {
            camera.take();
            all & is(camera)
        })
    });
    assert!(reached, "it never is of all cameras that {what}");
}

/// Slow devices with an analogue input each, whose rate can be told, and a fast one with a digital input.
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

/// A scanner with a device, which is set like this, as camera 1.
fn scanner(rate_hz: f64, device: usize, more: &str, controls: &str) -> String {
    let cameras = format!(
        "rate_hz = {rate_hz:.1}\n[cameras.cam1]\ndevice = \"bus:platform:vivid-{device:03}\"\n{more}\n\
         [cameras.cam1.controls]\ntimestamp_source = \"Start of Exposure\"\n{controls}\n\
         [cameras.cam2]\ndevice = \"bus:platform:vivid-{:03}\"\n",
        device + 1
    );
    configuration(&scenes::all()[0], &cameras, "")
}
