//! Recomputes the clouds of small recordings.

#[path = "../../recording/src/tests/plane.rs"]
mod plane;

use std::path::PathBuf;

use tempfile::TempDir;

use fringeflow::cloud::{RECORD_BYTES, write_records};
use fringeflow_dataset::{CameraId, GreyImage};
use fringeflow_message::{CloudHeader, Window};
use fringeflow_recording::{
    Content, DEFAULT_QUEUE_BYTES, ImportOptions, Opening, Origin, Recordable, Recorder, Topic, import,
};

use super::*;

use plane::dataset;

fn imported(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("plane.mcap");
    let options = ImportOptions { period_ns: 20_000_000, configuration: "", min_free_bytes: 0 };
    import(dataset(), &path, &options, || ()).unwrap();
    path
}

/// Records the dataset with the cloud of its first window, modified by `change`.
fn with_cloud(folder: &TempDir, change: impl FnOnce(&mut CloudHeader, &mut Vec<u8>)) -> Recording {
    let imported = Recording::open(&imported(folder)).unwrap();
    let mut reconstructor: Reconstructor = reconstructor(&imported).unwrap();
    let images = CameraId::BOTH.map(|camera| dataset().phase_images(camera, &[0, 1, 2, 3]).unwrap());
    let [cam1, cam2] = images.each_ref().map(|images| GreyImage::levels_of(images));
    let reconstructed = reconstructor.reconstruct(0, &cam1, &cam2, None).unwrap();
    assert!(reconstructed.cloud.points.len() > 100, "{}", reconstructed.cloud.points.len());
    let mut records = Vec::new();
    write_records(&mut records, &reconstructed.cloud.points).unwrap();
    let mut window = Window { cam1_session: 1, cam2_session: 1, images: 4, ..Window::default() };
    window.cam1_sequence[..4].copy_from_slice(&[0, 1, 2, 3]);
    window.cam2_sequence = window.cam1_sequence;
    let window = Window { first_exposure_ns: 1_000_000_000, received_ns: 1_080_000_000, ..window };
    let mut header = CloudHeader { points: reconstructed.cloud.points.len() as u64, window, ..CloudHeader::default() };
    change(&mut header, &mut records);

    let origin = Origin::default();
    let opening = Opening { setup: &dataset().setup, configuration: "", origin: &origin, min_free_bytes: 0 };
    let recorder = Recorder::create(&folder.path().join("live.mcap"), &opening, DEFAULT_QUEUE_BYTES).unwrap();
    for topic in [Topic::Pattern, Topic::Cam1Frame, Topic::Cam2Frame] {
        for message in imported.messages_of(topic) {
            match message.unwrap().content {
                Content::Frame(header, image) => recorder.push(&Recordable::Frame { header: &header, image: &image }),
                Content::Pattern(event) => recorder.push(&Recordable::Pattern(&event)),
                other => panic!("{other:?}"),
            }
        }
    }
    recorder.push(&Recordable::Cloud { header: &header, records: &records });
    Recording::open(&recorder.finish().unwrap().file).unwrap()
}

fn outcome(recording: &Recording) -> VerifyOutcome {
    let [cloud] = &verify(recording, |_| ()).unwrap()[..] else {
        panic!("the recording does not have exactly one cloud")
    };
    cloud.outcome.clone()
}

#[test]
fn a_recomputed_cloud_is_equal_to_the_last_byte() {
    let folder = tempfile::tempdir().unwrap();
    let recording = with_cloud(&folder, |_, _| ());
    assert_eq!(outcome(&recording), VerifyOutcome::Same);
    assert!(recording.cloud(0).unwrap().unwrap().points.len() > 100);
    assert!(recording.cloud(1).unwrap().is_none());
    let check = recording.check(|| ()).unwrap();
    assert_eq!((check.clouds, check.losses.clouds_without_images, check.fault_count), (1, 0, 0));
    assert!(!check.losses.is_loss(), "{check:?}");
}

#[test]
fn one_changed_bit_of_a_point_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let recording = with_cloud(&folder, |_, records| records[RECORD_BYTES * 50 + 3] ^= 1);
    assert!(matches!(outcome(&recording), VerifyOutcome::Different { first: 50, .. }), "{:?}", outcome(&recording));
}

#[test]
fn missing_images_are_a_loss_unless_they_are_older_than_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let recording = with_cloud(&folder, |header, _| header.window.cam2_sequence[2] = 17);
    assert_eq!(outcome(&recording), VerifyOutcome::ImagesMissing);
    let check = recording.check(|| ()).unwrap();
    assert_eq!(check.losses.clouds_without_images, 1);
    assert!(check.losses.is_loss());
    let folder = tempfile::tempdir().unwrap();
    let recording = with_cloud(&folder, |header, _| {
        header.window.cam1_session = 9;
        header.window.first_exposure_ns = 900_000_000;
    });
    assert_eq!(outcome(&recording), VerifyOutcome::BeforeRecording);
    assert!(!recording.losses().unwrap().is_loss());
}

#[test]
fn images_in_the_wrong_order_give_another_result() {
    let folder = tempfile::tempdir().unwrap();
    let recording = with_cloud(&folder, |header, _| header.window.cam1_sequence.swap(0, 1));
    assert_ne!(outcome(&recording), VerifyOutcome::Same);
}

#[test]
fn pairs_beyond_the_limit_that_a_recording_states_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let imported = Recording::open(&imported(&folder)).unwrap();
    let exposures_ns: Vec<u64> = imported.frame_headers(1).map(|header| header.exposure_start_ns).collect();
    let pairs_with = |name: &str, limit: &str| {
        let configuration = format!("[cameras]\nsource = \"external\"\nrate_hz = 50.0\n{limit}");
        let (setup, origin) = (&dataset().setup, Origin::default());
        let opening = Opening { setup, configuration: &configuration, origin: &origin, min_free_bytes: 0 };
        let recorder = Recorder::create(&folder.path().join(name), &opening, DEFAULT_QUEUE_BYTES).unwrap();
        for topic in [Topic::Cam1Frame, Topic::Cam2Frame] {
            for message in imported.messages_of(topic) {
                let Content::Frame(mut header, image) = message.unwrap().content else { panic!() };
                // The second image of camera 2 is late.
                let is_late = topic == Topic::Cam2Frame && header.exposure_start_ns == exposures_ns[1];
                header.exposure_start_ns += if is_late { 1_000_001 } else { 0 };
                recorder.push(&Recordable::Frame { header: &header, image: &image });
            }
        }
        let recording = Recording::open(&recorder.finish().unwrap().file).unwrap();
        pairs(&recording).unwrap().iter().map(|pair| pair.step).collect::<Vec<_>>()
    };
    assert_eq!(pairs_with("old.mcap", ""), [0, 1, 2, 3]);
    assert_eq!(pairs_with("wide.mcap", "max_skew_us = 1000.001"), [0, 1, 2, 3]);
    assert_eq!(pairs_with("narrow.mcap", "max_skew_us = 1000"), [0, 2, 3]);
}
