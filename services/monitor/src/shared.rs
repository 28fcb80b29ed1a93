//! What the loop of the service and its servers share.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use tokio::sync::watch;

use fringeflow_transport::Instance;

use crate::board::Board;

/// Everything that is shared.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) instance: Instance,
    pub(crate) board: Arc<Mutex<Board>>,
    /// Pages that are connected.
    pub(crate) clients: Arc<AtomicUsize>,
    /// The message of every second.
    pub(crate) figures: watch::Sender<Arc<str>>,
    pub(crate) pictures: View,
    pub(crate) cloud: View,
    pub(crate) model: View,
    /// Set when everything is to end.
    pub(crate) stop: watch::Sender<bool>,
}

/// Large messages of one kind, made only while somebody is ready for the next.
#[derive(Debug)]
pub(crate) struct View {
    /// The newest message with its number.
    newest: watch::Sender<(u64, Bytes)>,
    ready: Arc<AtomicUsize>,
}

/// One more of something, as long as this lives.
#[derive(Debug)]
pub(crate) struct Counted(Arc<AtomicUsize>);

impl Shared {
    pub(crate) fn new(instance: Instance, board: Board) -> Self {
        Self {
            instance,
            board: Arc::new(Mutex::new(board)),
            clients: Arc::default(),
            figures: watch::Sender::new(Arc::from("null")),
            pictures: View::new(),
            cloud: View::new(),
            model: View::new(),
            stop: watch::Sender::new(false),
        }
    }

    /// The board; whoever panicked with it left it whole.
    pub(crate) fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Waits until everything is to end.
pub(crate) async fn ended(stop: &mut watch::Receiver<bool>) {
    // Without a sender there is nothing left to wait for.
    let _ = stop.wait_for(|stop| *stop).await;
}

impl View {
    fn new() -> Self {
        Self { newest: watch::Sender::new((0, Bytes::new())), ready: Arc::default() }
    }

    /// Number of pages that are ready for the next message.
    pub(crate) fn ready(&self) -> usize {
        self.ready.load(Ordering::Relaxed)
    }

    /// Hands the next message to all that are ready; its bytes.
    pub(crate) fn put_out(&self, id: u64, message: Vec<u8>) -> usize {
        let bytes = message.len();
        self.newest.send_replace((id, message.into()));
        bytes
    }

    pub(crate) fn subscribe(&self) -> watch::Receiver<(u64, Bytes)> {
        self.newest.subscribe()
    }

    /// Says that a page is ready, as long as the count lives.
    pub(crate) fn count_ready(&self) -> Counted {
        Counted::new(&self.ready)
    }
}

impl Counted {
    pub(crate) fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(count))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
