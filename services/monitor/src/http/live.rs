//! The page's connection: figures every second, pictures and clouds as fast as it takes them.
//!
//! Nothing is queued: a page gets the newest message when it has drawn the one before, and one that stops reading is cut off.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Deserialize;
use tokio::sync::watch;

use super::server::Answering;
use crate::shared::{Counted, Shared, View, ended};

/// Bytes of a message from a page.
const MESSAGE_BYTES: usize = 4096;
/// How long a page may take to take a message.
const SEND_TIME: Duration = Duration::from_secs(10);

/// What a page says.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Said {
    /// What it would see.
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
    /// Number of the message that the page was sent last.
    sent: u64,
    /// While the page is ready for the next message.
    ready: Option<Counted>,
}

pub(super) async fn upgrade(State(answering): State<Answering>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.max_message_size(MESSAGE_BYTES).max_frame_size(MESSAGE_BYTES);
    upgrade.on_upgrade(move |socket| async move {
        // A page that went away is no news.
        let _ = serve(socket, &answering.shared).await;
    })
}

/// Serves a page until it goes, stops reading, or the service ends.
async fn serve(mut socket: WebSocket, shared: &Arc<Shared>) -> Option<()> {
    let _client = Counted::new(&shared.clients);
    let (hello, mut told) = {
        let board = shared.board();
        (board.hello(), board.events.last_id())
    };
    send(&mut socket, Message::Text(hello.into())).await?;
    let mut stop = shared.stop.subscribe();
    let mut figures = shared.figures.subscribe();
    let mut feeds = [&shared.pictures, &shared.cloud, &shared.model].map(Feed::new);
    loop {
        tokio::select! {
            said = socket.recv() => listen(&said?.ok()?, &mut feeds),
            changed = figures.changed() => {
                changed.ok()?;
                let message = figures.borrow_and_update().to_string();
                send(&mut socket, Message::Text(message.into())).await?;
                let (events, last_id) = {
                    let board = shared.board();
                    (board.events_after(told), board.events.last_id())
                };
                told = last_id;
                if let Some(events) = events {
                    send(&mut socket, Message::Text(events.into())).await?;
                }
            }
            message = next(&mut feeds) => send(&mut socket, Message::Binary(message?)).await?,
            () = ended(&mut stop) => return send(&mut socket, Message::Close(None)).await,
        }
    }
}

/// Sends a message; `None` where the page is gone, or does not read.
async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    tokio::time::timeout(SEND_TIME, socket.send(message)).await.ok()?.ok()
}

/// The next message of any kind.
async fn next([pictures, cloud, model]: &mut [Feed<'_>; 3]) -> Option<Bytes> {
    tokio::select! {
        message = pictures.next() => message,
        message = cloud.next() => message,
        message = model.next() => message,
    }
}

/// Follows what a page says; what cannot be understood is passed over.
fn listen(message: &Message, feeds: &mut [Feed<'_>; 3]) {
    let Message::Text(text) = message else { return };
    match serde_json::from_str(text) {
        Ok(Said::Want { pictures, cloud, model }) => {
            feeds.iter_mut().zip([pictures, cloud, model]).for_each(|(feed, is_wanted)| feed.want(is_wanted));
        }
        Ok(Said::Shown { id }) => feeds.iter_mut().for_each(|feed| feed.shown(id)),
        Err(_) => {}
    }
}

impl<'s> Feed<'s> {
    fn new(view: &'s View) -> Self {
        Self { view, newest: view.subscribe(), is_wanted: false, sent: 0, ready: None }
    }

    fn want(&mut self, is_wanted: bool) {
        if is_wanted && !self.is_wanted {
            self.get_ready();
        }
        if !is_wanted {
            self.ready = None;
        }
        self.is_wanted = is_wanted;
    }

    /// The page has drawn a message; all kinds share their numbers, so it is told whose it was.
    fn shown(&mut self, id: u64) {
        if self.is_wanted && self.ready.is_none() && self.sent == id {
            self.get_ready();
        }
    }

    fn get_ready(&mut self) {
        self.newest.mark_unchanged();
        self.ready = Some(self.view.count_ready());
    }

    /// The next message, once the page is ready and there is one; `None` when there will be none.
    async fn next(&mut self) -> Option<Bytes> {
        if self.ready.is_none() {
            std::future::pending::<()>().await;
        }
        self.newest.changed().await.ok()?;
        self.ready = None;
        let (id, message) = self.newest.borrow_and_update().clone();
        self.sent = id;
        Some(message)
    }
}
