//! A capture service alone, whose every image is seen.

use std::fs;
use std::process::{Child, Stdio};

use rustix::process::Signal;

use fringeflow_message::{Counts, DropReason, FrameHeader, Incident, Stage};
use fringeflow_runtime::{ServiceArgs, channel_sizes};

use crate::support::{Bench, send, wait};

use super::witness::Witness;

/// The capture service of camera 1 of a bench; killed when it is dropped.
pub(crate) struct Capture<'a> {
    bench: &'a Bench,
    child: Child,
    pub(crate) witness: Witness,
}

/// What a service has sent and counted.
pub(crate) struct Done {
    /// Headers of its images.
    pub(crate) headers: Vec<FrameHeader>,
    /// Its account.
    pub(crate) counts: Counts,
}

impl<'a> Capture<'a> {
    /// Starts it in an instance that scans; what it logs goes to the output of the test.
    pub(crate) fn start(bench: &'a Bench) -> Self {
        let config = bench.configuration();
        let arguments =
            ServiceArgs { config: config.clone(), setup: None, segment_table: None, restarts: 0, supervised: false };
        let configuration = arguments.configuration().unwrap();
        let sizes = channel_sizes(&arguments.setup(&configuration).unwrap(), &configuration);
        let witness = Witness::new(&bench.instance(), sizes);
        let mut service = bench.command(&[&"service", &"camera1", &"--config", &config]);
        let child = service.stdin(Stdio::null()).spawn().unwrap();
        Self { bench, child, witness }
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

    /// Waits for so many more images.
    pub(crate) fn images(&mut self, more: usize) {
        self.images_of(more, || {});
    }

    /// Waits for so many images that come of doing something.
    pub(crate) fn images_of(&mut self, more: usize, act: impl FnOnce()) {
        let enough = self.witness.images() + more;
        act();
        self.until("enough images are here", |capture| capture.witness.images() >= enough);
    }

    /// Waits until something is so.
    pub(crate) fn until(&mut self, what: &str, mut is: impl FnMut(&Self) -> bool) {
        let reached = wait(|| {
            assert!(self.child.try_wait().unwrap().is_none(), "the service has ended: {:?}", self.counts());
            is(self)
        });
        assert!(reached, "it never is that {what}: {} images seen of {:?}", self.witness.images(), self.counts());
    }

    /// Ends the scan, waits until the device is closed and all images are here, and ends the service as the system would.
    /// Its account adds up.
    pub(crate) fn stop(mut self) -> Done {
        self.witness.end_scan();
        self.until("the device is closed", |capture| !capture.holds_a_device());
        self.until("all images are here", |capture| {
            capture.witness.last().is_none_or(|last| last.published + 1 == capture.counts().passed)
        });
        send(self.pid(), Signal::TERM);
        assert!(wait(|| self.child.try_wait().unwrap().is_some()), "it does not end");
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
        let counts = self.counts();
        assert_eq!(counts.in_work(), Some(0), "{counts:?}");
        Done { headers: self.witness.headers(), counts }
    }

    /// Whether a video device is open in it.
    pub(crate) fn holds_a_device(&self) -> bool {
        let open = fs::read_dir(format!("/proc/{}/fd", self.pid())).unwrap().flatten();
        let mut files = open.filter_map(|entry| fs::read_link(entry.path()).ok());
        files.any(|file| file.to_string_lossy().starts_with("/dev/video"))
    }

    /// Time that its threads have been running on a processor, nanoseconds.
    pub(crate) fn processor_ns(&self) -> u64 {
        let threads = fs::read_dir(format!("/proc/{}/task", self.pid())).unwrap().flatten();
        let running = threads.map(|thread| fs::read_to_string(thread.path().join("schedstat")).unwrap());
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

impl Done {
    /// The images of each session of the camera.
    pub(crate) fn sessions(&self) -> Vec<&[FrameHeader]> {
        self.headers.chunk_by(|a, b| a.session == b.session).collect()
    }

    /// Incidents of a kind.
    pub(crate) fn incidents(&self, incident: Incident) -> u64 {
        self.counts.incidents[incident as usize]
    }

    /// Asserts that as many images count as lost by the camera as the driver's numbers miss, but for those that were
    /// dropped for another reason.
    pub(crate) fn assert_losses_are_gaps(&self, otherwise: u64) {
        let gaps: u64 = self.sessions().into_iter().map(gaps).sum();
        let lost = self.counts.dropped(DropReason::CameraLost) + otherwise;
        // This machine may be too slow to see every image: what is missing between two sessions tells of no gap.
        let is_joint =
            |pair: &[FrameHeader]| pair[0].session == pair[1].session || pair[0].published + 1 == pair[1].published;
        if self.headers.first().is_none_or(|first| first.published == 0) && self.headers.windows(2).all(is_joint) {
            assert_eq!(lost, gaps, "{:?}", self.counts);
        } else {
            assert!(lost >= gaps, "{gaps} images are missing: {:?}", self.counts);
        }
    }
}

/// Images that the driver's numbers miss between those of a session. What a channel lost is none of them.
pub(crate) fn gaps(headers: &[FrameHeader]) -> u64 {
    let step = |pair: &[FrameHeader], number: fn(&FrameHeader) -> u64| number(&pair[1]) - number(&pair[0]);
    headers.windows(2).map(|pair| step(pair, |h| h.sequence) - step(pair, |h| h.published)).sum()
}
