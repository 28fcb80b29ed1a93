//! The committed schema, its descriptor and its structs agree.

use std::collections::BTreeMap;

use prost::Message as _;
use prost_types::{DescriptorProto, FileDescriptorSet};

use super::*;
use crate::convert::Convert;
use crate::schema::{self, DESCRIPTOR};

const PROTO: &str = include_str!("../schema/fringeflow.proto");

fn descriptor() -> BTreeMap<String, DescriptorProto> {
    let set = FileDescriptorSet::decode(DESCRIPTOR).unwrap();
    let [file] = &set.file[..] else { panic!("one file") };
    assert_eq!(file.package(), "fringeflow");
    file.message_type.iter().map(|message| (message.name().to_owned(), message.clone())).collect()
}

/// Returns the messages of the schema text, with name and number of each field.
fn fields_of_text() -> BTreeMap<String, BTreeMap<String, i32>> {
    let mut messages = BTreeMap::new();
    let mut message = String::new();
    for line in PROTO.lines().map(str::trim).filter(|line| !line.starts_with("//")) {
        if let Some(name) = line.strip_prefix("message ").and_then(|rest| rest.strip_suffix(" {")) {
            message = name.to_owned();
        } else if let Some((field, number)) =
            line.trim_end_matches(';').split_once(" = ").filter(|_| !message.is_empty())
        {
            let name = field.rsplit(' ').next().unwrap();
            let fields: &mut BTreeMap<String, i32> = messages.entry(message.clone()).or_default();
            assert!(fields.insert(name.to_owned(), number.parse().unwrap()).is_none(), "{message}.{name} twice");
        }
    }
    messages
}

#[test]
fn the_descriptor_matches_the_schema_text() {
    let text = fields_of_text();
    let descriptor = descriptor();
    assert_eq!(text.keys().collect::<Vec<_>>(), descriptor.keys().collect::<Vec<_>>());
    for (name, message) in &descriptor {
        let fields: BTreeMap<String, i32> =
            message.field.iter().map(|field| (field.name().to_owned(), field.number())).collect();
        assert_eq!(text[name], fields, "{name}");
    }
}

#[test]
fn every_field_is_documented() {
    let lines: Vec<&str> = PROTO.lines().map(str::trim).collect();
    for pair in lines.windows(2).filter(|pair| pair[1].ends_with(';') && pair[1].contains(" = ")) {
        assert!(pair[0].starts_with("//") || pair[1].starts_with("syntax"), "{} has no comment", pair[1]);
    }
}

/// Returns the field numbers on the wire, in order, without repetitions.
fn numbers_on_the_wire(mut bytes: &[u8]) -> Vec<i32> {
    let mut numbers = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        match key & 7 {
            0 => drop(varint(&mut bytes)),
            1 => bytes = &bytes[8..],
            2 => {
                let length = varint(&mut bytes) as usize;
                bytes = &bytes[length..];
            }
            5 => bytes = &bytes[4..],
            other => panic!("wire type {other}"),
        }
        numbers.push((key >> 3) as i32);
    }
    numbers.dedup();
    numbers
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let end = bytes.iter().position(|byte| byte & 0x80 == 0).unwrap() + 1;
    let value = bytes[..end].iter().rev().fold(0, |value, byte| value << 7 | u64::from(byte & 0x7f));
    *bytes = &bytes[end..];
    value
}

fn encoded<M: Convert + prost::Message>(source: &M::Struct) -> Vec<u8> {
    M::from_struct(source).unwrap().encode_to_vec()
}

#[test]
fn the_structs_write_exactly_the_fields_of_the_descriptor() {
    let maps = schema::MapsHeader::from_struct(&maps()).unwrap();
    let map = schema::CorrespondenceHeader::from_struct(&correspondences()).unwrap();
    let window_report = schema::WindowReport::from_struct(&window_report()).unwrap();
    let mut pose = schema::PoseReport::from_struct(&pose_report()).unwrap();
    pose.reason = "degenerate".to_owned();
    let prior = schema::Prior::from_struct(&prior_header()).unwrap();
    // No field has its default value, so every field is on the wire.
    let written = [
        ("FrameHeader", encoded::<schema::FrameHeader>(&frame(1, 11))),
        ("PatternEvent", encoded::<schema::PatternEvent>(&pattern())),
        ("Window", encoded::<schema::Window>(&Window { prior: 6, ..window() })),
        ("Fit", maps.cam1.unwrap().encode_to_vec()),
        ("MapsHeader", maps.encode_to_vec()),
        ("PhaseMaps", schema::PhaseMaps { header: Some(maps), payload: vec![1].into() }.encode_to_vec()),
        ("CorrespondenceHeader", map.encode_to_vec()),
        ("CorrespondenceMap", schema::CorrespondenceMap { header: Some(map), payload: vec![1].into() }.encode_to_vec()),
        ("CloudHeader", encoded::<schema::CloudHeader>(&cloud(3))),
        ("Drift", window_report.drift.unwrap().encode_to_vec()),
        ("Gauge", window_report.health[0].encode_to_vec()),
        ("WindowReport", window_report.encode_to_vec()),
        ("TrackedPose", pose.pose.clone().unwrap().encode_to_vec()),
        ("PoseReport", pose.encode_to_vec()),
        ("Prior", schema::Prior { relief: RELIEF.to_vec().into(), ..prior }.encode_to_vec()),
        ("StageReport", encoded::<schema::StageReport>(&report())),
    ];
    let written: BTreeMap<&str, Vec<i32>> =
        written.iter().map(|(name, bytes)| (*name, numbers_on_the_wire(bytes))).collect();
    for (name, message) in descriptor() {
        let numbers: Vec<i32> = message.field.iter().map(|field| field.number()).collect();
        assert_eq!(written[name.as_str()], numbers, "{name}");
    }
}
