//! A capture service on its own, with a subscriber that receives all its images.

use std::fs;
use std::process::{Child, Stdio};

use rustix::process::Signal;

use fringeflow_message::{Counts, DropReason, FrameHeader, Incident, Stage};
use fringeflow_runtime::{ServiceArgs, channel_sizes};

use crate::support::{Bench, send, wait_until};

use super::witness::Witness;

/// The capture service of camera 1 in a bench. It is killed on drop.
pub(crate) struct Capture<'a> {
    bench: &'a Bench,
    child: Child,
    pub(crate) witness: Witness,
}

/// Images and counts of a service that has ended.
pub(crate) struct Captured {
    /// Headers of its images.
    pub(crate) headers: Vec<FrameHeader>,
    /// Counts of its stage.
    pub(crate) counts: Counts,
}

impl<'a> Capture<'a> {
    /// Starts the service in an instance that scans. Its log goes to the output of the test.
    pub(crate) fn start(bench: &'a Bench) -> Self {
        let config = bench.configuration();
        let arguments = ServiceArgs { config: config.clone(), ..ServiceArgs::default() };
        let configuration = arguments.configuration().unwrap();
        let sizes = channel_sizes(&arguments.setup(&configuration).unwrap(), &configuration);
        let witness = Witness::new(&bench.instance(), sizes);
        let mut service = bench.command(&[&"service", &"camera1", &"--config", &config]);
        let child = service.stdin(Stdio::null()).spawn().unwrap();
        Self { bench, child, witness }
    }

    /// Its process id.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Counts of its stage so far.
    pub(crate) fn counts(&self) -> Counts {
        self.bench.counts(Stage::Camera1)
    }

    /// Number of incidents of a kind.
    pub(crate) fn incidents(&self, incident: Incident) -> u64 {
        self.counts().incidents[incident as usize]
    }

    /// Waits for this number of further images.
    pub(crate) fn wait_for_images(&mut self, more: usize) {
        self.act_and_wait_for_images(more, || {});
    }

    /// Performs an action, and waits for this number of further images.
    pub(crate) fn act_and_wait_for_images(&mut self, more: usize, act: impl FnOnce()) {
        let target = self.witness.images() + more;
        act();
        self.wait_until("there are enough images", |capture| capture.witness.images() >= target);
    }

    /// Waits until a condition holds. `what` names it in the failure message.
    pub(crate) fn wait_until(&mut self, what: &str, mut condition: impl FnMut(&Self) -> bool) {
        let reached = wait_until(|| {
            assert!(self.child.try_wait().unwrap().is_none(), "the service has ended: {:?}", self.counts());
            condition(self)
        });
        assert!(
            reached,
            "timed out while waiting until {what}: {} images received, {:?}",
            self.witness.images(),
            self.counts()
        );
    }

    /// Ends the scan, waits until the device is closed and all images have arrived, and ends the service by SIGTERM.
    /// Checks that its counts add up.
    pub(crate) fn stop(mut self) -> Captured {
        self.witness.end_scan();
        self.wait_until("the device is closed", |capture| !capture.has_open_device());
        self.wait_until("all images have arrived", |capture| {
            capture.witness.last().is_none_or(|last| last.published + 1 == capture.counts().passed)
        });
        send(self.pid(), Signal::TERM);
        assert!(wait_until(|| self.child.try_wait().unwrap().is_some()), "the service does not end");
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
        let counts = self.counts();
        assert_eq!(counts.in_work(), Some(0), "{counts:?}");
        Captured { headers: self.witness.headers(), counts }
    }

    /// Whether it has an open video device.
    pub(crate) fn has_open_device(&self) -> bool {
        let open = fs::read_dir(format!("/proc/{}/fd", self.pid())).unwrap().flatten();
        let mut files = open.filter_map(|entry| fs::read_link(entry.path()).ok());
        files.any(|file| file.to_string_lossy().starts_with("/dev/video"))
    }

    /// CPU time of its threads, nanoseconds.
    pub(crate) fn cpu_ns(&self) -> u64 {
        let threads = fs::read_dir(format!("/proc/{}/task", self.pid())).unwrap().flatten();
        let running = threads.map(|thread| fs::read_to_string(thread.path().join("schedstat")).unwrap());
        running.map(|text| text.split(' ').next().unwrap().parse::<u64>().unwrap()).sum()
    }
}

impl Drop for Capture<'_> {
    fn drop(&mut self) {
        // Both fail if it has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Captured {
    /// The images, grouped by camera session.
    pub(crate) fn sessions(&self) -> Vec<&[FrameHeader]> {
        self.headers.chunk_by(|a, b| a.session == b.session).collect()
    }

    /// Number of incidents of a kind.
    pub(crate) fn incidents(&self, incident: Incident) -> u64 {
        self.counts.incidents[incident as usize]
    }

    /// Asserts that the images counted as lost by the camera, plus `other_drops`, are the gaps in the driver's numbers.
    pub(crate) fn assert_losses_are_gaps(&self, other_drops: u64) {
        let gaps: u64 = self.sessions().into_iter().map(gaps).sum();
        let lost = self.counts.dropped(DropReason::CameraLost) + other_drops;
        // A slow machine may not receive every image. If images are missing between two sessions, gaps there are not
        // visible.
        let is_contiguous =
            |pair: &[FrameHeader]| pair[0].session == pair[1].session || pair[0].published + 1 == pair[1].published;
        if self.headers.first().is_none_or(|first| first.published == 0) && self.headers.windows(2).all(is_contiguous) {
            assert_eq!(lost, gaps, "{:?}", self.counts);
        } else {
            assert!(lost >= gaps, "{gaps} images are missing: {:?}", self.counts);
        }
    }
}

/// Counts images missing in the driver's numbers of a session, without images that the channel lost.
pub(crate) fn gaps(headers: &[FrameHeader]) -> u64 {
    let step = |pair: &[FrameHeader], number: fn(&FrameHeader) -> u64| number(&pair[1]) - number(&pair[0]);
    headers.windows(2).map(|pair| step(pair, |h| h.sequence) - step(pair, |h| h.published)).sum()
}
