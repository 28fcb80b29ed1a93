//! Recordings as other programs rewrite them, and recordings of other programs.

use std::io::{Cursor, Write as _};

use mcap::records::op;
use mcap::{MAGIC, WriteOptions};

use super::recovery::{PAIRS, chunked_recording, count_images, recovered};
use super::*;
use crate::fields::Fields;

/// A record: its code and its content.
type Record = (u8, Vec<u8>);

/// Returns the records of the data of a file without compression, in their order, without chunks and indexes.
fn data_records(bytes: &[u8]) -> Vec<Record> {
    let mut found = Vec::new();
    collect_records(&bytes[MAGIC.len()..], &mut found);
    found
}

fn collect_records(bytes: &[u8], found: &mut Vec<Record>) {
    let mut fields = Fields(bytes);
    while let Some(opcode) = fields.u8() {
        let length = fields.length().unwrap();
        let body = fields.bytes(length).unwrap();
        match opcode {
            op::DATA_END => return,
            op::CHUNK => collect_records(&body[40..], found),
            op::HEADER | op::MESSAGE_INDEX => {}
            _ => found.push((opcode, body.to_vec())),
        }
    }
}

fn record((opcode, body): &Record) -> Vec<u8> {
    [&[*opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn packed(compression: &str, records: &[u8]) -> Vec<u8> {
    match compression {
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(records).unwrap();
            encoder.finish().unwrap()
        }
        "zstd" => ruzstd::encoding::compress_to_vec(records, ruzstd::encoding::CompressionLevel::Fastest),
        _ => records.to_vec(),
    }
}

/// A chunk of these packed records that states `unpacked` bytes.
fn chunk(compression: &str, packed: &[u8], unpacked: u64, crc: u32) -> Vec<u8> {
    let head = [&[0; 16][..], &unpacked.to_le_bytes(), &crc.to_le_bytes(), &text(compression)].concat();
    record(&(op::CHUNK, [&head[..], &(packed.len() as u64).to_le_bytes(), packed].concat()))
}

fn packed_chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    chunk(compression, &packed(compression, records), records.len() as u64, crc32fast::hash(records))
}

/// A file of these parts of data, with no more after them than MCAP demands.
fn bare_file(profile: &str, parts: &[Vec<u8>]) -> Vec<u8> {
    let header = record(&(op::HEADER, [text(profile), text("other writer")].concat()));
    let end = [record(&(op::DATA_END, vec![0; 4])), record(&(op::FOOTER, vec![0; 20]))].concat();
    [MAGIC, &header, &parts.concat(), &end, MAGIC].concat()
}

/// Rewrites a recording with its records in chunks of `per_chunk`.
fn rewritten(records: &[Record], per_chunk: usize, compression: &str) -> Vec<u8> {
    bare_file("", &bare_parts(records, per_chunk, compression))
}

/// The parts of a file with the records in chunks of `per_chunk`.
fn bare_parts(records: &[Record], per_chunk: usize, compression: &str) -> Vec<Vec<u8>> {
    let is_chunked = |record: &Record| !matches!(record.0, op::ATTACHMENT | op::METADATA);
    let runs = records.chunk_by(|a, b| is_chunked(a) == is_chunked(b));
    let parts = runs.flat_map(|run| {
        let pieces: Vec<Vec<u8>> =
            run.chunks(per_chunk).map(|piece| piece.iter().map(record).collect::<Vec<_>>().concat()).collect();
        let is_chunked = is_chunked(&run[0]);
        pieces.into_iter().map(move |piece| if is_chunked { packed_chunk(compression, &piece) } else { piece })
    });
    parts.collect()
}

fn opened(folder: &Folder, bytes: &[u8]) -> Result<Recording, RecordingError> {
    let path = folder.path("rewritten.mcap");
    std::fs::write(&path, bytes).unwrap();
    Recording::open(&path)
}

fn is_whole(recording: &Recording) -> bool {
    count_images(recording) == 2 * PAIRS as usize && !recording.losses().unwrap().is_loss()
}

/// A recording of images, and its records.
fn base(folder: &Folder) -> (Vec<u8>, Vec<Record>) {
    let bytes = chunked_recording(folder);
    let records = data_records(&bytes);
    (bytes, records)
}

#[test]
fn compressed_chunks_are_read_and_recovered() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    for compression in ["", "lz4", "zstd"] {
        for per_chunk in [1, 7, records.len()] {
            let bytes = rewritten(&records, per_chunk, compression);
            assert!(is_whole(&opened(&folder, &bytes).unwrap()), "{compression} {per_chunk}");
            let (report, recording) = recovered(&folder, &bytes).unwrap();
            assert!(report.loss().is_none() && is_whole(&recording.unwrap()), "{compression} {per_chunk}: {report:?}");
        }
    }
}

