//! Times since 1970 in the file, and times of `CLOCK_MONOTONIC` for results.

use prost::Message as _;

use fringeflow::geometry::Pose;

use super::*;
use crate::convert::Convert;
use crate::recordable::Times;
use crate::schema::PatternEvent as PatternMessage;
use crate::writer::RecordingWriter;

/// A computer that was on for an hour on 14 November 2023.
const STARTED_NS: u64 = 3_600_000_000_000;
const STARTED_UNIX_NS: u64 = 1_700_000_000_000_000_000;

fn origin() -> Origin {
    Origin { started_ns: STARTED_NS, started_unix_ns: STARTED_UNIX_NS, ..Origin::default() }
}

/// Records a message of each kind of time, with time stamps shortly after the start, and returns the file.
fn recorded(folder: &Folder) -> Vec<u8> {
    let recorder = Recorder::create(&folder.path("a.mcap"), &opening(&origin()), DEFAULT_QUEUE_BYTES).unwrap();
    let header = header();
    recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
    let pose = TruthPose { exposure_start_ns: STARTED_NS + 7, cam1_from_object: Pose::identity() };
    recorder.push(&Recordable::TruthPose(&pose));
    recorder.push(&Recordable::Mark { time_ns: STARTED_NS + 9, text: "chin" });
    std::fs::read(recorder.finish().unwrap().file).unwrap()
}

fn header() -> FrameHeader {
    FrameHeader { exposure_start_ns: STARTED_NS + 5, received_ns: STARTED_NS + 20, ..frame(1, 3) }
}

#[test]
fn other_programs_see_times_since_1970() {
    let folder = Folder::new();
    let bytes = recorded(&folder);
    let mut times = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let timestamp = match message.channel.topic.as_str() {
            "/cam1/frame" => foxglove::messages::RawImage::decode(&*message.data).unwrap().timestamp,
            "/log" => foxglove::messages::Log::decode(&*message.data).unwrap().timestamp,
            "/truth/pose" => foxglove::messages::FrameTransform::decode(&*message.data).unwrap().timestamp,
            "/cam1/calibration" => foxglove::messages::CameraCalibration::decode(&*message.data).unwrap().timestamp,
            _ => None,
        };
        let since_ns = |unix_ns: u64| unix_ns - STARTED_UNIX_NS;
        let timestamp_ns =
            timestamp.map(|time| since_ns(u64::from(time.sec()) * 1_000_000_000 + u64::from(time.nsec())));
        let entry = (since_ns(message.log_time), since_ns(message.publish_time), timestamp_ns);
        times.insert(message.channel.topic.clone(), entry);
    }
    assert_eq!(times["/cam1/frame"], (20, 5, Some(5)));
    assert_eq!(times["/cam1/header"], (20, 5, None));
    assert_eq!(times["/truth/pose"], (7, 7, Some(7)));
    assert_eq!(times["/log"], (9, 9, Some(9)));
    assert_eq!(times["/cam1/calibration"], (0, 0, Some(0)));
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert!(
        summary.attachment_indexes.iter().all(|a| a.log_time == STARTED_UNIX_NS && a.create_time == STARTED_UNIX_NS)
    );
    let statistics = summary.stats.unwrap();
    assert_eq!([statistics.message_start_time, statistics.message_end_time], [STARTED_UNIX_NS, STARTED_UNIX_NS + 20]);
}

#[test]
fn fringeflow_reads_the_times_of_its_clock_and_a_recovery_keeps_them() {
    let folder = Folder::new();
    recorded(&folder);
    recover(&folder.path("a.mcap"), &folder.path("b.mcap"), 0).unwrap();
    for name in ["a.mcap", "b.mcap"] {
        let recording = Recording::open(&folder.path(name)).unwrap();
        let message = recording.messages_of(Topic::Cam1Frame).next().unwrap().unwrap();
        assert_eq!((message.log_ns, message.publish_ns), (STARTED_NS + 20, STARTED_NS + 5));
        assert!(matches!(message.content, Content::Frame(read, _) if read == header()));
        assert_eq!(recording.truth_poses().unwrap().all()[0].exposure_start_ns, STARTED_NS + 7);
        assert_eq!(recording.origin(), origin());
    }
}

/// Format 1 has the times of `CLOCK_MONOTONIC` in the file too.
#[test]
fn recordings_of_the_first_format_are_read_with_their_own_times() {
    let folder = Folder::new();
    let path = folder.path("old.mcap");
    let mut writer = RecordingWriter::create_empty(&path, UNFINISHED, 0).unwrap();
    let mut metadata = origin().metadata(setup());
    metadata.insert("format".to_owned(), "1".to_owned());
    writer.metadata(METADATA, &metadata).unwrap();
    let text = &setup().text;
    for (name, text) in [("calibration.yml", &text.calibration), ("meta.json", &text.description)] {
        writer.attach(name, "", text.as_bytes(), 0).unwrap();
    }
    writer.attach(CONFIGURATION_FILE, "", b"", 0).unwrap();
    let times = Times { log_ns: STARTED_NS + 20, publish_ns: STARTED_NS + 5 };
    let event: PatternMessage = Convert::from_struct(&pattern()).unwrap();
    writer.write_one(Topic::Pattern, times, &event.encode_to_vec()).unwrap();
    writer.finish(&std::collections::BTreeMap::new()).unwrap();
    let recording = Recording::open(&path).unwrap();
    let message = recording.messages().next().unwrap().unwrap();
    assert_eq!((message.log_ns, message.publish_ns), (STARTED_NS + 20, STARTED_NS + 5));
}
