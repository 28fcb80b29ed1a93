//! Everything is read as it was written, to the last bit.

use fringeflow::cloud::RECORD_BYTES;
use fringeflow_dataset::CameraId;

use super::*;

#[test]
fn every_message_is_read_unchanged() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    let (first, second) = (frame(1, 11), frame(2, 21));
    let (first_bytes, second_bytes) = (frame_bytes(&first), frame_bytes(&second));
    let records: Vec<u8> = (0..3 * RECORD_BYTES).map(|i| i as u8).collect();
    let payload = [1, 2, 3, 4, 5];
    recorder.push(&Recordable::Frame { header: &first, image: &first_bytes });
    recorder.push(&Recordable::Frame { header: &second, image: &second_bytes });
    recorder.push(&Recordable::Pattern(&pattern()));
    recorder.push(&Recordable::Maps { header: &maps(), payload: &payload });
    recorder.push(&Recordable::Correspondences { header: &correspondences(), payload: &payload });
    recorder.push(&Recordable::Cloud { header: &cloud(3), records: &records });
    recorder.push(&Recordable::Report(&report()));
    recorder.push(&Recordable::WindowReport(&window_report()));
    recorder.push(&Recordable::Pose(&pose_report()));
    recorder.push(&Recordable::Prior { header: &prior_header(), relief: &RELIEF });
    recorder.push(&Recordable::Mark { time_ns: 8000, text: "here ö" });
    let recorded = recorder.finish().unwrap();
    assert_eq!((recorded.counts.total().passed, recorded.counts.total().in_work()), (11, Some(0)));

    let recording = Recording::open(&recorded.file).unwrap();
    let read: Vec<Message> = recording.messages().map(Result::unwrap).collect();
    let the = |topic: Topic| {
        let mut found = read.iter().filter(|message| message.topic == topic);
        let message = found.next().unwrap();
        assert!(found.next().is_none());
        message
    };
    assert!(matches!(&the(Topic::Cam1Frame).content, Content::Frame(h, b) if *h == first && *b == first_bytes));
    assert!(matches!(&the(Topic::Cam2Frame).content, Content::Frame(h, b) if *h == second && *b == second_bytes));
    assert!(matches!(&the(Topic::Pattern).content, Content::Pattern(event) if *event == pattern()));
    assert!(matches!(&the(Topic::PhaseMaps).content, Content::Maps(h, b) if **h == maps() && *b == payload[..]));
    let Content::Correspondences(header, bytes) = &the(Topic::CorrespondenceMap).content else { panic!() };
    assert!(**header == correspondences() && *bytes == payload[..]);
    assert!(matches!(&the(Topic::Cloud).content, Content::Cloud(h, b) if **h == cloud(3) && *b == records));
    assert!(matches!(&the(Topic::Report).content, Content::Report(r) if **r == report()));
    assert!(matches!(&the(Topic::Pose).content, Content::Pose(r) if **r == pose_report()));
    assert!(matches!(&the(Topic::Prior).content, Content::Prior(h, b) if **h == prior_header() && *b == RELIEF[..]));
    assert!(matches!(&the(Topic::WindowReport).content, Content::WindowReport(r) if **r == window_report()));
    assert!(matches!(&the(Topic::Log).content, Content::Mark(text) if text == "here ö"));
    let times = |topic| (the(topic).log_ns, the(topic).publish_ns);
    assert_eq!(times(Topic::Cam1Frame), (11_900, 11_000));
    assert_eq!(times(Topic::Cloud), (600, 100));
    assert_eq!(times(Topic::Report), (7000, 7000));
    assert_eq!((recording.lost_messages(), recording.recorder_account()["ended"].as_str()), (Some(0), "end"));
}

#[test]
fn held_images_are_recorded_like_copied_ones() {
    let folder = Folder::new();
    let record = |name: &str, is_held: bool| {
        let recorder = start_recording(&folder, name);
        for sequence in 0..3 * MAX_HELD_IMAGES as u64 {
            let header = frame(1 + sequence as u32 % 2, sequence);
            let image = frame_bytes(&header);
            if is_held {
                recorder.push_held(&header, image, |header, image| Recordable::Frame { header, image });
            } else {
                recorder.push(&Recordable::Frame { header: &header, image: &image });
            }
        }
        let recorded = recorder.finish().unwrap();
        assert_eq!(recorded.counts.total().passed, 3 * MAX_HELD_IMAGES as u64);
        let recording = Recording::open(&recorded.file).unwrap();
        let read = recording.messages().map(|message| message.unwrap());
        let images = read.filter(|message| [Topic::Cam1Frame, Topic::Cam2Frame].contains(&message.topic));
        images.map(|message| message.content).collect::<Vec<_>>()
    };
    let (held, copied) = (record("held.mcap", true), record("copied.mcap", false));
    assert_eq!(held.len(), 3 * MAX_HELD_IMAGES);
    for (held, copied) in held.iter().zip(&copied) {
        let (Content::Frame(header, image), Content::Frame(copied_header, copy)) = (held, copied) else { panic!() };
        assert!(header == copied_header && image == copy);
    }
}

