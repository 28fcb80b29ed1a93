//! Makes windows of messages: the synchronizer, its ports, and the accounts with its counts.
//!
//! In: images and pattern events. Out: the images of complete windows.

use std::time::Duration;

use fringeflow_config::{ProjectorDriver, ScannerConfiguration};
use fringeflow_dataset::Setup;
use fringeflow_message::synchronization::{Settings, SkewNotice, StepSource, Synchronizer, WindowImages};
use fringeflow_message::{Counts, DropReason, FrameHeader, Incident, PatternEvent, PixelFormat, Stage};
use fringeflow_runtime::{Account, AccountError, Arrivals, Host, ServiceError, receive};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, PROJECTOR_PATTERN, Received, Subscriber, TransportError, wait_for};

use crate::phase::image::Image;

/// Number of images of a camera, beyond a window, that may wait for their partner or their step.
const WAITING_BEYOND_WINDOW: usize = 3;

/// Ports, synchronizer and accounts.
pub(crate) struct Intake {
    cameras: [Subscriber<FrameHeader, [u8]>; 2],
    events: Subscriber<(), PatternEvent>,
    synchronizer: Synchronizer<Image>,
    size_px: [usize; 2],
    format: PixelFormat,
    pattern: StageAccount,
    pairing: StageAccount,
    windowing: StageAccount,
    /// Arrivals of the images of camera 1 and 2.
    frame_arrivals: [Arrivals; 2],
    /// Session and number of the last event that was counted as lost before this process listened.
    lost_event: Option<[u64; 2]>,
}

/// An account whose counts the synchronizer keeps.
struct StageAccount {
    stage: Stage,
    account: Account,
    /// Counts before this process, to which those of the synchronizer are added.
    before: Counts,
}

impl Intake {
    pub(crate) fn open(host: &Host) -> Result<Self, ServiceError> {
        let (node, sizes) = (&host.node, &host.sizes);
        let cameras = [Subscriber::open(node, CAM1_FRAME, sizes)?, Subscriber::open(node, CAM2_FRAME, sizes)?];
        let events = Subscriber::open(node, PROJECTOR_PATTERN, sizes)?;
        let settings = settings(&host.configuration, &host.setup);
        let mut synchronizer = Synchronizer::new(settings).map_err(|e| ServiceError::Unusable(e.to_string()))?;
        // In the order of the pipeline, because each stage catches up with the stages before it.
        let pattern = StageAccount::open(host, Stage::Pattern)?;
        let pairing = StageAccount::open(host, Stage::Pairing)?;
        let windowing = StageAccount::open(host, Stage::Windowing)?;
        let frame_arrivals = [0, 1].map(|camera| *pairing.account.arrivals(camera));
        for (camera, arrivals) in (1..).zip(&frame_arrivals) {
            synchronizer.expect_frame(camera, arrivals.next);
        }
        // Read after the account has caught up. An event sent in between is counted at the end of the run.
        let lost_event = host.read_last_item(Stage::Projector);
        let size_px = host.setup.image_size_px;
        Ok(Self {
            cameras,
            events,
            synchronizer,
            size_px,
            format: host.configuration.pixel_format(),
            pattern,
            pairing,
            windowing,
            frame_arrivals,
            lost_event,
        })
    }

    /// Waits for messages, at most for `timeout`.
    pub(crate) fn wait(&self, timeout: Duration) -> Result<(), TransportError> {
        wait_for(&[&self.cameras[0], &self.cameras[1], &self.events], timeout)
    }

    /// Receives all waiting messages, one of each channel in turn. Calls `on_window` with the number and the images of
    /// each window as soon as it is complete.
    pub(crate) fn drain(
        &mut self,
        mut on_window: impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        loop {
            let has_received = self.receive_event() | self.receive_frame(0) | self.receive_frame(1);
            self.hand_out_windows(&mut on_window)?;
            if !has_received {
                return Ok(());
            }
        }
    }

    /// Ends the run: drops the images that wait for their partner or their step.
    pub(crate) fn end(
        &mut self,
        mut on_window: impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        self.synchronizer.end();
        self.hand_out_windows(&mut on_window)
    }

    /// Counts the messages of cameras and projector as lost that never arrived.
    pub(crate) fn close(&mut self, host: &Host) -> Result<(), AccountError> {
        for stage in [&mut self.pattern, &mut self.pairing, &mut self.windowing] {
            host.catch_up(&mut stage.account, DropReason::Overrun)?;
        }
        Ok(())
    }

    /// Reports all three stages.
    pub(crate) fn report(&mut self, host: &mut Host) {
        let skew = self.synchronizer.take_skew();
        host.report(Stage::Pattern, self.pattern.account.counts(), None);
        host.report_with_skew(Stage::Pairing, self.pairing.account.counts(), None, skew);
        host.report(Stage::Windowing, self.windowing.account.counts(), None);
    }

    /// Accepts the silence of ports that have received all messages in the accounts of their senders. If a sender has
    /// no account, silence is the only sign of a lost connection.
    pub(crate) fn forgive_silence(&mut self, host: &Host) {
        let has_all = |stage: &StageAccount, from| host.read_counts(from).is_some() && !host.is_behind(&stage.account);
        if has_all(&self.pairing, Stage::Camera1) {
            self.cameras.iter_mut().for_each(Subscriber::forgive_silence);
        }
        if has_all(&self.pattern, Stage::Projector) {
            self.events.forgive_silence();
        }
    }

