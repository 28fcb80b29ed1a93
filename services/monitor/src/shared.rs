//! State that the main loop and the servers share.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use tokio::sync::watch;

use fringeflow_transport::Instance;

use crate::instance_status::InstanceStatus;

/// The shared state.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) instance: Instance,
    pub(crate) status: Arc<Mutex<InstanceStatus>>,
    /// Number of connected pages.
    pub(crate) clients: Arc<AtomicUsize>,
    /// The last message of figures, one per second.
    pub(crate) figures: watch::Sender<Arc<str>>,
    pub(crate) pictures: View,
    pub(crate) cloud: View,
    pub(crate) model: View,
    /// Set when the service stops.
    pub(crate) stop: watch::Sender<bool>,
}

/// Large messages of one kind. They are encoded only while a page is ready for the next one.
#[derive(Debug)]
pub(crate) struct View {
    /// The newest message with its number.
    newest: watch::Sender<(u64, Bytes)>,
    ready_pages: Arc<AtomicUsize>,
}

/// Adds one to a count as long as it exists.
#[derive(Debug)]
pub(crate) struct CountGuard(Arc<AtomicUsize>);

impl Shared {
    pub(crate) fn new(instance: Instance, status: InstanceStatus) -> Self {
        Self {
            instance,
            status: Arc::new(Mutex::new(status)),
            clients: Arc::default(),
            figures: watch::Sender::new(Arc::from("null")),
            pictures: View::new(),
            cloud: View::new(),
            model: View::new(),
            stop: watch::Sender::new(false),
        }
    }

    /// Locks the status. A thread that panicked while it held the lock left the status valid, so poisoning is ignored.
    pub(crate) fn status(&self) -> MutexGuard<'_, InstanceStatus> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Waits until the service stops.
pub(crate) async fn stopped(stop: &mut watch::Receiver<bool>) {
    // An error means that the sender is gone: the service has stopped.
    let _ = stop.wait_for(|stop| *stop).await;
}

impl View {
    fn new() -> Self {
        Self { newest: watch::Sender::new((0, Bytes::new())), ready_pages: Arc::default() }
    }

    /// Number of pages that are ready for the next message.
    pub(crate) fn ready_pages(&self) -> usize {
        self.ready_pages.load(Ordering::Relaxed)
    }

    /// Gives the next message to all pages that are ready, and returns its bytes.
    pub(crate) fn publish(&self, id: u64, message: Vec<u8>) -> usize {
        let bytes = message.len();
        self.newest.send_replace((id, message.into()));
        bytes
    }

    pub(crate) fn subscribe(&self) -> watch::Receiver<(u64, Bytes)> {
        self.newest.subscribe()
    }

    /// Counts a page as ready as long as the guard exists.
    pub(crate) fn count_ready(&self) -> CountGuard {
        CountGuard::new(&self.ready_pages)
    }
}

impl CountGuard {
    pub(crate) fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(count))
    }
}

impl Drop for CountGuard {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
