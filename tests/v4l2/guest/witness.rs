//! The other end of a capture service: publishes that the instance scans, and receives every image.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use fringeflow_message::{FrameHeader, ScanState};
use fringeflow_transport::{CAM1_FRAME, ChannelSizes, Instance, Node, Publisher, SCAN_STATE, Subscriber, wait_for};

/// Longest wait for an image before the scan state is checked.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Receives the images of camera 1 until it is dropped.
pub(crate) struct Witness {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    /// Headers of all images so far.
    headers: Mutex<Vec<FrameHeader>>,
    /// Pixels of the first one.
    first: Mutex<Option<Vec<u8>>>,
    is_over: AtomicBool,
    is_dropped: AtomicBool,
}

impl Witness {
    /// Opens the channels, and publishes that the instance scans.
    pub(crate) fn new(instance: &Instance, sizes: ChannelSizes) -> Self {
        let shared = Arc::new(Shared::default());
        let (instance, of_thread) = (instance.clone(), Arc::clone(&shared));
        let (opened, is_open) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let node = Node::open(&instance, "witness").unwrap();
            let images = Subscriber::open(&node, CAM1_FRAME, &sizes).unwrap();
            let states = Publisher::open(&node, SCAN_STATE, &sizes).unwrap();
            opened.send(()).unwrap();
            of_thread.watch(images, states);
        });
        is_open.recv().unwrap();
        Self { shared, thread: Some(thread) }
    }

    /// Publishes that the scan has ended.
    pub(crate) fn end_scan(&self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
    }

    /// Headers of all images so far.
    pub(crate) fn headers(&self) -> Vec<FrameHeader> {
        self.shared.headers.lock().unwrap().clone()
    }

    /// Number of images so far.
    pub(crate) fn images(&self) -> usize {
        self.shared.headers.lock().unwrap().len()
    }

    /// The last image.
    pub(crate) fn last(&self) -> Option<FrameHeader> {
        self.shared.headers.lock().unwrap().last().copied()
    }

    /// Pixels of the first image.
    pub(crate) fn first_pixels(&self) -> Vec<u8> {
        self.shared.first.lock().unwrap().clone().unwrap()
    }
}

impl Shared {
    fn watch(&self, mut images: Subscriber<FrameHeader, [u8]>, mut states: Publisher<(), ScanState>) {
        let mut scans = None;
        while !self.is_dropped.load(Ordering::Relaxed) {
            let should_scan = !self.is_over.load(Ordering::Relaxed);
            if scans.replace(should_scan) != Some(should_scan) {
                states.send_message(&ScanState { scanning: should_scan.into(), ..ScanState::default() }).unwrap();
            }
            // Otherwise a service that connects later would not receive the state.
            states.ensure_connected().unwrap();
            wait_for(&[&images], POLL_INTERVAL).unwrap();
            while let Some(image) = images.receive().unwrap() {
                self.first.lock().unwrap().get_or_insert_with(|| image.payload().to_vec());
                self.headers.lock().unwrap().push(*image.header());
            }
        }
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.shared.is_dropped.store(true, Ordering::Relaxed);
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) && !std::thread::panicking() {
            panic!("the images could not be received");
        }
    }
}
