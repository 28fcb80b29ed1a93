//! Recovery keeps exactly the data with a correct checksum, after a killed recorder or a damaged disk.

use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::recordable::Encoded;
use crate::writer::RecordingWriter;

/// Number of image pairs of the recording; each pair has its own chunk.
pub(super) const PAIRS: u64 = 6;

pub(super) fn chunked_recording(folder: &Folder) -> Vec<u8> {
    let path = folder.path("whole.mcap");
    let mut writer = RecordingWriter::create(&path, &opening(&Origin::default())).unwrap();
    let mut counts = RecorderCounts::default();
    for sequence in 0..PAIRS {
        for camera in [1, 2] {
            let topic = write_image(&mut writer, &frame(camera, sequence));
            counts.for_topic(topic).taken += 1;
            counts.for_topic(topic).passed += 1;
        }
        writer.flush().unwrap();
    }
    writer.finish(&counts.metadata("end")).unwrap();
    std::fs::read(path).unwrap()
}

fn write_image(writer: &mut RecordingWriter, header: &FrameHeader) -> Topic {
    let image = frame_bytes(header);
    let message = Recordable::Frame { header, image: &image };
    let mut encoded = Encoded::default();
    message.encode(WallClock::default(), &mut encoded);
    let topic = message.topic().unwrap();
    writer.write(topic, message.times(), &encoded).unwrap();
    topic
}

/// Recovers a file of these bytes; `None` if that fails.
pub(super) fn recovered(folder: &Folder, bytes: &[u8]) -> Option<(Recovered, Result<Recording, RecordingError>)> {
    let (damaged, target) = (folder.path("damaged.mcap"), folder.path("saved.mcap"));
    std::fs::write(&damaged, bytes).unwrap();
    let _ = std::fs::remove_file(&target);
    let recovered = recover(&damaged, &target, 0).ok()?;
    Some((recovered, Recording::open(&target)))
}

/// Returns the number of images. Asserts that each of them is as recorded.
pub(super) fn count_images(recording: &Recording) -> usize {
    let mut count = 0;
    for topic in [Topic::Cam1Frame, Topic::Cam2Frame] {
        for message in recording.messages_of(topic) {
            let Content::Frame(header, bytes) = message.unwrap().content else { panic!("the message is not an image") };
            assert_eq!(header, frame(header.camera, header.sequence));
            assert!(bytes == frame_bytes(&header));
            count += 1;
        }
    }
    count
}

#[test]
fn an_intact_file_is_recovered_completely() {
    let folder = Folder::new();
    let bytes = chunked_recording(&folder);
    let (report, recording) = recovered(&folder, &bytes).unwrap();
    assert_eq!((report.faults.len(), report.left_out, report.missing.len()), (0, 0, 0));
    assert!(report.loss().is_none());
    let recording = recording.unwrap();
    assert_eq!(count_images(&recording), 2 * PAIRS as usize);
    assert_eq!(*recording.setup(), *setup());
    assert_eq!((recording.lost_messages(), recording.recorder_account()["ended"].as_str()), (Some(0), "recovered"));
}

#[test]
fn every_complete_chunk_of_a_truncated_file_is_recovered() {
    let folder = Folder::new();
    let bytes = chunked_recording(&folder);
    let mut saved_before = 0;
    for end in (0..=bytes.len()).step_by(997) {
        let Some((report, recording)) = recovered(&folder, &bytes[..end]) else {
            assert_eq!(saved_before, 0, "truncated at {end}");
            continue;
        };
        assert_eq!(report.faults.len(), 1, "truncated at {end}");
        assert!(report.faults[0].contains("the file ends at byte"), "{}", report.faults[0]);
        let Ok(recording) = recording else {
            assert!(!report.missing.is_empty(), "truncated at {end}");
            continue;
        };
        let saved = count_images(&recording);
        assert!(saved >= saved_before && saved.is_multiple_of(2), "truncated at {end}: {saved} images");
        saved_before = saved;
    }
    assert_eq!(saved_before, 2 * PAIRS as usize);
}