    /// Opens ports again that lost their connection.
    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.events.ensure_connected(now_ns)?;
        self.cameras.iter_mut().try_for_each(|camera| camera.ensure_connected(now_ns).map(|_| ()))
    }

    /// Receives an event; `false` if none waits.
    fn receive_event(&mut self) -> bool {
        let Some(event) = receive(&mut self.events) else { return false };
        let is_lost = |[session, sequence]: [u64; 2]| event.session == session && event.sequence <= sequence;
        if !self.lost_event.is_some_and(is_lost) {
            self.synchronizer.push_pattern(*event);
        }
        true
    }

    /// Receives an image of camera 0 or 1; `false` if none waits.
    fn receive_frame(&mut self, camera: usize) -> bool {
        let Some(frame) = receive(&mut self.cameras[camera]) else { return false };
        // The channel determines the camera: with a wrong number in the header, the image would count for the other
        // one.
        let header = FrameHeader { camera: camera as u32 + 1, ..*frame.header() };
        if self.frame_arrivals[camera].arrive(header.published).is_some() {
            self.push_frame(header, frame);
        }
        true
    }

    fn push_frame(&mut self, header: FrameHeader, frame: Received<FrameHeader, [u8]>) {
        match Image::from_received(frame, self.size_px, self.format) {
            Ok(image) => self.synchronizer.push_frame(header, image),
            Err(reason) => self.synchronizer.refuse_frame(&header, reason),
        }
    }

    /// Writes the accounts and then hands out the windows, so that the counts include every window handed out.
    fn hand_out_windows(
        &mut self,
        on_window: &mut impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        let first = self.windowing.account.counts().passed;
        self.write_accounts()?;
        while let Some(notice) = self.synchronizer.next_skew_notice() {
            log_skew(notice);
        }
        for number in first.. {
            let Some(window) = self.synchronizer.next_window() else { break };
            on_window(number, window)?;
        }
        Ok(())
    }

    fn write_accounts(&mut self) -> Result<(), AccountError> {
        self.pattern.write(&self.synchronizer, &[])?;
        self.pairing.write(&self.synchronizer, &self.frame_arrivals.map(|arrivals| arrivals.next))?;
        self.windowing.write(&self.synchronizer, &[])
    }
}

impl StageAccount {
    fn open(host: &Host, stage: Stage) -> Result<Self, AccountError> {
        let mut account = host.open_account(stage)?;
        host.catch_up(&mut account, DropReason::Restart)?;
        let before = *account.counts();
        Ok(Self { stage, account, before })
    }

    /// Writes the counts of the synchronizer, added to those before. `next` has the numbers of the next messages by
    /// source; if it is empty, the number of taken items is the next number.
    fn write(&mut self, synchronizer: &Synchronizer<Image>, next: &[u64]) -> Result<(), AccountError> {
        let Some(counted) = synchronizer.counts(self.stage) else { return Ok(()) };
        let counts = self.before.plus(counted);
        if counts == *self.account.counts() {
            return Ok(());
        }
        let taken = [counts.taken];
        self.account.set(&counts, if next.is_empty() { &taken } else { next })
    }
}

/// Logs that the cameras began or ceased to expose too far apart, with the remedy.
fn log_skew(notice: SkewNotice) {
    let ms = |ns: u64| ns as f64 * 1e-6;
    match notice {
        SkewNotice::Began { skew_ns, max_skew_ns } => tracing::warn!(
            incident = Incident::Skewed.name(),
            "camera 2 exposes {:.3} ms {} camera 1, more than cameras.max_skew_us allows ({:.3} ms): such pairs are \
             dropped. Trigger both cameras by one signal, or use a module whose two sensors are synchronized. If they \
             are, check stamp, exposure_us and readout_us of both",
            ms(skew_ns.unsigned_abs()),
            if skew_ns < 0 { "before" } else { "after" },
            ms(max_skew_ns),
        ),
        SkewNotice::Ended { refused_pairs } => {
            tracing::info!("{refused_pairs} image pairs were dropped because the cameras exposed too far apart");
        }
    }
}

fn settings(configuration: &ScannerConfiguration, setup: &Setup) -> Settings {
    let period_px = setup.sequence.pattern.period_px;
    let images = configuration.measurement.settings.window_images(setup.steps);
    Settings {
        steps: setup.steps,
        images,
        frame_period_ns: configuration.frame_period_ns(),
        max_skew_ns: configuration.max_skew_ns,
        source: match configuration.projector {
            ProjectorDriver::Cycle => StepSource::Cycle,
            ProjectorDriver::Virtual | ProjectorDriver::External => StepSource::Events { period_px },
        },
        window_stride: configuration.window_every,
        // This is enough if one message of each channel is taken in turn. The channel lets this service hold these
        // images, those of the present run, and those of a window that waits for the next stage.
        max_waiting: images + WAITING_BEYOND_WINDOW,
    }
}
