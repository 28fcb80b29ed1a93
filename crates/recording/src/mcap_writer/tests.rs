//! The `mcap` crate is the reference: the same messages must give the same file, byte for byte.

use std::io::Cursor;
use std::sync::Arc;

use mcap::WriteOptions;
use tempfile::NamedTempFile;

use super::*;
use crate::block_writer::open_direct;

/// A step of writing a file.
enum Step {
    Channel(u16, &'static str, Option<&'static str>),
    Message(u16, u64, usize),
    /// Two messages, each with its content in two parts.
    Pair([u16; 2], u64, [usize; 2]),
    Attachment(&'static str, usize),
    Metadata(&'static str),
    Flush,
}

use Step::{Attachment as Attach, Channel, Flush, Message, Metadata, Pair};

fn content(bytes: usize, seed: u64) -> Vec<u8> {
    (0..bytes as u64).map(|i| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 7) as u8).collect()
}

fn header(channel_id: u16, time_ns: u64) -> MessageHeader {
    MessageHeader { channel_id, sequence: time_ns as u32 + 3, log_time: time_ns, publish_time: time_ns / 2 }
}

fn entries() -> BTreeMap<String, String> {
    BTreeMap::from([("a".to_owned(), "ö".to_owned()), ("b".to_owned(), String::new())])
}

fn written_by_crate(steps: &[Step]) -> Vec<u8> {
    let mut out = Vec::new();
    let options = WriteOptions::new().compression(None).chunk_size(Some(CHUNK_BYTES)).disable_seeking(true);
    let mut writer = options.profile("p").library("l").create(Cursor::new(&mut out)).unwrap();
    for step in steps {
        match *step {
            Channel(id, topic, schema) => {
                let schema = schema.map_or(0, |name| writer.add_schema(name, "protobuf", name.as_bytes()).unwrap());
                writer.add_channel_with_id(id, schema, topic, "protobuf", &BTreeMap::new()).unwrap();
            }
            Message(channel, time_ns, bytes) => {
                writer.write_to_known_channel(&header(channel, time_ns), &content(bytes, time_ns)).unwrap();
            }
            Pair(channels, time_ns, bytes) => {
                for (channel, bytes) in channels.into_iter().zip(bytes) {
                    writer.write_to_known_channel(&header(channel, time_ns), &content(bytes, time_ns)).unwrap();
                }
            }
            Attach(name, bytes) => {
                let data = content(bytes, 5).into();
                let [name, media_type] = [name, "text/plain"].map(str::to_owned);
                writer.attach(&mcap::Attachment { log_time: 7, create_time: 7, name, media_type, data }).unwrap();
            }
            Metadata(name) => {
                writer.write_metadata(&mcap::records::Metadata { name: name.to_owned(), metadata: entries() }).unwrap();
            }
            Flush => writer.flush().unwrap(),
        }
    }
    writer.finish().unwrap();
    drop(writer);
    out
}

/// Writes the steps with or without the page cache.
fn written_by_us(steps: &[Step], is_direct: bool) -> Vec<u8> {
    let file = NamedTempFile::new().unwrap();
    let direct = is_direct.then(|| open_direct(file.path())).flatten();
    let mut writer = McapWriter::begin(BlockWriter::new(Arc::new(file.reopen().unwrap()), direct), "p", "l");
    for step in steps {
        match *step {
            Channel(id, topic, schema) => {
                let schema = schema.map(|name| Schema { name, encoding: "protobuf", data: name.as_bytes() });
                writer.add_channel(id, topic, schema);
            }
            Message(channel, time_ns, bytes) => {
                writer.message(&header(channel, time_ns), [&content(bytes, time_ns), &[]]).unwrap();
            }
            Pair(channels, time_ns, bytes) => {
                for (channel, bytes) in channels.into_iter().zip(bytes) {
                    let content = content(bytes, time_ns);
                    writer.message(&header(channel, time_ns), content.split_at(bytes / 3).into()).unwrap();
                }
            }
            Attach(name, bytes) => {
                let data = content(bytes, 5);
                writer.attach(&Attachment { time_ns: 7, name, media_type: "text/plain", data: &data }).unwrap();
            }
            Metadata(name) => writer.metadata(name, &entries()).unwrap(),
            Flush => writer.flush().unwrap(),
        }
    }
    writer.finish().unwrap();
    std::fs::read(file.path()).unwrap()
}

fn assert_same(steps: &[Step]) {
    let expected = written_by_crate(steps);
    for found in [true, false].map(|is_direct| written_by_us(steps, is_direct)) {
        let differs = expected.iter().zip(&found).position(|(a, b)| a != b);
        assert_eq!((expected.len(), differs), (found.len(), None));
    }
}

#[test]
fn a_file_without_messages() {
    assert_same(&[]);
    assert_same(&[Metadata("m"), Flush, Attach("a", 0), Flush]);
}

#[test]
fn messages_in_one_and_in_two_parts() {
    assert_same(&[
        Metadata("m"),
        Attach("a", 1000),
        Channel(4, "/b", Some("B")),
        Channel(2, "/a", Some("A")),
        Message(4, 9, 30),
        Pair([2, 4], 5, [70, 80]),
        Pair([2, 4], 8, [0, 1]),
        Channel(9, "/c", Some("A")),
        Channel(1, "/d", None),
        Message(9, 2, 0),
        Flush,
        Message(1, 12, 10),
        Pair([9, 9], 3, [4000, 1]),
        Metadata("end"),
    ]);
}

#[test]
fn full_chunks() {
    let mut steps = vec![Channel(1, "/a", Some("A")), Channel(2, "/b", Some("B"))];
    for time_ns in 0..12 {
        steps.push(Message(2, time_ns, 700_000));
        // This message alone would fill a chunk.
        steps.push(Message(1, time_ns, 100));
        steps.push(Message(2, time_ns, 5 << 20));
    }
    assert_same(&steps);
}

#[test]
fn a_header_that_fills_a_chunk_is_apart_from_its_message() {
    let mut steps = vec![Channel(1, "/a", None)];
    steps.extend((0..3).map(|time_ns| Pair([1, 1], time_ns, [(4 << 20) + 1, 10])));
    assert_same(&steps);
}

#[test]
fn chunks_end_anywhere_in_a_block() {
    let mut steps = vec![Channel(1, "/a", None)];
    for bytes in 0..40 {
        steps.extend([Message(1, 1, 3900 + 13 * bytes as usize), Flush, Message(1, 2, 5), Flush]);
    }
    assert_same(&steps);
}
