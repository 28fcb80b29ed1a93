//! Cameras of more than 8 bits, and regions whose pixels are added up, live, recorded, replayed and offline.

use std::fs;
use std::path::Path;
use std::process::Output;

use fringeflow_message::{DropReason, FrameHeader, PixelFormat};
use fringeflow_recording::{Content, DEFAULT_QUEUE_BYTES, Opening, Recordable, Recorder, Recording};

use crate::support::Bench;

#[test]
fn images_of_twelve_bits_come_again_to_the_byte() {
    assert_come_again("format = \"Y12\"", "Y12");
}

#[test]
fn sums_of_the_pixels_of_a_region_come_again_to_the_byte() {
    assert_come_again("format = \"Y10\"\nregion_px = [33, 25, 256, 208]\nbinning = 2", "Y12");
}

/// Cameras with these settings are recorded in a format, and what is recorded gives the same clouds again.
fn assert_come_again(cameras: &str, format: &str) {
    let bench = Bench::with(&[
        ("rate_hz = 25.0", &format!("rate_hz = 25.0\n{cameras}")),
        ("size_px = [96, 80]", "size_px = [320, 256]"),
        ("period_px = 48.0", "period_px = 24.0"),
    ]);
    let recording = bench.path("scan.mcap");
    let ended = bench.run(&[&"--seconds", &"2", &"--record", &recording]);
    ended.assert_undisturbed();
    bench.assert_nothing_left();
    assert!(ended.stage("cloud").passed > 0, "{ended:?}");
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

/// Makes a dataset folder of images of twelve bits.
fn simulated(bench: &Bench, dataset: &Path) -> Output {
    let options = "--object plane --board none --size 96x80 --steps 4 --period 48 --noise low --sd 0 --no-gray \
                   --supersampling 1 --format Y12";
    bench.command(&[&"simulate", &"-o", &dataset]).args(options.split_whitespace()).output().unwrap()
}

#[test]
fn a_folder_of_twelve_bits_goes_through_recording_and_channels() {
    let bench = Bench::new();
    let [dataset, imported, replayed, exported] =
        ["plane", "imported.mcap", "replayed.mcap", "exported"].map(|name| bench.path(name));
    assert!(simulated(&bench, &dataset).status.success());
    bench.done(&[0], &[&"import", &dataset, &"-o", &imported]);
    bench.replay(&[&"replay", &imported, &"--rate", &"max", &"--record", &replayed]).assert_undisturbed();
    bench.done(&[0], &[&"export", &replayed, &"--images", &"-o", &exported]);
    let bytes = |folder: &Path, name: &str| fs::read(folder.join(name)).unwrap();
    for name in ["meta.json", "cam1/phase_00.png", "cam2/phase_03.png"] {
        assert!(bytes(&dataset, name) == bytes(&exported, name), "{name}");
    }
    let clouds = [&dataset, &exported, &imported, &replayed].map(|input| {
        let cloud = bench.path("cloud.ply");
        bench.done(&[0], &[&"reconstruct", input, &"-o", &cloud]);
        fs::read(cloud).unwrap()
    });
    assert!(clouds[0].len() > 10_000 && clouds.iter().all(|cloud| *cloud == clouds[0]));
    let over_channels = bench.path("channels.ply");
    bench.done(&[0], &[&"export", &replayed, &"-o", &over_channels]);
    assert!(fs::read(over_channels).unwrap() == clouds[0]);
}

/// Copies a recording; image 1 of camera 2 says that its bytes are those of another format.
fn with_another_format(from: &Path, to: &Path) {
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
fn an_image_of_another_format_is_a_bad_image() {
    let bench = Bench::new();
    let [dataset, imported, mixed] = ["plane", "imported.mcap", "mixed.mcap"].map(|name| bench.path(name));
    assert!(simulated(&bench, &dataset).status.success());
    bench.done(&[0], &[&"import", &dataset, &"-o", &imported]);
    with_another_format(&imported, &mixed);
    let ended = bench.replay(&[&"replay", &mixed, &"--rate", &"max"]);
    ended.assert_balanced();
    assert_eq!(ended.stage("pairing").dropped(DropReason::BadImage), 1, "{ended:?}");
    // Its window is lost, and there is no other.
    assert_eq!((ended.stage("windowing").passed, ended.stage("cloud").passed), (0, 0), "{ended:?}");
    bench.assert_nothing_left();
}