#[test]
fn everything_that_mcap_leaves_to_its_writer_may_be_missing() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    let options: [fn(WriteOptions) -> WriteOptions; 9] = [
        |options| options,
        |options| options.emit_statistics(false),
        |options| options.emit_summary_offsets(false),
        |options| options.emit_summary_records(false).emit_summary_offsets(false),
        |options| options.emit_message_indexes(false).emit_chunk_indexes(false),
        |options| options.repeat_channels(false).repeat_schemas(false),
        |options| options.use_chunks(false),
        |options| options.calculate_data_section_crc(false).calculate_summary_section_crc(false),
        // Without the checksums of chunks, the crate states a wrong one of the data.
        |options| {
            let options = options.calculate_chunk_crcs(false).calculate_attachment_crcs(false);
            options.calculate_data_section_crc(false)
        },
    ];
    for (number, change) in options.into_iter().enumerate() {
        let bytes = by_crate(&records, change(WriteOptions::new().compression(None)));
        assert!(is_whole(&opened(&folder, &bytes).unwrap()), "options {number}");
        let (report, recording) = recovered(&folder, &bytes).unwrap();
        assert!(report.loss().is_none() && is_whole(&recording.unwrap()), "options {number}: {report:?}");
    }
}

/// Writes the records with the crate `mcap`, which numbers schemas anew, and the channels from 40 on.
fn by_crate(records: &[Record], options: WriteOptions) -> Vec<u8> {
    let mut out = Vec::new();
    let mut writer = options.create(Cursor::new(&mut out)).unwrap();
    let mut schemas = std::collections::BTreeMap::new();
    for (opcode, body) in records {
        match mcap::parse_record(*opcode, body).unwrap() {
            mcap::records::Record::Schema { header, data } => {
                schemas.insert(header.id, writer.add_schema(&header.name, &header.encoding, &data).unwrap());
            }
            mcap::records::Record::Channel(channel) => {
                let (id, schema) = (channel.id + 40, schemas[&channel.schema_id]);
                writer.add_channel_with_id(id, schema, &channel.topic, "protobuf", &channel.metadata).unwrap();
            }
            mcap::records::Record::Message { header, data } => {
                let header = mcap::records::MessageHeader { channel_id: header.channel_id + 40, ..header };
                writer.write_to_known_channel(&header, &data).unwrap();
            }
            mcap::records::Record::Attachment { header, data, .. } => {
                let mcap::records::AttachmentHeader { log_time, create_time, name, media_type } = header;
                writer.attach(&mcap::Attachment { log_time, create_time, name, media_type, data }).unwrap();
            }
            mcap::records::Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            _ => panic!("a record of code {opcode}"),
        }
    }
    writer.finish().unwrap();
    drop(writer);
    out
}

#[test]
fn the_order_of_records_and_repetitions_do_not_matter() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    let (mut messages, mut others): (Vec<Record>, Vec<Record>) =
        records.into_iter().partition(|(opcode, _)| *opcode == op::MESSAGE);
    messages.reverse();
    // Attachments and metadata before, between and after the messages; channels that are repeated, and without schema.
    let reversed = [others.clone(), messages.clone()].concat();
    others.sort_by_key(|(opcode, _)| matches!(*opcode, op::ATTACHMENT | op::METADATA));
    let last = others.iter().position(|(opcode, _)| *opcode == op::ATTACHMENT || *opcode == op::METADATA).unwrap();
    let (channels, attachments) = others.split_at(last);
    let after = [channels, &messages, channels, attachments].concat();
    let without_schemas = [
        channels.iter().filter(|(opcode, _)| *opcode == op::CHANNEL).cloned().map(without_schema).collect(),
        messages.clone(),
        attachments.to_vec(),
    ]
    .concat();
    let twice = [channels, &messages, &messages, attachments].concat();
    let pairs = opened(&folder, &rewritten(&twice, 5, "")).unwrap().pairs().unwrap();
    assert_eq!(pairs.len(), PAIRS as usize);
    for records in [reversed, after, without_schemas] {
        for compression in ["", "zstd"] {
            let bytes = rewritten(&records, 5, compression);
            assert!(is_whole(&opened(&folder, &bytes).unwrap()));
            let (report, recording) = recovered(&folder, &bytes).unwrap();
            assert!(report.loss().is_none() && is_whole(&recording.unwrap()), "{report:?}");
        }
    }
}

fn without_schema((opcode, mut body): Record) -> Record {
    body[2..4].fill(0);
    (opcode, body)
}

