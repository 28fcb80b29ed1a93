//! Truncated, damaged and forged files.

use std::collections::BTreeMap;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::cloud::RECORD_BYTES;

use crate::convert::Convert;
use crate::recordable::Times;
use crate::schema;
use crate::writer::RecordingWriter;

use super::*;

fn small_recording(folder: &Folder) -> Vec<u8> {
    let recorder = start_recording(folder, "small.mcap");
    for sequence in 0..3 {
        for camera in [1, 2] {
            let header = frame(camera, sequence);
            recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
        }
        recorder.push(&Recordable::Report(&report()));
    }
    recorder.push(&Recordable::Cloud { header: &cloud(3), records: &[0; 3 * RECORD_BYTES] });
    recorder.push(&Recordable::Mark { time_ns: 1, text: "here" });
    std::fs::read(recorder.finish().unwrap().file).unwrap()
}

/// Opens a file and reads everything in it. Returns `true` if there was no error.
fn read_through(path: &Path) -> bool {
    Recording::open(path).is_ok_and(|recording| recording.messages().all(|message| message.is_ok()))
}

#[test]
fn a_changed_byte_is_found_at_any_position() {
    let folder = Folder::new();
    let intact = small_recording(&folder);
    let path = folder.path("flipped.mcap");
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for round in 0..600 {
        let mut bytes = intact.clone();
        let positions: Vec<usize> = (0..1 + round % 4).map(|_| random.random_range(0..bytes.len())).collect();
        positions.iter().for_each(|&position| bytes[position] ^= random.random_range(1..=255));
        std::fs::write(&path, &bytes).unwrap();
        assert!(bytes == intact || !read_through(&path), "changes at {positions:?} were not noticed");
    }
}

#[test]
fn a_file_truncated_at_any_position_is_unfinished() {
    let folder = Folder::new();
    let intact = small_recording(&folder);
    let path = folder.path("cut.mcap");
    for end in (0..intact.len()).step_by(997) {
        std::fs::write(&path, &intact[..end]).unwrap();
        let problem = problem(&path);
        let is_as_expected = match problem {
            RecordingProblem::NotMcap { .. } => end == 0,
            RecordingProblem::Unfinished { offset, .. } => offset == end as u64,
            _ => false,
        };
        assert!(is_as_expected, "truncated at {end}: {problem}");
    }
    std::fs::write(&path, [intact.as_slice(), b"more"].concat()).unwrap();
    assert!(matches!(problem(&path), RecordingProblem::Damaged { .. }));
}

/// A recording with unusual content.
fn recording_of(folder: &Folder, make: impl FnOnce(&mut RecordingWriter)) -> PathBuf {
    let path = folder.path("made.mcap");
    let mut writer = RecordingWriter::create_empty(&path, UNFINISHED, 0).unwrap();
    make(&mut writer);
    writer.finish(&BTreeMap::new()).unwrap()
}

fn format(version: &str) -> BTreeMap<String, String> {
    [("format", version), ("version", "9.9.9")].map(|(key, value)| (key.to_owned(), value.to_owned())).into()
}

#[test]
fn a_newer_format_is_refused_first() {
    let folder = Folder::new();
    let path = recording_of(&folder, |writer| writer.metadata(METADATA, &format("3")).unwrap());
    let message = Recording::open(&path).unwrap_err().to_string();
    assert!(message.contains("format version 3") && message.contains("9.9.9"), "{message}");
    assert!(message.contains("update fringeflow"), "{message}");
    let error = recover(&path, &folder.path("saved.mcap"), 0).unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::NewerFormat { found: 3, .. }), "{error}");
    assert_eq!(folder.names(), ["made.mcap"]);
}

#[test]
fn missing_parts_are_reported() {
    let folder = Folder::new();
    let path = recording_of(&folder, |_| ());
    assert!(matches!(problem(&path), RecordingProblem::Missing { what: "metadata fringeflow" }));
    std::fs::remove_file(&path).unwrap();
    let path = recording_of(&folder, |writer| writer.metadata(METADATA, &format("1")).unwrap());
    assert!(matches!(problem(&path), RecordingProblem::Missing { what: "attachment calibration.yml" }));
}

