//! The whole pipeline on V4L2 cameras: the same images give the same clouds as from files, byte by byte.

use std::collections::BTreeSet;
use std::path::Path;

use rustix::process::Signal;

use fringeflow_message::{Counts, DropReason, Stage};
use fringeflow_recording::{Content, Recording};

use crate::scenes::{self, STEPS};
use crate::support::{Bench, Live, NAME, wait_until};

use super::BUFFERS;
use super::feeder::Feeder;

/// Images that camera 1 loses. If there are more than its buffers hold (in some versions, more than two), the driver
/// keeps only the last.
const LOST: u64 = BUFFERS as u64;
/// Rounds after which the test fails, because this machine disturbed every window.
const ROUNDS: usize = 12;

#[test]
#[ignore = "runs in the virtual machine"]
fn clouds_equal_those_from_files() {
    let scene = &scenes::all()[0];
    let _loopback = super::load();
    let mut feeder = Feeder::new();
    let bench = Bench::from_configuration(&super::scanner(scene, "GREY", "trigger = \"external\""));
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    scan(&bench, &live, &mut feeder);
    lose_images(&bench, &live, &mut feeder);
    scan(&bench, &live, &mut feeder);
    let ended = live.quit();
    ended.assert_balanced();
    for (camera, lost) in [("camera1", LOST), ("camera2", 0)] {
        let counts = ended.stage(camera);
        assert_eq!(counts.taken as usize, feeder.shown(), "{ended:?}");
        assert_eq!((counts.passed, counts.dropped(DropReason::CameraLost)), (counts.taken - lost, lost), "{ended:?}");
    }
    bench.assert_nothing_left();
    let recorded = Recording::open(&recording).unwrap();
    assert_images(&recorded, &feeder);
    assert_clouds(&bench, &recorded);
    // On a busy machine the recorder may miss messages; then it counts them.
    let missing_images = |camera| count_missing(recorded.frame_headers(camera).map(|header| header.published));
    let missing_clouds = count_missing(recorded.cloud_headers().map(|header| header.published));
    let missing = missing_images(1) + missing_images(2) + missing_clouds;
    assert!(missing <= ended.stage("recorder").dropped(DropReason::Overrun), "{missing}: {ended:?}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    let number = |what: &str| verified[what].as_u64().unwrap();
    let [same, different, without] = ["same", "different", "images_missing"].map(number);
    let recorded = recorded.cloud_headers().count() as u64;
    let missing_images = missing_images(1) + missing_images(2);
    assert!(different == 0 && without <= missing_images && same + without == recorded, "{verified}");
    // The services make them again too, from the images alone.
    bench.execute(&[0, 3], &[&"replay", &recording, &"--rate", &"max", &"--verify"]);
}

/// Stops the capture of camera 1 until the driver drops images.
fn lose_images(bench: &Bench, live: &Live<'_>, feeder: &mut Feeder) {
    live.signal("camera1", Signal::STOP);
    for _ in 0..=LOST {
        feeder.show();
        let shown = feeder.shown() as u64;
        live.wait_until("camera 2 goes on", || bench.counts(Stage::Camera2).taken == shown);
    }
    live.signal("camera1", Signal::CONT);
    wait_for_images(bench, feeder.shown());
}

/// Shows rounds until a window of each scene has become a cloud. A pause of this machine breaks a window.
pub(super) fn scan(bench: &Bench, live: &Live<'_>, feeder: &mut Feeder) {
    wait_for_images(bench, feeder.shown());
    // Continue to the end of a window.
    while !feeder.shown().is_multiple_of(STEPS) {
        show(bench, feeder);
    }
    let mut has_cloud = vec![false; feeder.round_pairs() / STEPS];
    let mut before = settled_clouds(bench, live);
    for window in 0..ROUNDS * has_cloud.len() {
        for _ in 0..STEPS {
            show(bench, feeder);
        }
        let now = settled_clouds(bench, live);
        let scene = window % has_cloud.len();
        has_cloud[scene] |= now > before;
        if has_cloud.iter().all(|&has_cloud| has_cloud) {
            return;
        }
        before = now;
    }
    panic!("in {ROUNDS} rounds not every scene gave a cloud: {has_cloud:?}");
}

fn show(bench: &Bench, feeder: &mut Feeder) {
    feeder.show_next();
    wait_for_images(bench, feeder.shown());
}

/// Waits until both cameras have taken this number of images.
fn wait_for_images(bench: &Bench, images: usize) {
    let counts = || [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage));
    let taken = wait_until(|| counts().map(|counts| counts.taken as usize) == [images; 2]);
    assert!(taken, "{images} images were shown, but not all taken: {:?}", counts());
}