#[test]
fn a_damaged_compressed_chunk_affects_no_other() {
    let folder = Folder::new();
    let (_, mut records) = base(&folder);
    records.sort_by_key(|(opcode, _)| *opcode == op::MESSAGE);
    let first_message = records.iter().position(|(opcode, _)| *opcode == op::MESSAGE).unwrap();
    for compression in ["lz4", "zstd"] {
        // The channels have a chunk of their own before those of the messages.
        let channels = bare_parts(&records[..first_message], 5, compression);
        let messages = bare_parts(&records[first_message..], 5, compression);
        let first = bare_file("", &channels).len();
        let whole = bare_file("", &[channels, messages].concat());
        let mut harmed = 0;
        for position in (first..whole.len() - 60).step_by(61) {
            let mut bytes = whole.clone();
            bytes[position] ^= 0x55;
            if let Ok(recording) = opened(&folder, &bytes) {
                // Only the stated times of a chunk have no checksum.
                assert!(is_whole(&recording), "{compression} {position}");
                continue;
            }
            let (report, recording) = recovered(&folder, &bytes).unwrap();
            let images = count_images(&recording.unwrap());
            assert!(
                images >= 2 * PAIRS as usize - 4 && report.loss().is_some(),
                "{compression} {position}: {report:?}"
            );
            harmed += 1;
        }
        assert!(harmed > 10);
    }
}

#[test]
fn a_file_cut_in_a_compressed_chunk_keeps_the_chunks_before() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    // The attachments come first, so that the recording can be opened.
    let mut records = records;
    records.sort_by_key(|(opcode, _)| !matches!(*opcode, op::ATTACHMENT | op::METADATA));
    for compression in ["lz4", "zstd"] {
        let bytes = rewritten(&records, 5, compression);
        let cut = &bytes[..bytes.len() * 9 / 10];
        let error = opened(&folder, cut).unwrap_err();
        assert!(matches!(error.problem, RecordingProblem::Unfinished { .. }), "{error}");
        let (report, recording) = recovered(&folder, cut).unwrap();
        let images = count_images(&recording.unwrap());
        assert!(images > 2 && images < 2 * PAIRS as usize, "{images}");
        assert!(report.loss().is_some() && report.faults.len() == 1, "{report:?}");
    }
}

#[test]
fn no_chunk_takes_more_memory_than_it_may() {
    let folder = Folder::new();
    let zeros = vec![0; 1 << 20];
    for compression in ["lz4", "zstd"] {
        let packed = packed(compression, &zeros);
        assert!(packed.len() < zeros.len() / 50);
        // A chunk that states too much, one that holds more than it states, and one that holds less.
        let stated = [
            (1_u64 << 40, "may have at most 268435456"),
            (1000, "states 1000 bytes of records, but has 1001"),
            (2 << 20, "states 2097152 bytes of records, but has 1048576"),
        ];
        for (bytes, says) in stated {
            let file = bare_file("", &[chunk(compression, &packed, bytes, 0)]);
            let message = opened(&folder, &file).unwrap_err().to_string();
            assert!(message.contains("damaged at byte") && message.contains(says), "{message}");
        }
        let wrong = bare_file("", &[chunk(compression, b"neither of both", 1000, 0)]);
        let message = opened(&folder, &wrong).unwrap_err().to_string();
        assert!(message.contains(&format!("cannot be unpacked ({compression})")), "{message}");
    }
}

#[test]
fn empty_chunks_are_skipped_and_an_unknown_compression_is_named() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    let whole = rewritten(&records, 9, "zstd");
    let first = MAGIC.len() + record(&(op::HEADER, [text(""), text("other writer")].concat())).len();
    let empty = [chunk("", &[], 0, 0), chunk("lz4", &[], 0, 0), chunk("zstd", &[], 0, 0), packed_chunk("zstd", &[])];
    let with_empty = [&whole[..first], &empty.concat(), &whole[first..]].concat();
    assert!(is_whole(&opened(&folder, &with_empty).unwrap()));
    let unknown = [&whole[..first], &chunk("brotli", b"abc", 3, 0), &whole[first..]].concat();
    let error = opened(&folder, &unknown).unwrap_err();
    assert!(matches!(&error.problem, RecordingProblem::Compressed { compression, .. } if compression == "brotli"));
    assert!(error.to_string().contains("lz4 and zstd"), "{error}");
    // Everything else is recovered.
    let (report, recording) = recovered(&folder, &unknown).unwrap();
    assert!(report.has_data_fault && count_images(&recording.unwrap()) == 2 * PAIRS as usize);
}

