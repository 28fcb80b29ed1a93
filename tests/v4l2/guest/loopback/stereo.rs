//! One device that gives the images of both cameras, side by side.

use fringeflow_message::DropReason;
use fringeflow_recording::Recording;

use crate::guest::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

use super::feeder::Feeder;
use super::{DEVICES, RATE_HZ, camera_table, pipeline};

#[test]
#[ignore = "runs in the virtual machine"]
fn both_views_of_one_device_give_the_clouds_from_files() {
    let _loopback = super::load();
    let mut feeder = Feeder::side_by_side();
    let bench = Bench::from_configuration(&scanner("stereo_layout = \"side-by-side\""));
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    pipeline::scan(&bench, &live, &mut feeder);
    let ended = live.quit();
    ended.assert_balanced();
    for camera in ["camera1", "camera2"] {
        let counts = ended.stage(camera);
        assert_eq!((counts.taken as usize, counts.passed as usize), (feeder.shown(), feeder.shown()), "{ended:?}");
    }
    let pairing = ended.stage("pairing");
    let [skewed, unpaired] = [DropReason::Skewed, DropReason::Unpaired].map(|reason| pairing.dropped(reason));
    assert_eq!((skewed, unpaired), (0, 0), "{ended:?}");
    bench.assert_nothing_left();
    let recorded = Recording::open(&recording).unwrap();
    pipeline::assert_images(&recorded, &feeder);
    pipeline::assert_clouds(&bench, &recorded);
    for (first, second) in recorded.frame_headers(1).zip(recorded.frame_headers(2)) {
        let place =
            |header: &fringeflow_message::FrameHeader| (header.session, header.sequence, header.exposure_start_ns);
        assert_eq!(place(first), place(second));
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn a_device_is_checked_for_the_size_of_both_views() {
    let _loopback = super::load();
    let _feeder = Feeder::side_by_side();
    let fits = Bench::from_configuration(&scanner("stereo_layout = \"side-by-side\""));
    let check = |bench: &Bench, codes: &[i32]| {
        let checked = bench.json(codes, &[&"run", &"--config", &bench.configuration(), &"--check", &"--json"]);
        let points = checked["points"].as_array().unwrap();
        points.iter().find(|point| point["what"] == "cameras 1 and 2").unwrap()["found"].as_str().unwrap().to_owned()
    };
    let found = check(&fits, &[0]);
    assert!(found.contains("640x180 GREY") && found.contains("time stamps of the program"), "{found}");
    let other = Bench::from_configuration(&scanner("stereo_layout = \"top-bottom\""));
    let found = check(&other, &[2]);
    assert!(found.contains("320x360 GREY (two images of 320x180 top-bottom"), "{found}");
}

/// A scanner whose only device is that of [`Feeder::side_by_side`].
fn scanner(layout: &str) -> String {
    let both = camera_table("both", DEVICES[0], "trigger = \"external\"");
    let cameras = format!("rate_hz = {RATE_HZ:.1}\n{layout}\n{both}");
    let rest = format!("[window]\nevery = {}\nwhen_busy = \"wait\"\n", scenes::STEPS);
    configuration(&scenes::all()[0], &cameras, &rest)
}