/// Waits until no stage has work and the recorder has received everything. Returns the number of clouds.
fn settled_clouds(bench: &Bench, live: &Live<'_>) -> u64 {
    let stages = [Stage::Windowing, Stage::Phase, Stage::Correspondence, Stage::Cloud];
    let is_settled = |counts: &[Counts]| {
        counts.windows(2).all(|pair| pair[0].passed == pair[1].taken)
            && counts.iter().all(|counts| counts.in_work() == Some(0))
    };
    live.wait_until("nothing is in work", || {
        // Pairing has no work left once it has read all images.
        let paired = bench.counts(Stage::Pairing);
        let sent = [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage).passed).iter().sum::<u64>();
        paired.taken == sent && is_settled(&stages.map(|stage| bench.counts(stage)))
    });
    let clouds = bench.counts(Stage::Cloud).passed;
    // The recorder reads every channel between two updates of its counts.
    for _ in 0..2 {
        let before = bench.counts(Stage::Recorder).taken;
        live.wait_until("the recorder has updated its counts", || bench.counts(Stage::Recorder).taken > before);
    }
    clouds
}

/// Asserts that every recorded image is the one that was shown.
pub(super) fn assert_images(recorded: &Recording, feeder: &Feeder) {
    for message in recorded.messages() {
        if let Content::Frame(header, pixels) = message.unwrap().content {
            assert!(*pixels == *feeder.image(header.camera, header.sequence), "image {}", header.sequence);
        }
    }
}

/// Counts the gaps in these numbers.
fn count_missing(published: impl Iterator<Item = u64>) -> u64 {
    let numbers: Vec<u64> = published.collect();
    numbers[numbers.len() - 1] - numbers[0] + 1 - numbers.len() as u64
}

/// Asserts that every cloud is that of its scene, and that every scene has one.
pub(super) fn assert_clouds(bench: &Bench, recorded: &Recording) {
    let folder = bench.path("clouds");
    bench.execute(&[0, 3], &[&"export", &bench.path("scan.mcap"), &"-o", &folder]);
    let scenes = scenes::all();
    let mut scenes_with_cloud = BTreeSet::new();
    for (number, header) in recorded.cloud_headers().enumerate() {
        let first = header.window.cam1_sequence[0] as usize;
        assert!(header.window.pairs().eq((first..first + STEPS).map(|number| [number as u64; 2])), "{header:?}");
        let scene = first / STEPS % scenes.len();
        let cloud = std::fs::read(exported_cloud(&folder, number)).unwrap();
        assert!(cloud == scenes[scene].cloud(NAME), "cloud {number}, of {:?}", scenes[scene]);
        scenes_with_cloud.insert(scene);
    }
    let windows: Vec<_> = recorded.cloud_headers().map(|header| header.window.cam1_sequence[0]).collect();
    assert_eq!(scenes_with_cloud.len(), scenes.len(), "first images of the windows with a cloud: {windows:?}");
}

fn exported_cloud(folder: &Path, number: usize) -> std::path::PathBuf {
    folder.join(format!("cloud_{number:06}.ply"))
}
