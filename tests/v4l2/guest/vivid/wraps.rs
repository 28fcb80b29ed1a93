//! Numbers and time stamps that run over, twenty times each.
//!
//! Time stamps of vivid wrap sixteen seconds after the start of a stream: ten cameras do so twice, side by side. In the
//! meantime the numbers of a fast camera wrap, 128 images after each start of its stream.

use fringeflow::message::{Counts, DropReason, Incident};

use super::super::capture::{Capture, gaps, sessions};
use super::super::driver::{Driver, press};
use super::super::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

/// Cameras whose time stamps wrap, and how often each.
const SLOW: usize = 10;
const ROUNDS: u64 = 2;
/// How often the numbers wrap.
const TIMES: u64 = 20;
/// Numbers end here and begin at 0.
const WRAP: u64 = 1 << 32;
/// A fatal error begins a stream anew.
const FATAL: &str = "inject_fatal_streaming_error";

#[test]
#[ignore = "runs in the virtual machine"]
fn numbers_go_on_and_times_begin_anew() {
    let _vivid = load();
    let benches: Vec<Bench> = (0..SLOW).map(|camera| Bench::of(&slow(camera))).collect();
    let mut captures: Vec<Capture<'_>> = benches.iter().map(Capture::start).collect();
    wrap_numbers();
    for round in 1..=ROUNDS {
        for (camera, capture) in captures.iter_mut().enumerate() {
            // Stamps are of another clock from the start of a stream; then they run back.
            capture.until("its time stamps wrap", |capture| capture.incidents(Incident::StampJump) == 2 * round);
            capture.images(2);
            if round < ROUNDS {
                press(&format!("/dev/video{camera}"), &[FATAL]);
            }
        }
    }
    for capture in captures {
        let (headers, counts) = capture.stop();
        assert_eq!(counts.incidents[Incident::StreamRestart as usize], ROUNDS - 1, "{counts:?}");
        assert!(headers.is_sorted_by(|a, b| a.exposure_start_ns < b.exposure_start_ns));
        // Times before and after a leap say nothing of each other.
        assert_eq!(sessions(&headers).len() as u64, 2 * ROUNDS);
        assert_eq!(dropped_but_lost(&counts), 0, "{counts:?}");
    }
}

fn wrap_numbers() {
    let bench = Bench::of(&fast());
    let mut capture = Capture::start(&bench);
    for time in 1..=TIMES {
        capture.until("its numbers wrap", |capture| {
            capture.incidents(Incident::StreamRestart) == time - 1
                && capture.headers.last().is_some_and(|last| last.sequence > WRAP)
        });
        if time < TIMES {
            press(&format!("/dev/video{SLOW}"), &[FATAL]);
            capture.until("its stream begins anew", |capture| capture.incidents(Incident::StreamRestart) == time);
            capture.until("its numbers begin anew", |capture| {
                capture.headers.last().is_some_and(|last| last.sequence < WRAP)
            });
        }
    }
    let (headers, counts) = capture.stop();
    let streams = sessions(&headers);
    assert_eq!(streams.len() as u64, TIMES);
    for stream in &streams {
        assert!(stream.first().is_some_and(|first| first.sequence < WRAP));
        assert!(stream.last().is_some_and(|last| last.sequence > WRAP));
    }
    let lost: u64 = streams.into_iter().map(gaps).sum();
    assert_eq!(counts.dropped(DropReason::CameraLost), lost, "{counts:?}");
    assert_eq!(counts.incidents[Incident::NumberingRestart as usize], 0, "{counts:?}");
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

fn dropped_but_lost(counts: &Counts) -> u64 {
    counts.all_dropped() - counts.dropped(DropReason::CameraLost)
}
