//! A capture service alone, watched from the other end of its channel: every image that it sends is seen here.

use std::process::{Child, Stdio};

use fringeflow::message::{Counts, FrameHeader, Incident, ScanState, Stage};
use fringeflow::transport::{CAM1_FRAME, Node, Publisher, Received, SCAN_STATE, Subscriber};
use fringeflow_runtime::{ServiceArgs, channel_sizes};
use rustix::process::Signal;

use crate::support::{Bench, send, wait};

/// The capture service of camera 1 of a bench; killed when it is dropped.
pub(crate) struct Capture<'a> {
    bench: &'a Bench,
    child: Child,
    states: Publisher<(), ScanState>,
    images: Subscriber<FrameHeader, [u8]>,
    /// Headers of all images so far.
    pub(crate) headers: Vec<FrameHeader>,
}

impl<'a> Capture<'a> {
    /// Starts it, and says that the instance scans; what it logs goes to the output of the test.
    pub(crate) fn start(bench: &'a Bench) -> Self {
        let config = bench.configuration();
        let arguments =
            ServiceArgs { config: config.clone(), setup: None, segment_table: None, restarts: 0, supervised: false };
        let configuration = arguments.configuration().unwrap();
        let sizes = channel_sizes(&arguments.setup(&configuration).unwrap(), configuration.pixel_format());
        let node = Node::open(&bench.instance(), "test").unwrap();
        let images = Subscriber::open(&node, CAM1_FRAME, &sizes).unwrap();
        let mut states = Publisher::open(&node, SCAN_STATE, &sizes).unwrap();
        states.send_message(&ScanState { scanning: 1, ..ScanState::default() }).unwrap();
        let mut service = bench.command(&[&"service", &"camera1", &"--config", &config]);
        let child = service.stdin(Stdio::null()).spawn().unwrap();
        Self { bench, child, states, images, headers: Vec::new() }
    }

    /// Its process.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// What it has counted.
    pub(crate) fn counts(&self) -> Counts {
        self.bench.counts(Stage::Camera1)
    }

    /// How often an incident was counted.
    pub(crate) fn incidents(&self, incident: Incident) -> u64 {
        self.counts().incidents[incident as usize]
    }

    /// The next image, waited for.
    pub(crate) fn image(&mut self) -> (FrameHeader, Vec<u8>) {
        let mut image = None;
        let came = wait(|| {
            image = self.receive();
            image.is_some()
        });
        assert!(came, "no image comes: {:?}", self.counts());
        let image = image.unwrap();
        (*image.header(), image.payload().to_vec())
    }

    /// Waits for so many images.
    pub(crate) fn images(&mut self, more: usize) {
        let enough = self.headers.len() + more;
        self.until("enough images are here", |capture| capture.headers.len() >= enough);
    }

    /// Takes images until something is so.
    pub(crate) fn until(&mut self, what: &str, mut is: impl FnMut(&Self) -> bool) {
        let reached = wait(|| {
            self.take();
            is(self)
        });
        assert!(reached, "it never is that {what}: {:?}", self.counts());
    }

    /// Takes images while something is done, so that none is lost on the way here.
    pub(crate) fn during(&mut self, work: impl FnOnce() + Send) {
        std::thread::scope(|scope| {
            let working = scope.spawn(work);
            self.until("the work is done", |_| working.is_finished());
        });
    }

    /// Takes the images that have come.
    pub(crate) fn take(&mut self) {
        while self.receive().is_some() {}
    }

    fn receive(&mut self) -> Option<Received<FrameHeader, [u8]>> {
        assert!(self.child.try_wait().unwrap().is_none(), "the service has ended: {:?}", self.counts());
        // Otherwise a service that came later would not hear of the state.
        self.states.ensure_connected().unwrap();
        let image = self.images.receive().unwrap()?;
        self.headers.push(*image.header());
        Some(image)
    }

    /// Says that the scan is over, waits until the device is closed, takes the last images and ends the service as the system
    /// would. Its account adds up. The headers of all images, and the account.
    pub(crate) fn stop(mut self) -> (Vec<FrameHeader>, Counts) {
        self.states.send_message(&ScanState::default()).unwrap();
        self.until("the device is closed", |capture| !capture.holds_a_device());
        self.until("all images are here", |capture| {
            capture.headers.last().is_none_or(|last| last.published + 1 == capture.counts().passed)
        });
        send(self.pid(), Signal::TERM);
        assert!(wait(|| self.child.try_wait().unwrap().is_some()), "it does not end");
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
        let counts = self.counts();
        assert_eq!(counts.in_work(), Some(0), "{counts:?}");
        (std::mem::take(&mut self.headers), counts)
    }

    /// Whether a video device is open in it.
    pub(crate) fn holds_a_device(&self) -> bool {
        let open = std::fs::read_dir(format!("/proc/{}/fd", self.pid())).unwrap().flatten();
        let mut files = open.filter_map(|entry| std::fs::read_link(entry.path()).ok());
        files.any(|file| file.to_string_lossy().starts_with("/dev/video"))
    }

    /// Time that its threads have been running on a processor, nanoseconds.
    pub(crate) fn processor_ns(&self) -> u64 {
        let threads = std::fs::read_dir(format!("/proc/{}/task", self.pid())).unwrap().flatten();
        let running = threads.map(|thread| std::fs::read_to_string(thread.path().join("schedstat")).unwrap());
        running.map(|text| text.split(' ').next().unwrap().parse::<u64>().unwrap()).sum()
    }
}

impl Drop for Capture<'_> {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Images that the driver's numbers miss between those that came. What the channel lost on the way here is none of them.
pub(crate) fn gaps(headers: &[FrameHeader]) -> u64 {
    let step = |pair: &[FrameHeader], number: fn(&FrameHeader) -> u64| number(&pair[1]) - number(&pair[0]);
    headers.windows(2).map(|pair| step(pair, |h| h.sequence) - step(pair, |h| h.published)).sum()
}

/// The images of each session of the camera.
pub(crate) fn sessions(headers: &[FrameHeader]) -> Vec<&[FrameHeader]> {
    headers.chunk_by(|a, b| a.session == b.session).collect()
}
