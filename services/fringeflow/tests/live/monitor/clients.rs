//! Many pages at once, some of which never read: the scan goes on, and the metrics stay bounded.

use tungstenite::{Message, WebSocket};

use super::*;

/// Number of pages that read, and of pages that never read.
const READING: usize = 40;
const NOT_READING: usize = 10;

/// Opens the channel of a page, and subscribes to pictures and clouds.
fn open_page(watched: &Watched<'_>) -> WebSocket<TcpStream> {
    let (mut page, _) = tungstenite::client(format!("ws://{}/live", watched.address), watched.connect()).unwrap();
    page.send(Message::text(r#"{"type": "want", "pictures": true, "cloud": true}"#)).unwrap();
    page
}

/// Returns the number of series in the metrics.
fn count_series(watched: &Watched<'_>) -> usize {
    watched.get("/metrics").body.lines().filter(|line| !line.starts_with('#')).count()
}

#[test]
fn pages_that_never_read_block_neither_other_pages_nor_the_scan() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let before = count_series(&watched);
    assert!(before > 500, "{before} series");
    let not_reading: Vec<_> = (0..NOT_READING).map(|_| open_page(&watched)).collect();
    let mut reading: Vec<_> = (0..READING).map(|_| open_page(&watched)).collect();
    watched.live.wait_until("all pages are connected", || watched.figures()["clients"] == READING + NOT_READING);
    watched.live.wait_for_clouds(5);
    for page in &mut reading {
        let (mut figures, mut binary) = (0, Vec::new());
        // Each page gets figures, pictures and a cloud before it confirms that it has shown any of them.
        while figures == 0 || binary.len() < 2 {
            match page.read().unwrap() {
                Message::Text(text) => figures += usize::from(text.contains("\"type\":\"figures\"")),
                Message::Binary(bytes) => binary.push(message_type(&bytes)),
                _ => {}
            }
        }
        binary.sort();
        assert_eq!(binary, ["cloud", "pictures"]);
    }
    // A page that confirms a message gets the next.
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
    assert_eq!(count_series(&watched), before);
    drop((not_reading, reading));
    watched.live.wait_until("no page is connected", || watched.figures()["clients"] == 0);
    watched.live.quit().assert_undisturbed();
}

/// Returns the type of a binary message, from its JSON header.
fn message_type(message: &[u8]) -> String {
    let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
    header["type"].as_str().unwrap().to_owned()
}