#[test]
fn a_damaged_chunk_affects_no_other_chunk() {
    let folder = Folder::new();
    let bytes = chunked_recording(&folder);
    let chunk = find(&bytes, &frame_bytes(&frame(1, 2))) - 400;
    // First in its data, then in its opcode and its length.
    let (report, recording) = recovered(&folder, &flipped(&bytes, chunk + 600)).unwrap();
    let recording = recording.unwrap();
    assert_eq!(count_images(&recording), 2 * (PAIRS - 1) as usize);
    assert_eq!((report.faults.len(), recording.lost_messages()), (1, Some(2)), "{:?}", report.faults);
    assert_eq!(recording.recorder_account()["lost.damaged/cam1/frame"], "1");
    assert_eq!(report.losses, Some(recording.losses().unwrap()));
    assert_eq!(report.losses.unwrap().missing_images, [1, 1]);
    let head = chunk_head(&bytes, chunk);
    for position in [head, head + 1, head + 5, head + 8] {
        let (report, recording) = recovered(&folder, &flipped(&bytes, position)).unwrap();
        assert_eq!(count_images(&recording.unwrap()), 2 * (PAIRS - 1) as usize, "byte {position}");
        assert!(!report.faults.is_empty());
    }
}

fn find(bytes: &[u8], part: &[u8]) -> usize {
    bytes.windows(part.len()).position(|window| window == part).unwrap()
}

fn flipped(bytes: &[u8], position: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[position] ^= 0x40;
    bytes
}

/// Returns the start of the last chunk record before a position: opcode 6, a consistent length, and no compression.
fn chunk_head(bytes: &[u8], before: usize) -> usize {
    let is_head = |start: &usize| {
        let length = u64::from_le_bytes(bytes[start + 1..start + 9].try_into().unwrap());
        let records = u64::from_le_bytes(bytes[start + 25..start + 33].try_into().unwrap());
        bytes[*start] == 6 && length == records + 40
    };
    (0..before + 400).rev().find(is_head).unwrap()
}

#[test]
fn altered_data_is_never_recovered_and_no_file_causes_a_panic() {
    let folder = Folder::new();
    let bytes = chunked_recording(&folder);
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for round in 0..200 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + round % 4 {
            let position = random.random_range(0..damaged.len());
            damaged[position] ^= random.random_range(1..=255);
        }
        if round % 3 == 0 {
            damaged.truncate(random.random_range(0..damaged.len()));
        }
        let Some((report, recording)) = recovered(&folder, &damaged) else { continue };
        match recording {
            Ok(recording) => drop(count_images(&recording)),
            Err(error) => assert!(!report.missing.is_empty(), "{error}; {report:?}"),
        }
    }
}

#[test]
fn flushed_messages_of_a_killed_recorder_are_recovered() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    for sequence in 0..PAIRS {
        for camera in [1, 2] {
            let header = frame(camera, sequence);
            recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
        }
    }
    let started = Instant::now();
    while recorder.counts().total().in_work() != Some(0) {
        assert!(started.elapsed() < Duration::from_secs(60), "nothing was flushed");
        std::thread::sleep(Duration::from_millis(10));
    }
    // A kill would leave the file as it is now.
    let left = std::fs::read(folder.path("a.mcap.part")).unwrap();
    let (report, recording) = recovered(&folder, &left).unwrap();
    let recording = recording.unwrap();
    assert_eq!(count_images(&recording), 2 * PAIRS as usize);
    assert_eq!((report.left_out, recording.lost_messages()), (0, None));
    assert!(recording.losses().unwrap().is_loss());
}

#[test]
fn a_kill_loses_only_what_was_written_after_the_last_flush() {
    let folder = Folder::new();
    let mut writer = RecordingWriter::create(&folder.path("a.mcap"), &opening(&Origin::default())).unwrap();
    let saved = || {
        let left = std::fs::read(folder.path("a.mcap.part")).unwrap();
        let (report, recording) = recovered(&folder, &left).unwrap();
        // Nothing is missing but the end of the file.
        assert_eq!((report.faults.len(), report.left_out), (1, 0), "{:?}", report.faults);
        assert!(report.faults[0].contains("after a complete record"), "{:?}", report.faults);
        count_images(&recording.unwrap())
    };
    for sequence in 0..2 * PAIRS {
        write_image(&mut writer, &frame(1, sequence));
        assert_eq!(saved(), sequence as usize);
        writer.flush().unwrap();
        assert_eq!(saved(), sequence as usize + 1);
    }
}

#[test]
fn an_unfinished_file_can_be_recovered_to_its_final_name() {
    let folder = Folder::new();
    let bytes = chunked_recording(&folder);
    let left = folder.path("scan.mcap.part");
    std::fs::write(&left, &bytes[..bytes.len() / 2]).unwrap();
    recover(&left, &folder.path("scan.mcap"), 0).unwrap();
    assert_eq!(folder.names(), ["scan.mcap", "scan.mcap.part", "whole.mcap"]);
    let error = recover(&left, &folder.path("scan.mcap"), 0).unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::Exists), "{error}");
}
