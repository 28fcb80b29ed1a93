//! The whole pipeline on V4L2 cameras: the same images as in files give the same clouds, to the byte.

use std::collections::BTreeSet;
use std::path::Path;

use rustix::process::Signal;

use fringeflow_message::{Counts, DropReason, Stage};
use fringeflow_recording::{Content, Recording};

use crate::scenes::{self, STEPS};
use crate::support::{Bench, Live, NAME, wait};

use super::BUFFERS;
use super::feeder::Feeder;

/// Images that camera 1 loses: of more than its buffers hold (or, by its version, of more than two) the driver keeps the last.
const LOST: u64 = BUFFERS as u64;
/// Rounds after which a machine that never gets through a window undisturbed is given up.
const ROUNDS: usize = 12;

#[test]
#[ignore = "runs in the virtual machine"]
fn clouds_are_those_of_the_images_in_files() {
    let scene = &scenes::all()[0];
    let _loopback = super::load();
    let mut feeder = Feeder::new();
    let bench = Bench::of(&super::scanner(scene, "GREY", "trigger = \"external\""));
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    scan(&bench, &live, &mut feeder);
    lose(&bench, &live, &mut feeder);
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
    // A machine that is too busy keeps the recorder from its turn; then it says so.
    let images = |camera| unseen(recorded.frame_headers(camera).map(|header| header.published));
    let clouds = unseen(recorded.cloud_headers().map(|header| header.published));
    let all = images(1) + images(2) + clouds;
    assert!(all <= ended.stage("recorder").dropped(DropReason::Overrun), "{all}: {ended:?}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    let number = |what: &str| verified[what].as_u64().unwrap();
    let [same, different, without] = ["same", "different", "images_missing"].map(number);
    let recorded = recorded.cloud_headers().count() as u64;
    assert!(different == 0 && without <= images(1) + images(2) && same + without == recorded, "{verified}");
}

/// Stops the capture of camera 1 for so long that the driver gives up images.
fn lose(bench: &Bench, live: &Live<'_>, feeder: &mut Feeder) {
    live.signal("camera1", Signal::STOP);
    for _ in 0..=LOST {
        feeder.show();
        let shown = feeder.shown() as u64;
        live.wait_until("camera 2 goes on", || bench.counts(Stage::Camera2).taken == shown);
    }
    live.signal("camera1", Signal::CONT);
    take(bench, feeder.shown());
}

/// Shows round after round until a window of each scene became a cloud: a pause of this machine breaks the one that it hits.
fn scan(bench: &Bench, live: &Live<'_>, feeder: &mut Feeder) {
    take(bench, feeder.shown());
    // Up to the end of a window.
    while !feeder.shown().is_multiple_of(STEPS) {
        show(bench, feeder);
    }
    let mut is_seen = vec![false; feeder.round() / STEPS];
    let mut before = clouds(bench, live);
    for window in 0..ROUNDS * is_seen.len() {
        for _ in 0..STEPS {
            show(bench, feeder);
        }
        let now = clouds(bench, live);
        let scene = window % is_seen.len();
        is_seen[scene] |= now > before;
        if is_seen.iter().all(|&seen| seen) {
            return;
        }
        before = now;
    }
    panic!("in {ROUNDS} rounds not every scene gave a cloud: {is_seen:?}");
}

fn show(bench: &Bench, feeder: &mut Feeder) {
    feeder.show_next();
    take(bench, feeder.shown());
}

/// Waits until both cameras have taken so many images.
fn take(bench: &Bench, images: usize) {
    let counts = || [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage));
    let taken = wait(|| counts().map(|counts| counts.taken as usize) == [images; 2]);
    assert!(taken, "{images} were shown, not taken: {:?}", counts());
}

/// Clouds so far, when all that is in work has become one and the recorder has seen it.
fn clouds(bench: &Bench, live: &Live<'_>) -> u64 {
    let stages = [Stage::Windowing, Stage::Phase, Stage::Correspondence, Stage::Cloud];
    let is_done = |counts: &[Counts]| {
        counts.windows(2).all(|pair| pair[0].passed == pair[1].taken)
            && counts.iter().all(|counts| counts.in_work() == Some(0))
    };
    live.wait_until("nothing is in work", || {
        // The last images are paired as soon as they are read.
        let paired = bench.counts(Stage::Pairing);
        let sent = [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage).passed).iter().sum::<u64>();
        paired.taken == sent && is_done(&stages.map(|stage| bench.counts(stage)))
    });
    let clouds = bench.counts(Stage::Cloud).passed;
    // It looks at every channel between two changes of its account.
    for _ in 0..2 {
        let before = bench.counts(Stage::Recorder).taken;
        live.wait_until("the recorder has its turn", || bench.counts(Stage::Recorder).taken > before);
    }
    clouds
}

/// Every image came as it was shown.
fn assert_images(recorded: &Recording, feeder: &Feeder) {
    for message in recorded.messages() {
        if let Content::Frame(header, pixels) = message.unwrap().content {
            assert!(*pixels == *feeder.image(header.camera, header.sequence), "image {}", header.sequence);
        }
    }
}

/// Messages of these numbers that are missing between them.
fn unseen(published: impl Iterator<Item = u64>) -> u64 {
    let numbers: Vec<u64> = published.collect();
    numbers[numbers.len() - 1] - numbers[0] + 1 - numbers.len() as u64
}

/// Every cloud is that of its scene, and no scene is missing.
fn assert_clouds(bench: &Bench, recorded: &Recording) {
    let folder = bench.path("clouds");
    bench.done(&[0, 3], &[&"export", &bench.path("scan.mcap"), &"-o", &folder]);
    let scenes = scenes::all();
    let mut seen = BTreeSet::new();
    for (number, header) in recorded.cloud_headers().enumerate() {
        let first = header.window.cam1_sequence[0] as usize;
        assert!(header.window.pairs().eq((first..first + STEPS).map(|number| [number as u64; 2])), "{header:?}");
        let scene = first / STEPS % scenes.len();
        let cloud = std::fs::read(exported(&folder, number)).unwrap();
        assert!(cloud == scenes[scene].cloud(NAME), "cloud {number}, of {:?}", scenes[scene]);
        seen.insert(scene);
    }
    let windows: Vec<_> = recorded.cloud_headers().map(|header| header.window.cam1_sequence[0]).collect();
    assert_eq!(seen.len(), scenes.len(), "windows with these first images became clouds: {windows:?}");
}

fn exported(folder: &Path, number: usize) -> std::path::PathBuf {
    folder.join(format!("cloud_{number:06}.ply"))
}
