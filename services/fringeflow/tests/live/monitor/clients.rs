//! Many pages at once, some of which never read: the scan goes on, and what is told stays bounded.

use tungstenite::{Message, WebSocket};

use super::*;

/// Pages that read, and that do not.
const READING: usize = 40;
const SILENT: usize = 10;

fn page(watched: &Watched<'_>) -> WebSocket<TcpStream> {
    let (mut page, _) = tungstenite::client(format!("ws://{}/live", watched.address), watched.connect()).unwrap();
    page.send(Message::text(r#"{"type": "want", "pictures": true, "cloud": true}"#)).unwrap();
    page
}

/// Number of series that the metrics have.
fn series(watched: &Watched<'_>) -> usize {
    watched.get("/metrics").body.lines().filter(|line| !line.starts_with('#')).count()
}

#[test]
fn pages_that_never_read_hold_up_nobody() {
    let bench = bench("");
    let watched = Watched::start(&bench, &[]);
    let before = series(&watched);
    assert!(before > 500, "{before} series");
    let silent: Vec<_> = (0..SILENT).map(|_| page(&watched)).collect();
    let mut reading: Vec<_> = (0..READING).map(|_| page(&watched)).collect();
    watched.live.wait_until("all pages are counted", || watched.figures()["clients"] == READING + SILENT);
    watched.live.wait_for_clouds(5);
    for page in &mut reading {
        let (mut figures, mut binary) = (0, Vec::new());
        // Each page gets figures, pictures and a cloud, though none has said that it drew the first.
        while figures == 0 || binary.len() < 2 {
            match page.read().unwrap() {
                Message::Text(text) => figures += usize::from(text.contains("\"type\":\"figures\"")),
                Message::Binary(bytes) => binary.push(kind(&bytes)),
                _ => {}
            }
        }
        binary.sort();
        assert_eq!(binary, ["cloud", "pictures"]);
    }
    // One that has drawn a picture gets the next.
    let page = &mut reading[0];
    let mut more = 0;
    while more < 3 {
        for id in 0..1000 {
            page.send(Message::text(format!(r#"{{"type": "shown", "id": {id}}}"#))).unwrap();
        }
        if let Message::Binary(_) = page.read().unwrap() {
            more += 1;
        }
    }
    assert_eq!(series(&watched), before);
    drop((silent, reading));
    watched.live.wait_until("no page is counted any more", || watched.figures()["clients"] == 0);
    watched.live.quit().assert_undisturbed();
}

/// Kind of a binary message.
fn kind(message: &[u8]) -> String {
    let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
    header["type"].as_str().unwrap().to_owned()
}