#[test]
fn only_the_first_of_two_joined_recordings_is_recovered() {
    let folder = Folder::new();
    let (bytes, _) = base(&folder);
    let joined = [bytes.clone(), bytes].concat();
    let message = opened(&folder, &joined).unwrap_err().to_string();
    assert!(message.contains("another MCAP file follow it"), "{message}");
    let (report, recording) = recovered(&folder, &joined).unwrap();
    assert!(is_whole(&recording.unwrap()));
    assert_eq!(report.faults.len(), 1, "{report:?}");
    assert_eq!(report.loss().as_deref(), Some("what was at the faults is lost"));
}

#[test]
fn messages_of_other_programs_are_counted_and_not_read() {
    let folder = Folder::new();
    let (_, mut records) = base(&folder);
    // Another program may use the same names for other messages.
    for (id, topic, schema, encoding) in
        [(90, "/tf", "", "cdr"), (91, "/cam1/header", "Other", "protobuf"), (92, "/imu", "", "json")]
    {
        let schema_id: u16 = if schema.is_empty() { 0 } else { 90 };
        let name = [&schema_id.to_le_bytes()[..], &text(schema), &text("protobuf"), &[0; 4]].concat();
        let channel =
            [&u16::to_le_bytes(id)[..], &schema_id.to_le_bytes(), &text(topic), &text(encoding), &[0; 4]].concat();
        let message = [&u16::to_le_bytes(id)[..], &[0; 20], b"abc"].concat();
        records.extend(
            [(op::SCHEMA, name), (op::CHANNEL, channel), (op::MESSAGE, message)]
                .into_iter()
                .filter(|(opcode, body)| *opcode != op::SCHEMA || body[..2] != [0, 0]),
        );
    }
    let bytes = rewritten(&records, 7, "lz4");
    let recording = opened(&folder, &bytes).unwrap();
    assert!(is_whole(&recording));
    assert_eq!(recording.foreign_messages().clone().into_keys().collect::<Vec<_>>(), ["/cam1/header", "/imu", "/tf"]);
    let (report, _) = recovered(&folder, &bytes).unwrap();
    assert!(report.foreign.len() == 3 && report.loss().is_some());
}

#[test]
fn a_recording_of_another_program_is_named_and_not_called_damaged() {
    let folder = Folder::new();
    let schema = [&1_u16.to_le_bytes()[..], &text("sensor_msgs/msg/Image"), &text("ros2msg"), &[0; 4]].concat();
    let channel = [&[1, 0, 1, 0][..], &text("/left/image_raw"), &text("cdr"), &[0; 4]].concat();
    let message = [&[1, 0][..], &[0; 20], b"abc"].concat();
    let records: Vec<u8> =
        [(op::SCHEMA, schema), (op::CHANNEL, channel), (op::MESSAGE, message)].iter().flat_map(record).collect();
    let bag = bare_file("ros2", &[packed_chunk("zstd", &records)]);
    let target = folder.path("saved.mcap");
    for (bytes, says) in [
        (&bag, "its channels are /left/image_raw (sensor_msgs/msg/Image, cdr)"),
        (&bare_file("", &[]), "its channels are none"),
    ] {
        let error = opened(&folder, bytes).unwrap_err();
        assert!(
            matches!(error.problem, RecordingProblem::OtherProgram { .. }) && !error.problem.is_damage(),
            "{error}"
        );
        let text = error.to_string();
        assert!(text.contains("is a recording of another program (other writer)") && text.contains(says), "{text}");
        let error = recover(&folder.path("rewritten.mcap"), &target, 0).unwrap_err();
        assert!(matches!(error.problem, RecordingProblem::OtherProgram { .. }), "{error}");
        assert_eq!(folder.names(), ["rewritten.mcap"]);
    }
    // Cut in its only chunk: nothing tells what it was.
    std::fs::write(folder.path("rewritten.mcap"), &bag[..bag.len() - 60]).unwrap();
    let error = recover(&folder.path("rewritten.mcap"), &target, 0).unwrap_err();
    assert!(matches!(error.problem, RecordingProblem::NothingReadable(_)), "{error}");
    assert_eq!(folder.names(), ["rewritten.mcap"]);
}

#[test]
fn a_recording_without_its_metadata_lacks_them() {
    let folder = Folder::new();
    let (_, records) = base(&folder);
    let without = |code: u8| -> Vec<Record> { records.iter().filter(|(opcode, _)| *opcode != code).cloned().collect() };
    let problem = |records: &[Record]| opened(&folder, &rewritten(records, 9, "lz4")).unwrap_err().problem;
    assert!(matches!(problem(&without(op::METADATA)), RecordingProblem::Missing { what: "metadata fringeflow" }));
    assert!(matches!(
        problem(&without(op::ATTACHMENT)),
        RecordingProblem::Missing { what: "attachment calibration.yml" }
    ));
}
