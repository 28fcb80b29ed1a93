//! Numbers and time stamps that run over: twenty cameras, each of which wraps both once, a while after its start.

use fringeflow::message::{DropReason, Incident};

use super::super::capture::{Capture, gaps};
use super::super::driver::Driver;
use super::super::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

const CAMERAS: usize = 20;
/// Numbers end here and begin at 0; vivid starts 128 before.
const WRAP: u64 = 1 << 32;

#[test]
#[ignore = "runs in the virtual machine"]
fn numbers_go_on_and_times_begin_anew() {
    let _vivid = load();
    let benches: Vec<Bench> = (0..CAMERAS).map(|camera| Bench::of(&scanner(camera))).collect();
    let mut captures: Vec<Capture<'_>> = benches.iter().map(Capture::start).collect();
    for capture in &mut captures {
        capture.until("both are wrapped", |capture| {
            let is_wrapped = capture.headers.last().is_some_and(|last| last.sequence > WRAP);
            is_wrapped && capture.incidents(Incident::StampJump) >= 2
        });
    }
    for capture in captures {
        let (headers, counts) = capture.stop();
        assert!(headers[0].sequence < WRAP && headers[0].sequence >= WRAP - 128, "{}", headers[0].sequence);
        assert!(headers.is_sorted_by_key(|header| header.exposure_start_ns));
        assert_eq!(gaps(&headers), counts.dropped(DropReason::CameraLost), "{counts:?}");
        // Stamps are of another clock from the start, and once they run back.
        let incidents: Vec<_> = counts.incidents().collect();
        assert_eq!(incidents, [(Incident::StampJump, 2)]);
    }
}

/// Devices with an analogue input each, whose rate can be told.
fn load() -> Driver {
    let each = |value: &str| vec![value; CAMERAS].join(",");
    let parameters = [("node_types", "0x1"), ("num_inputs", "1"), ("input_types", "0")];
    let parameters = parameters.map(|(name, value)| format!("{name}={}", each(value)));
    let devices = format!("n_devs={CAMERAS}");
    Driver::load("vivid", &[&devices, &parameters[0], &parameters[1], &parameters[2]])
}

fn scanner(camera: usize) -> String {
    let device = |camera: usize| format!("device = \"bus:platform:vivid-{:03}\"", camera % CAMERAS);
    let controls = "timestamp_source = \"Start of Exposure\"\nwrap_sequence_number = true\nwrap_timestamp = \"64 Bit\"";
    configuration(
        &scenes::all()[0],
        &format!(
            "rate_hz = 10.0\n[cameras.cam1]\n{}\n[cameras.cam1.controls]\n{controls}\n[cameras.cam2]\n{}\n",
            device(camera),
            device(camera + 1)
        ),
        "",
    )
}
