//! Viewers such as Foxglove, Lichtblick and Rerun connect, and receive the topics of a recording.

use std::collections::BTreeMap;

use foxglove::messages::{CameraCalibration, FrameTransforms, Log, PointCloud, RawImage};
use prost::Message as _;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::*;

/// WebSocket protocol of the viewers.
const PROTOCOL: &str = "foxglove.sdk.v1";

/// Connects as a viewer. A viewer that runs in a browser has an origin.
fn connect(address: &str, origin: Option<&str>) -> Result<WebSocket<TcpStream>, tungstenite::http::StatusCode> {
    let mut request = format!("ws://{address}/").into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", HeaderValue::from_static(PROTOCOL));
    if let Some(origin) = origin {
        request.headers_mut().insert("origin", origin.parse().unwrap());
    }
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => Err(response.status()),
        Err(error) => panic!("{error}"),
    }
}

/// Returns the address of the server for viewers, from the first message of the page.
fn viewer_address(watched: &Watched<'_>) -> String {
    let stream = watched.connect();
    let (mut page, _) = tungstenite::client(format!("ws://{}/live", watched.address), stream).unwrap();
    let hello: Value = serde_json::from_str(page.read().unwrap().to_text().unwrap()).unwrap();
    host_of(hello["foxglove"].as_str().unwrap()).to_owned()
}

#[test]
fn viewers_receive_images_clouds_transforms_calibration_reports_and_log() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let mut viewer = connect(&viewer_address(&watched), None).unwrap();
    let mut topics = BTreeMap::new();
    while topics.is_empty() {
        let Message::Text(text) = viewer.read().unwrap() else { continue };
        let message: Value = serde_json::from_str(&text).unwrap();
        for channel in message["channels"].as_array().into_iter().flatten() {
            assert_eq!(channel["encoding"], "protobuf");
            topics.insert(channel["topic"].as_str().unwrap().to_owned(), channel["id"].clone());
        }
    }
    let wanted =
        ["/cam1/frame", "/cam2/frame", "/cloud", "/tf", "/cam1/calibration", "/report/stage", "/report/window", "/log"];
    let subscriptions: Vec<_> =
        (0..).zip(wanted).map(|(id, topic)| serde_json::json!({"id": id, "channelId": topics[topic]})).collect();
    let subscribe = serde_json::json!({"op": "subscribe", "subscriptions": subscriptions});
    viewer.send(Message::text(subscribe.to_string())).unwrap();
    // Causes an event, so that the log has a message.
    assert_eq!(watched.control(&serde_json::json!({"command": "record"})).status, 200);
    let mut received: BTreeMap<&str, Vec<u8>> = BTreeMap::new();
    while received.len() < wanted.len() {
        let Message::Binary(bytes) = viewer.read().unwrap() else { continue };
        // Operation, subscription, time, payload.
        if bytes[0] == 1 {
            let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
            received.insert(wanted[subscription as usize], bytes[13..].to_vec());
        }
    }
    let image = RawImage::decode(received["/cam1/frame"].as_slice()).unwrap();
    assert_eq!((image.width, image.height, image.data.len()), (96, 80, 96 * 80));
    assert!(PointCloud::decode(received["/cloud"].as_slice()).unwrap().data.len() > 1000);
    assert_eq!(FrameTransforms::decode(received["/tf"].as_slice()).unwrap().transforms.len(), 3);
    assert_eq!(CameraCalibration::decode(received["/cam1/calibration"].as_slice()).unwrap().width, 96);
    assert!(!Log::decode(received["/log"].as_slice()).unwrap().message.is_empty());
    watched.live.quit().assert_balanced();
    bench.assert_nothing_left();
}

#[test]
fn viewers_from_unknown_origins_and_malformed_requests_are_refused() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let address = viewer_address(&watched);
    for known in [None, Some("https://app.foxglove.dev"), Some("file://"), Some("http://localhost:8080")] {
        assert!(connect(&address, known).is_ok(), "{known:?}");
    }
    assert_eq!(connect(&address, Some("https://evil.example")).unwrap_err(), 403);
    let send = |bytes: &[u8]| {
        let mut stream = TcpStream::connect(&address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::parse(&answer).status
    };
    assert_eq!(send(b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), 421);
    assert_eq!(send(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n"), 400);
    assert_eq!(send(&[b"GET / HTTP/1.1\r\nX: ".as_slice(), &[b'x'; 100_000]].concat()), 400);
    // More connections than the server accepts, all silent.
    let held: Vec<_> = (0..40).map(|_| TcpStream::connect(&address).unwrap()).collect();
    drop(held);
    watched.live.wait_until("viewers are let in again", || connect(&address, None).is_ok());
    watched.live.quit().assert_balanced();
}
