//! Ports between nodes and between processes. A test runs itself again as the child process.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use tempfile::TempDir;

use super::*;
use crate::message::{
    Block, Command as Ask, ControlRequest, ControlResponse, FrameHeader, MapsHeader, PatternEvent, ScanState, Text,
};

const HANG: Duration = Duration::from_secs(60);
const STEP: Duration = Duration::from_millis(20);

const SIZES: ChannelSizes =
    ChannelSizes { frame_bytes: 4096, window: 4, map_blocks: 8, correspondence_blocks: 8, cloud_bytes: 1000 };

/// An instance of its own in a folder of its own.
struct Place {
    folder: TempDir,
    instance: Instance,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let instance = Instance::under(folder.path(), "test").unwrap();
        Self { folder, instance }
    }

    fn node(&self) -> Node {
        Node::open(&self.instance, "test").unwrap()
    }
}

fn frame(number: u64) -> FrameHeader {
    FrameHeader { published: number, width_px: 64, height_px: 64, ..FrameHeader::default() }
}

fn numbers<P: Payload + ?Sized>(subscriber: &mut Subscriber<FrameHeader, P>) -> Vec<u64> {
    std::iter::from_fn(|| subscriber.receive().unwrap()).map(|message| message.header().published).collect()
}

#[test]
fn header_and_payload_arrive_as_sent() {
    let place = Place::new();
    let (here, there) = (place.node(), place.node());
    let mut frames_out = Publisher::open(&here, CAM1_FRAME, &SIZES).unwrap();
    let mut maps_out = Publisher::open(&here, PHASE_MAPS, &SIZES).unwrap();
    let mut patterns_out = Publisher::open(&here, PROJECTOR_PATTERN, &SIZES).unwrap();
    let mut frames = Subscriber::open(&there, CAM1_FRAME, &SIZES).unwrap();
    let mut maps = Subscriber::open(&there, PHASE_MAPS, &SIZES).unwrap();
    let mut patterns = Subscriber::open(&there, PROJECTOR_PATTERN, &SIZES).unwrap();

    let image: Vec<u8> = (0..4096).map(|i| (i % 251) as u8).collect();
    frames_out.send(&frame(7), &image).unwrap();
    maps_out
        .send_filled(&MapsHeader { published: 8, ..MapsHeader::default() }, 3, |blocks| blocks[1].0[5] = 9)
        .unwrap();
    patterns_out.send_message(&PatternEvent { sequence: 10, ..PatternEvent::default() }).unwrap();

    let received = frames.receive().unwrap().unwrap();
    assert_eq!((received.header(), received.payload()), (&frame(7), &image[..]));
    let mut blocks = [Block::zeroed(); 3];
    blocks[1].0[5] = 9;
    let received = maps.receive().unwrap().unwrap();
    assert_eq!((received.header().published, received.payload()), (8, &blocks[..]));
    assert_eq!(patterns.receive().unwrap().unwrap().sequence, 10);
    assert!(patterns.receive().unwrap().is_none());
}

#[test]
fn a_full_buffer_loses_its_oldest_and_the_publisher_goes_on() {
    let place = Place::new();
    let node = place.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    (0..100).for_each(|number| publisher.send(&frame(number), &[0; 16]).unwrap());
    assert_eq!(numbers(&mut subscriber), (84..100).collect::<Vec<_>>());
}

#[test]
fn two_windows_and_four_can_be_held_and_do_not_change() {
    let place = Place::new();
    let node = place.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut held = Vec::new();
    for number in 0..12 {
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
        held.push(subscriber.receive().unwrap().unwrap());
    }
    for number in 12..200 {
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
    }
    for (number, message) in held.iter().enumerate() {
        assert_eq!(message.header().published, number as u64);
        assert!(message.payload().iter().all(|&byte| usize::from(byte) == number), "message {number} changed");
    }
    assert!(subscriber.receive().is_err(), "more than two windows and four can be held");
    held.pop();
    assert_eq!(subscriber.receive().unwrap().unwrap().header().published, 184);
}

#[test]
fn a_new_subscriber_is_given_the_state() {
    let place = Place::new();
    let node = place.node();
    let mut publisher = Publisher::open(&node, SCAN_STATE, &SIZES).unwrap();
    publisher.send_message(&ScanState { revision: 1, ..ScanState::default() }).unwrap();
    publisher.send_message(&ScanState { revision: 2, ..ScanState::default() }).unwrap();
    let mut subscriber = Subscriber::open(&node, SCAN_STATE, &SIZES).unwrap();
    // The publisher hands it out when it next looks at its subscribers.
    publisher.ensure_connected().unwrap();
    assert_eq!(subscriber.receive().unwrap().unwrap().revision, 2);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_payload_that_does_not_fit_is_refused_and_the_next_one_passes() {
    let place = Place::new();
    let node = place.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let error = publisher.send(&frame(0), &[0; 4097]).unwrap_err();
    assert!(matches!(error, TransportError::TooLong { len: 4097, limit: 4096, .. }), "{error}");
    publisher.send(&frame(1), &[0; 4096]).unwrap();
    assert_eq!(numbers(&mut subscriber), [1]);
}

#[test]
fn a_second_publisher_is_refused_while_the_first_lives() {
    let place = Place::new();
    let node = place.node();
    let first = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let error = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap_err();
    let expected = "channel cam1/frame of instance test has its 1 publisher(s) already; stop one of them";
    assert_eq!(error.to_string(), expected);
    drop(first);
    Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
}

#[test]
fn waiting_ends_with_a_message_of_any_port() {
    let place = Place::new();
    let node = place.node();
    let mut first = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut second = Subscriber::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let wake = Wake::new().unwrap();
    let sender = std::thread::spawn(move || {
        std::thread::sleep(STEP);
        publisher.send(&frame(3), &[1]).unwrap();
        publisher
    });
    let start = Instant::now();
    let received = loop {
        wake.wait(&[&first, &second], HANG).unwrap();
        assert!(first.receive().unwrap().is_none());
        let received = numbers(&mut second);
        if !received.is_empty() {
            break received;
        }
    };
    assert_eq!(received, [3]);
    assert!(start.elapsed() < HANG, "the message did not end the wait");
    sender.join().unwrap();
}

#[test]
fn a_request_is_answered_and_without_a_server_refused() {
    let place = Place::new();
    let ask = ControlRequest { command: Ask::Mark as u32, text: Text::new("here"), ..ControlRequest::default() };
    let absent = request(&place.instance, &ask, HANG).unwrap_err();
    assert_eq!(absent.to_string(), "no instance test is running here");

    let node = place.node();
    let mut server = ControlServer::open(&node).unwrap();
    let instance = place.instance.clone();
    let client = std::thread::spawn(move || request(&instance, &ask, HANG).unwrap());
    let wake = Wake::new().unwrap();
    let echo = |request: &ControlRequest| ControlResponse { refused: 1, text: request.text, ..Default::default() };
    while server.answer(echo).unwrap() == 0 {
        wake.wait(&[&server], HANG).unwrap();
    }
    let response = client.join().unwrap();
    assert_eq!((response.refused, response.text.to_text().as_str()), (1, "here"));

    let silent = request(&place.instance, &ask, STEP).unwrap_err();
    assert!(matches!(silent, TransportError::NoAnswer { .. }), "{silent}");
    drop(server);
    drop(node);
    let gone = request(&place.instance, &ask, HANG).unwrap_err();
    assert!(matches!(gone, TransportError::NotRunning { .. }), "{gone}");
}
