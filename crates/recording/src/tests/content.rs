//! Checking, verifying and exporting: what is in a recording is compared with itself.

use super::*;
use crate::cloud::{RECORD_BYTES, write_records};
use crate::dataset::{CameraId, Dataset, GreyImage};
use crate::reconstruction::Reconstructor;

/// Records the dataset with the clouds of its windows `steps`, as `alter` leaves them.
fn with_cloud(folder: &Folder, alter: impl FnOnce(&mut CloudHeader, &mut Vec<u8>)) -> Recording {
    let imported = Recording::open(&imported(folder)).unwrap();
    let mut reconstructor: Reconstructor = imported.reconstructor().unwrap();
    let images = CameraId::BOTH.map(|camera| dataset().phase_images(camera, &[0, 1, 2, 3]).unwrap());
    let [cam1, cam2] = images.each_ref().map(|images| GreyImage::levels_of(images));
    let made = reconstructor.reconstruct(0, &cam1, &cam2, None).unwrap();
    assert!(made.cloud.points.len() > 100, "{}", made.cloud.points.len());
    let mut records = Vec::new();
    write_records(&mut records, &made.cloud.points, 1.0).unwrap();
    let mut header = cloud(made.cloud.points.len() as u64);
    let mut window = Window { cam1_session: 1, cam2_session: 1, images: 4, ..Window::default() };
    window.cam1_sequence[..4].copy_from_slice(&[0, 1, 2, 3]);
    window.cam2_sequence = window.cam1_sequence;
    header.window = Window { first_exposure_ns: 1_000_000_000, received_ns: 1_080_000_000, ..window };
    alter(&mut header, &mut records);

    let origin = Origin::default();
    let opening = Opening { configuration: "", ..opening(&origin) };
    let recorder = Recorder::create(&folder.path("live.mcap"), &opening, DEFAULT_QUEUE_BYTES).unwrap();
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
    let [cloud] = &recording.verify(|_| ()).unwrap()[..] else { panic!("one cloud") };
    cloud.outcome.clone()
}

#[test]
fn a_cloud_is_made_again_of_its_images_to_the_last_byte() {
    let folder = Folder::new();
    let recording = with_cloud(&folder, |_, _| ());
    assert_eq!(outcome(&recording), VerifyOutcome::Same);
    assert!(recording.cloud(0).unwrap().unwrap().points.len() > 100);
    assert!(recording.cloud(1).unwrap().is_none());
    let check = recording.check(|| ()).unwrap();
    assert_eq!((check.clouds, check.clouds_without_images, check.fault_count), (1, 0, 0));
    assert!(!check.has_losses(), "{check:?}");
}

#[test]
fn one_bit_of_one_point_is_found() {
    let folder = Folder::new();
    let recording = with_cloud(&folder, |_, records| records[RECORD_BYTES * 50 + 3] ^= 1);
    assert!(matches!(outcome(&recording), VerifyOutcome::Different { first: 50, .. }), "{:?}", outcome(&recording));
}

#[test]
fn a_cloud_without_its_images_is_a_loss_and_one_from_before_is_not() {
    let folder = Folder::new();
    let recording = with_cloud(&folder, |header, _| header.window.cam2_sequence[2] = 17);
    assert_eq!(outcome(&recording), VerifyOutcome::ImagesMissing);
    let check = recording.check(|| ()).unwrap();
    assert_eq!(check.clouds_without_images, 1);
    assert!(check.has_losses());
    let folder = Folder::new();
    let recording = with_cloud(&folder, |header, _| {
        header.window.cam1_session = 9;
        header.window.first_exposure_ns = 900_000_000;
    });
    assert_eq!(outcome(&recording), VerifyOutcome::BeforeRecording);
    assert!(!recording.check(|| ()).unwrap().has_losses());
}

#[test]
fn images_of_the_wrong_order_make_no_such_cloud() {
    let folder = Folder::new();
    let recording = with_cloud(&folder, |header, _| header.window.cam1_sequence.swap(0, 1));
    assert_ne!(outcome(&recording), VerifyOutcome::Same);
}

