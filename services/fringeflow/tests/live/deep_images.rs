//! Cameras with more than 8 bits, and binned regions: live, recorded, replayed and offline.

use std::fs;
use std::path::Path;
use std::process::Output;

use fringeflow_message::{DropReason, FrameHeader, PixelFormat};
use fringeflow_recording::{Content, DEFAULT_QUEUE_BYTES, Opening, Recordable, Recorder, Recording};

use crate::support::Bench;

#[test]
fn clouds_of_12_bit_images_replay_byte_for_byte() {
    assert_replays_identically("format = \"Y12\"", "Y12");
}

#[test]
fn clouds_of_a_binned_region_replay_byte_for_byte() {
    assert_replays_identically("format = \"Y10\"\nregion_px = [33, 25, 256, 208]\nbinning = 2", "Y12");
}

/// Asserts that cameras with these settings are recorded in `format`, and that replays of the recording reproduce its
/// clouds.
fn assert_replays_identically(cameras: &str, format: &str) {
    let bench = Bench::with_changes(&[
        ("rate_hz = 25.0", &format!("rate_hz = 25.0\n{cameras}")),
        ("size_px = [96, 80]", "size_px = [320, 256]"),
        ("period_px = 48.0", "period_px = 24.0"),
    ]);
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"2", &"--record", &recording]);
    run.assert_undisturbed();
    bench.assert_nothing_left();
    assert!(run.stage("cloud").passed > 0, "{run:?}");
    let info = bench.json(&[0], &[&"info", &recording, &"--json"]);
    assert_eq!(info["pixel_format"], format);
    assert_eq!(bench.json(&[0, 3], &[&"check", &recording, &"--json"])["fault_count"], 0);
    let offline = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&offline["different"], &offline["no_cloud"]), (&0.into(), &0.into()));
    assert!(offline["same"].as_u64().unwrap() > 0);
    let live = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    live.assert_balanced();
    let compared = &live.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{live:?}");
    assert_eq!(compared["same"], offline["same"], "{live:?}");
    bench.assert_nothing_left();
}

/// Simulates a dataset folder with 12-bit images.
fn simulate(bench: &Bench, dataset: &Path) -> Output {
    let options = "--object plane --board none --size 96x80 --steps 4 --period 48 --noise low --sd 0 --no-gray \
                   --supersampling 1 --format Y12";
    bench.command(&[&"simulate", &"-o", &dataset]).args(options.split_whitespace()).output().unwrap()
}

#[test]
fn a_12_bit_dataset_is_unchanged_after_import_replay_and_export() {
    let bench = Bench::new();
    let [dataset, imported, replayed, exported] =
        ["plane", "imported.mcap", "replayed.mcap", "exported"].map(|name| bench.path(name));
    assert!(simulate(&bench, &dataset).status.success());
    bench.execute(&[0], &[&"import", &dataset, &"-o", &imported]);
    bench.replay(&[&"replay", &imported, &"--rate", &"max", &"--record", &replayed]).assert_undisturbed();
    bench.execute(&[0], &[&"export", &replayed, &"--images", &"-o", &exported]);
    let bytes = |folder: &Path, name: &str| fs::read(folder.join(name)).unwrap();
    for name in ["meta.json", "cam1/phase_00.png", "cam2/phase_03.png"] {
        assert!(bytes(&dataset, name) == bytes(&exported, name), "{name}");
    }
    let clouds = [&dataset, &exported, &imported, &replayed].map(|input| {
        let cloud = bench.path("cloud.ply");
        bench.execute(&[0], &[&"reconstruct", input, &"-o", &cloud]);
        fs::read(cloud).unwrap()
    });
    assert!(clouds[0].len() > 10_000 && clouds.iter().all(|cloud| *cloud == clouds[0]));
    let over_channels = bench.path("channels.ply");
    bench.execute(&[0], &[&"export", &replayed, &"-o", &over_channels]);
    assert!(fs::read(over_channels).unwrap() == clouds[0]);
}

/// Copies a recording, and changes the pixel format in the header of image 1 of camera 2.
fn copy_with_wrong_format(from: &Path, to: &Path) {
    let recording = Recording::open(from).unwrap();
    let opening = Opening {
        setup: recording.setup(),
        configuration: recording.configuration_text(),
        origin: &recording.origin(),
        min_free_bytes: 0,
    };
    let recorder = Recorder::create(to, &opening, DEFAULT_QUEUE_BYTES).unwrap();
    for message in recording.messages() {
        match &message.unwrap().content {
            Content::Frame(header, image) => {
                let pixel_format = match (header.camera, header.sequence) {
                    (2, 1) => PixelFormat::Grey.code(),
                    _ => header.pixel_format,
                };
                recorder.push(&Recordable::Frame { header: &FrameHeader { pixel_format, ..*header }, image });
            }
            Content::Pattern(event) => recorder.push(&Recordable::Pattern(event)),
            _ => {}
        }
    }
    recorder.finish().unwrap();
}

#[test]
fn an_image_in_another_pixel_format_is_dropped_as_a_bad_image() {
    let bench = Bench::new();
    let [dataset, imported, mixed] = ["plane", "imported.mcap", "mixed.mcap"].map(|name| bench.path(name));
    assert!(simulate(&bench, &dataset).status.success());
    bench.execute(&[0], &[&"import", &dataset, &"-o", &imported]);
    copy_with_wrong_format(&imported, &mixed);
    let run = bench.replay(&[&"replay", &mixed, &"--rate", &"max"]);
    run.assert_balanced();
    assert_eq!(run.stage("pairing").dropped(DropReason::BadImage), 1, "{run:?}");
    // The only window is lost with it.
    assert_eq!((run.stage("windowing").passed, run.stage("cloud").passed), (0, 0), "{run:?}");
    bench.assert_nothing_left();
}
