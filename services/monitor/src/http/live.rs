//! The WebSocket of a page: figures every second, pictures and clouds as fast as the page draws them.
//!
//! Nothing is queued: a page gets the newest message once it has drawn the previous one. A page that stops reading is
//! disconnected.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Deserialize;
use tokio::sync::watch;

use super::state::ServerState;
use crate::shared::{CountGuard, Shared, View, stopped};

/// Largest size of a message from a page, bytes.
const MAX_MESSAGE_BYTES: usize = 4096;
/// Time limit for a page to receive a message.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);

/// A message from a page.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum PageMessage {
    /// The kinds of messages that it wants.
    Want {
        pictures: bool,
        cloud: bool,
        #[serde(default)]
        model: bool,
    },
    /// It has drawn a message.
    Shown { id: u64 },
}

/// Large messages of one kind for one page.
struct Feed<'s> {
    view: &'s View,
    newest: watch::Receiver<(u64, Bytes)>,
    is_wanted: bool,
    /// Id of the last message that was sent to the page.
    sent_id: u64,
    /// Set while the page is ready for the next message.
    ready: Option<CountGuard>,
}

pub(super) async fn upgrade(State(server): State<ServerState>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.max_message_size(MAX_MESSAGE_BYTES).max_frame_size(MAX_MESSAGE_BYTES);
    upgrade.on_upgrade(move |socket| async move {
        // The result only says that the page disconnected, which needs no log line.
        let _ = serve(socket, &server.shared).await;
    })
}

/// Serves a page until it disconnects or stops reading, or the service stops.
async fn serve(mut socket: WebSocket, shared: &Arc<Shared>) -> Option<()> {
    let _client = CountGuard::new(&shared.clients);
    let (hello, mut last_event_id) = {
        let status = shared.status();
        (status.hello_message(), status.events.last_id())
    };
    send(&mut socket, Message::Text(hello.into())).await?;
    let mut stop = shared.stop.subscribe();
    let mut figures = shared.figures.subscribe();
    let mut feeds = [&shared.pictures, &shared.cloud, &shared.model].map(Feed::new);
    loop {
        tokio::select! {
            received = socket.recv() => handle_message(&received?.ok()?, &mut feeds),
            changed = figures.changed() => {
                changed.ok()?;
                let message = figures.borrow_and_update().to_string();
                send(&mut socket, Message::Text(message.into())).await?;
                let (events, last_id) = {
                    let status = shared.status();
                    (status.events_message(last_event_id), status.events.last_id())
                };
                last_event_id = last_id;
                if let Some(events) = events {
                    send(&mut socket, Message::Text(events.into())).await?;
                }
            }
            message = next_message(&mut feeds) => send(&mut socket, Message::Binary(message?)).await?,
            () = stopped(&mut stop) => return send(&mut socket, Message::Close(None)).await,
        }
    }
}

/// Sends a message; returns `None` if the page has disconnected or does not read.
async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    tokio::time::timeout(SEND_TIMEOUT, socket.send(message)).await.ok()?.ok()
}

/// Waits for the next message of any kind.
async fn next_message([pictures, cloud, model]: &mut [Feed<'_>; 3]) -> Option<Bytes> {
    tokio::select! {
        message = pictures.next() => message,
        message = cloud.next() => message,
        message = model.next() => message,
    }
}

/// Handles a message from a page. Unknown messages are ignored.
fn handle_message(message: &Message, feeds: &mut [Feed<'_>; 3]) {
    let Message::Text(text) = message else { return };
    match serde_json::from_str(text) {
        Ok(PageMessage::Want { pictures, cloud, model }) => {
            feeds.iter_mut().zip([pictures, cloud, model]).for_each(|(feed, is_wanted)| feed.set_wanted(is_wanted));
        }
        Ok(PageMessage::Shown { id }) => feeds.iter_mut().for_each(|feed| feed.note_shown(id)),
        Err(_) => {}
    }
}

impl<'s> Feed<'s> {
    fn new(view: &'s View) -> Self {
        Self { view, newest: view.subscribe(), is_wanted: false, sent_id: 0, ready: None }
    }

    fn set_wanted(&mut self, is_wanted: bool) {
        if is_wanted && !self.is_wanted {
            self.set_ready();
        }
        if !is_wanted {
            self.ready = None;
        }
        self.is_wanted = is_wanted;
    }

    /// Notes that the page has drawn a message. Ids are unique over all kinds, so each feed recognizes its own.
    fn note_shown(&mut self, id: u64) {
        if self.is_wanted && self.ready.is_none() && self.sent_id == id {
            self.set_ready();
        }
    }

    /// Makes the page ready for the next message that is published from now on.
    fn set_ready(&mut self) {
        self.newest.mark_unchanged();
        self.ready = Some(self.view.count_ready());
    }

    /// Waits until the page is ready and a message is published; returns `None` if there will be none.
    async fn next(&mut self) -> Option<Bytes> {
        if self.ready.is_none() {
            std::future::pending::<()>().await;
        }
        self.newest.changed().await.ok()?;
        self.ready = None;
        let (id, message) = self.newest.borrow_and_update().clone();
        self.sent_id = id;
        Some(message)
    }
}
