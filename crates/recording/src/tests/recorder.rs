//! The recorder reports every loss, and a partial file never has the name of a recording.

use std::sync::Arc;
use std::time::{Duration, Instant};

use fringeflow::cloud::RECORD_BYTES;

use super::*;

#[test]
fn messages_lost_by_a_full_queue_are_reported_in_the_file() {
    let folder = Folder::new();
    let origin = Origin::here();
    let image = frame_bytes(&frame(1, 0));
    // The queue has room for the report, but not for an image.
    let recorder = Recorder::create(&folder.path("a.mcap"), &opening(&origin), 4096).unwrap();
    recorder.push(&Recordable::Frame { header: &frame(1, 0), image: &image });
    recorder.push(&Recordable::Frame { header: &frame(1, 1), image: &image });
    recorder.push(&Recordable::Report(&report()));
    let recorded = recorder.finish().unwrap();
    let total = recorded.counts.total();
    assert_eq!((total.taken, total.passed, total.in_work()), (3, 1, Some(0)));
    assert_eq!(recorded.counts.topics[&Topic::Cam1Frame].dropped(DropReason::QueueFull), 2);
    let recording = Recording::open(&recorded.file).unwrap();
    assert_eq!(recording.count(Topic::Cam1Frame), 0);
    assert_eq!(recording.lost_messages(), Some(2));
    assert_eq!(recording.recorder_account()["lost.queue_full/cam1/frame"], "2");
    let log: Vec<_> = recording.messages_of(Topic::Log).map(|m| m.unwrap().content).collect();
    assert!(matches!(&log[..], [Content::Loss(text)] if text.starts_with("2 messages were lost")), "{log:?}");
}

#[test]
fn a_held_image_is_dropped_once_it_is_copied() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    let header = frame(1, 0);
    let image: Arc<[u8]> = frame_bytes(&header).into();
    let started = Instant::now();
    // More of them than can be held, each once the one before was dropped.
    for _ in 0..3 * MAX_HELD_IMAGES {
        recorder.push_held(&header, Arc::clone(&image), |header, image| Recordable::Frame { header, image });
        while Arc::strong_count(&image) > 1 {
            assert!(started.elapsed() < Duration::from_secs(60), "the image is still held");
            std::thread::yield_now();
        }
    }
    assert_eq!(finished(recorder).count(Topic::Cam1Frame), 3 * MAX_HELD_IMAGES);
}

#[test]
fn held_content_is_recorded_as_if_it_were_copied() {
    let folder = Folder::new();
    let [copied, held] = ["copied.mcap", "held.mcap"].map(|name| start_recording(&folder, name));
    let (header, points) = (cloud(3), vec![7; 3 * RECORD_BYTES]);
    copied.push(&Recordable::Cloud { header: &header, records: &points });
    held.push_held(&header, points, |header, records| Recordable::Cloud { header, records });
    let image = frame_bytes(&frame(2, 5));
    copied.push(&Recordable::Frame { header: &frame(2, 5), image: &image });
    held.push_held(&frame(2, 5), image, |header, image| Recordable::Frame { header, image });
    let contents = |recorder| finished(recorder).messages().map(|m| format!("{:?}", m.unwrap())).collect::<Vec<_>>();
    assert_eq!(contents(copied), contents(held));
}

#[test]
fn contradictory_messages_are_counted_and_not_written() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    let good = frame(1, 0);
    let image = frame_bytes(&good);
    let narrow = FrameHeader { stride_bytes: 1, ..good };
    let colour = FrameHeader { pixel_format: 1, ..good };
    let third = FrameHeader { camera: 3, ..good };
    for header in [&narrow, &colour, &third] {
        recorder.push(&Recordable::Frame { header, image: &image });
    }
    recorder.push(&Recordable::Frame { header: &good, image: &image[1..] });
    recorder.push(&Recordable::Cloud { header: &cloud(2), records: &[0; RECORD_BYTES] });
    recorder.push(&Recordable::Cloud { header: &cloud(u64::MAX), records: &[] });
    let endless = Window { images: 25, ..window() };
    recorder.push(&Recordable::Maps { header: &MapsHeader { window: endless, ..maps() }, payload: &[] });
    recorder.push(&Recordable::Report(&StageReport { stage: 99, ..report() }));
    let recorded = recorder.finish().unwrap();
    assert_eq!(recorded.counts.malformed, 8);
    let total = recorded.counts.total();
    assert_eq!((total.taken, total.dropped(DropReason::Malformed), total.in_work()), (8, 8, Some(0)));
    assert_eq!(Recording::open(&recorded.file).unwrap().lost_messages(), Some(8));
}

#[test]
fn an_existing_file_is_refused_and_kept() {
    let folder = Folder::new();
    let origin = Origin::here();
    let path = folder.path("a.mcap");
    std::fs::write(&path, "mine").unwrap();
    let error = Recorder::create(&path, &opening(&origin), DEFAULT_QUEUE_BYTES).unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::Exists), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    let unfinished = folder.path("b.mcap.part");
    std::fs::write(&unfinished, "mine too").unwrap();
    let error = Recorder::create(&folder.path("b.mcap"), &opening(&origin), DEFAULT_QUEUE_BYTES).unwrap_err();
    assert_eq!(error.file, unfinished);
    assert_eq!(folder.names(), ["a.mcap", "b.mcap.part"]);
}

#[test]
fn a_disk_without_enough_free_space_is_refused() {
    let folder = Folder::new();
    let origin = Origin::here();
    let opening = Opening { min_free_bytes: u64::MAX, ..opening(&origin) };
    let error = Recorder::create(&folder.path("a.mcap"), &opening, DEFAULT_QUEUE_BYTES).unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::NoSpace { min_free_bytes: u64::MAX, .. }), "{error}");
    assert!(folder.names().is_empty());
}

#[test]
fn an_unfinished_recording_has_another_name() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    assert_eq!(folder.names(), ["a.mcap.part"]);
    let unfinished = problem(&folder.path("a.mcap.part"));
    assert!(matches!(unfinished, RecordingProblem::Unfinished { .. }), "{unfinished}");
    drop(recorder);
    assert_eq!(folder.names(), ["a.mcap"]);
    Recording::open(&folder.path("a.mcap")).unwrap();
}

#[test]
fn a_file_created_in_the_meantime_is_not_overwritten() {
    let folder = Folder::new();
    let origin = Origin::here();
    let path = folder.path("a.mcap");
    let recorder = Recorder::create(&path, &opening(&origin), DEFAULT_QUEUE_BYTES).unwrap();
    std::fs::write(&path, "mine").unwrap();
    let error = recorder.finish().unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::Unfinishable(_)), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    assert_eq!(folder.names(), ["a.mcap", "a.mcap.part"]);
}