#[test]
fn numbers_that_are_not_finite_and_gaps_are_found() {
    let folder = Folder::new();
    let recording = with_cloud(&folder, |_, records| records[0..4].copy_from_slice(&f32::NAN.to_le_bytes()));
    let check = recording.check(|| ()).unwrap();
    assert_eq!(check.fault_count, 1);
    assert!(check.faults[0].contains("point 0 has a number that is not finite"), "{:?}", check.faults);

    let recorder =
        Recorder::create(&folder.path("gaps.mcap"), &opening(&Origin::default()), DEFAULT_QUEUE_BYTES).unwrap();
    for sequence in [3, 4, 7, 7] {
        let header = frame(1, sequence);
        recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
    }
    recorder.push(&Recordable::Pattern(&pattern()));
    recorder.push(&Recordable::Pattern(&PatternEvent { sequence: 35, step: 4, ..pattern() }));
    let check = Recording::open(&recorder.finish().unwrap().file).unwrap().check(|| ()).unwrap();
    assert_eq!((check.missing_images, check.repeated_images, check.missing_patterns), ([2, 0], [1, 0], 3));
    assert_eq!(check.fault_count, 1);
    assert!(check.faults[0].contains("step is 4"), "{:?}", check.faults);
}

#[test]
fn an_exported_import_is_the_same_folder() {
    let folder = Folder::new();
    let recording = Recording::open(&imported(&folder)).unwrap();
    let target = folder.path("exported");
    export_images(&recording, &recording.pairs().unwrap(), &target, || ()).unwrap();
    let names = ["meta.json", "calibration.yml", "truth.npz", "cam1/phase_00.png", "cam2/phase_03.png"];
    for name in names {
        let [a, b] = [&dataset().folder, &target].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name}");
    }
    let again = folder.path("again.mcap");
    import(&Dataset::open(&target, None).unwrap(), &again, &import_options(), || ()).unwrap();
    assert!(std::fs::read(again).unwrap() == std::fs::read(recording.path()).unwrap());
}

#[test]
fn a_summary_names_topics_rates_marks_and_losses() {
    let folder = Folder::new();
    let recorder = Recorder::create(&folder.path("a.mcap"), &opening(&Origin::default()), DEFAULT_QUEUE_BYTES).unwrap();
    for sequence in 0..5 {
        let header = FrameHeader { received_ns: sequence * 20_000_000, ..frame(2, sequence) };
        recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
    }
    recorder.push(&Recordable::Mark { time_ns: 50_000_000, text: "left side" });
    recorder.push(&Recordable::Report(&report()));
    let summary = Recording::open(&recorder.finish().unwrap().file).unwrap().summary().unwrap();
    let frames = summary.topics.iter().find(|topic| topic.topic == "/cam2/frame").unwrap();
    assert_eq!(frames.messages, 5);
    assert!((frames.rate_hz.unwrap() - 50.0).abs() < 1e-9);
    assert_eq!(summary.marks, [Remark { time_s: 0.05, text: "left side".to_owned() }]);
    assert_eq!(summary.stages[0].dropped, [("overrun", 2), ("unpaired", 7)].into());
    assert!((summary.duration_s - 0.08).abs() < 1e-9 && summary.lost == Some(0));
}

#[test]
fn numbers_at_their_limits_are_counted_without_overflow() {
    let folder = Folder::new();
    let recorder = Recorder::create(&folder.path("a.mcap"), &opening(&Origin::default()), DEFAULT_QUEUE_BYTES).unwrap();
    for session in 0..2 {
        for sequence in [0, u64::MAX] {
            let header = FrameHeader { session, exposure_start_ns: sequence, received_ns: sequence, ..frame(1, 0) };
            let header = FrameHeader { sequence, ..header };
            recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
            recorder.push(&Recordable::Pattern(&PatternEvent { session, sequence, ..pattern() }));
        }
    }
    let recording = Recording::open(&recorder.finish().unwrap().file).unwrap();
    let check = recording.check(|| ()).unwrap();
    assert_eq!((check.missing_images[0], check.missing_patterns), (u64::MAX, u64::MAX));
    assert!(recording.pairs().unwrap().is_empty());
    assert!(recording.summary().unwrap().duration_s > 1e9);
}