#[test]
fn an_invalid_calibration_is_reported_with_its_field() {
    let folder = Folder::new();
    let text = &setup().text;
    let path = recording_of(&folder, |writer| {
        writer.metadata(METADATA, &format("1")).unwrap();
        writer.attach("calibration.yml", "", text.calibration.replace("K1", "K9").as_bytes(), 0).unwrap();
        writer.attach("meta.json", "", text.description.as_bytes(), 0).unwrap();
        writer.attach("configuration.toml", "", b"", 0).unwrap();
    });
    let message = Recording::open(&path).unwrap_err().to_string();
    assert!(message.contains("attachment calibration.yml") && message.contains("K1"), "{message}");
}

#[test]
fn headers_without_messages_are_reported() {
    let folder = Folder::new();
    let write = |writer: &mut RecordingWriter, topic, data: &[u8]| {
        writer.metadata(METADATA, &format("1")).unwrap();
        writer.write_one(topic, Times { log_ns: 0, publish_ns: 0 }, data).unwrap();
    };
    let lonely = [(Topic::Cam1Frame, "its header is missing"), (Topic::Cam2Header, "camera is 0; expected 2")];
    for (topic, says) in lonely {
        let path = recording_of(&folder, |writer| write(writer, topic, &[]));
        let message = Recording::open(&path).unwrap_err().to_string();
        assert!(message.contains(says) && message.contains(topic.name()), "{message}");
        std::fs::remove_file(&path).unwrap();
    }
    let header = schema::FrameHeader::from_struct(&frame(2, 0)).unwrap();
    let path =
        recording_of(&folder, |writer| write(writer, Topic::Cam2Header, &prost::Message::encode_to_vec(&header)));
    let message = Recording::open(&path).unwrap_err().to_string();
    assert!(message.contains("the message that it describes is missing"), "{message}");
}

#[test]
fn too_long_records_are_refused_without_allocation() {
    let folder = Folder::new();
    let intact = small_recording(&folder);
    let path = folder.path("claims.mcap");
    // Lengths of the first record after the header, from the size of the file to the maximum.
    let first = 8 + 9 + u64::from_le_bytes(intact[9..17].try_into().unwrap()) as usize;
    for claim in [intact.len() as u64, 1 << 31, 1 << 40, u64::MAX - 8, u64::MAX] {
        let mut bytes = intact.clone();
        bytes[first + 1..first + 9].copy_from_slice(&claim.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        assert!(matches!(problem(&path), RecordingProblem::Unfinished { .. }), "{claim}");
    }
    // A sparse file that is long enough for the stated length.
    let mut bytes = intact;
    bytes[first + 1..first + 9].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(1 << 41).unwrap();
    assert!(matches!(problem(&path), RecordingProblem::Damaged { .. }));
}

#[test]
fn other_files_are_not_recordings() {
    let folder = Folder::new();
    let path = folder.path("text.mcap");
    let files = [
        (&b""[..], "empty"),
        (b"hello\n", "a text"),
        (b"ply\nformat", "a PLY file"),
        (b"\x1f\x8b\x08\0", "a gzip file; unpack it first"),
        (b"\x28\xb5\x2f\xfd\0", "a zstd file; unpack it first"),
        (b"#ROSBAG V2.0\n", "a ROS 1 bag"),
        (&[0; 64], "begins with zeros"),
    ];
    for (bytes, kind) in files {
        std::fs::write(&path, bytes).unwrap();
        let message = Recording::open(&path).unwrap_err().to_string();
        assert!(message.contains("is not an MCAP file, but") && message.contains(kind), "{message}");
        let error = recover(&path, &folder.path("saved.mcap"), 0).unwrap_err();
        assert!(matches!(error.problem, RecordingProblem::NotMcap { .. }), "{error}");
        assert_eq!(folder.names(), ["text.mcap"]);
    }
    assert!(matches!(problem(&folder.path("nowhere.mcap")), RecordingProblem::Unreadable(_)));
    assert!(matches!(
        problem(folder.folder.path()),
        RecordingProblem::Unreadable(_) | RecordingProblem::NotMcap { .. }
    ));
}