#[test]
fn messages_are_read_in_the_order_of_their_times() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    for time_ns in [30, 10, 20, 10] {
        recorder.push(&Recordable::Prior { header: &prior_header(), relief: &RELIEF });
        recorder.push(&Recordable::Mark { time_ns, text: "" });
    }
    let recording = finished(recorder);
    let times: Vec<u64> = recording.messages_of(Topic::Log).map(|message| message.unwrap().log_ns).collect();
    assert_eq!(times, [10, 10, 20, 30]);
}

#[test]
fn a_recording_contains_setup_configuration_and_origin() {
    let folder = Folder::new();
    let origin = Origin::here();
    let recorder = Recorder::create(&folder.path("a.mcap"), &opening(&origin), DEFAULT_QUEUE_BYTES).unwrap();
    let recording = finished(recorder);
    assert_eq!(*recording.setup(), *setup());
    assert_eq!(recording.origin(), origin);
    assert!(origin.started_ns > 0 && !origin.kernel.is_empty());
    assert_eq!(recording.writer_version(), env!("CARGO_PKG_VERSION"));
    assert_eq!(recording.configuration_text(), "[phase]\nmin_modulation_grey = 4.0\n");
    assert!(recording.truth().unwrap().is_none());
}

#[test]
fn rows_are_read_without_padding() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    let header = frame(1, 11);
    let bytes = frame_bytes(&header);
    recorder.push(&Recordable::Frame { header: &header, image: &bytes });
    let recording = finished(recorder);
    let image = recording.image(1, header.session, 11).unwrap();
    assert_eq!([image.width, image.height], SIZE_PX);
    assert_eq!(image.pixels[..64], bytes[..64]);
    assert_eq!(image.pixels[64..128], bytes[72..136]);
    let missing = recording.image(1, header.session, 12).unwrap_err();
    assert!(matches!(missing.problem, RecordingProblem::NoImage { camera: 1, sequence: 12, .. }), "{missing}");
}

#[test]
fn deep_images_keep_their_bytes_and_their_format() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    let header = FrameHeader { pixel_format: PixelFormat::Y12.code(), stride_bytes: 136, ..frame(1, 11) };
    let bytes = frame_bytes(&header);
    recorder.push(&Recordable::Frame { header: &header, image: &bytes });
    // With this stride the rows would overlap.
    let narrow = FrameHeader { stride_bytes: 127, ..header };
    recorder.push(&Recordable::Frame { header: &narrow, image: &frame_bytes(&narrow) });
    let recorded = recorder.finish().unwrap();
    assert_eq!(recorded.counts.malformed, 1);
    let recording = Recording::open(&recorded.file).unwrap();
    assert_eq!(recording.pixel_format(), PixelFormat::Y12);
    assert_eq!(recording.summary().unwrap().pixel_format, "Y12");
    assert_eq!(recording.check(|| ()).unwrap().fault_count, 0);
    let image = recording.image(1, header.session, 11).unwrap();
    assert_eq!(([image.width, image.height], image.format), (SIZE_PX, PixelFormat::Y12));
    assert_eq!(image.pixels[..128], bytes[..128]);
    assert_eq!(image.pixels[128..256], bytes[136..264]);
}

#[test]
fn an_imported_dataset_has_its_images_steps_setup_and_truth() {
    let folder = Folder::new();
    let recording = Recording::open(&imported(&folder)).unwrap();
    assert_eq!(*recording.setup(), *setup());
    let pairs = recording.pairs().unwrap();
    assert_eq!(pairs.iter().map(|pair| pair.step).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!(cycle_starts(&pairs, 4).collect::<Vec<_>>(), [0]);
    assert_eq!(pairs[3].cam2.exposure_start_ns, 1_060_000_000);
    for camera in CameraId::BOTH {
        let images = recording.pair_images(&pairs, camera).unwrap();
        assert_eq!(images, dataset().phase_images(camera, &[0, 1, 2, 3]).unwrap());
    }
    assert!(recording.truth().unwrap().is_some());
    assert_eq!(recording.lost_messages(), Some(0));
}

#[test]
fn the_same_dataset_gives_the_same_bytes() {
    let folders = [Folder::new(), Folder::new()];
    let [a, b] = folders.each_ref().map(|folder| std::fs::read(imported(folder)).unwrap());
    assert!(a == b);
}
