//! From messages to windows: the synchronizer, its ports, and the accounts of what it counts.

use std::time::Duration;

use fringeflow_config::{ProjectorDriver, ScannerConfiguration};
use fringeflow_dataset::Setup;
use fringeflow_message::synchronization::{Settings, StepSource, Synchronizer, WindowImages};
use fringeflow_message::{Counts, DropReason, FrameHeader, PatternEvent, PixelFormat, Stage};
use fringeflow_runtime::{Account, AccountError, Arrivals, Host, ServiceError, receive};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, PROJECTOR_PATTERN, Received, Subscriber, TransportError, wait_for};

use crate::phase::image::Image;

/// Images of a camera, beyond a window, that may wait for their partner or their step.
const WAITING_BEYOND_WINDOW: usize = 3;

/// Ports, synchronizer and accounts.
pub(crate) struct Intake {
    cameras: [Subscriber<FrameHeader, [u8]>; 2],
    events: Subscriber<(), PatternEvent>,
    synchronizer: Synchronizer<Image>,
    size_px: [usize; 2],
    format: PixelFormat,
    pattern: Ledger,
    pairing: Ledger,
    windowing: Ledger,
    /// What came of the images of camera 1 and 2.
    frame_arrivals: [Arrivals; 2],
    /// The last event that was counted as lost before this process listened: session and number.
    lost_event: Option<[u64; 2]>,
}

/// An account whose counts the synchronizer keeps since this process began.
struct Ledger {
    stage: Stage,
    account: Account,
    /// Counts before this process.
    before: Counts,
}

impl Intake {
    pub(crate) fn open(host: &Host) -> Result<Self, ServiceError> {
        let (node, sizes) = (&host.node, &host.sizes);
        let cameras = [Subscriber::open(node, CAM1_FRAME, sizes)?, Subscriber::open(node, CAM2_FRAME, sizes)?];
        let events = Subscriber::open(node, PROJECTOR_PATTERN, sizes)?;
        let settings = settings(&host.configuration, &host.setup);
        let mut synchronizer = Synchronizer::new(settings).map_err(|e| ServiceError::Unusable(e.to_string()))?;
        // In the order of the pipeline: each catches up with what the one before has put out.
        let pattern = Ledger::open(host, Stage::Pattern)?;
        let pairing = Ledger::open(host, Stage::Pairing)?;
        let windowing = Ledger::open(host, Stage::Windowing)?;
        let frame_arrivals = [0, 1].map(|camera| *pairing.account.arrivals(camera));
        for (camera, arrivals) in (1..).zip(&frame_arrivals) {
            synchronizer.expect_frame(camera, arrivals.next);
        }
        // Read after the account has caught up: an event announced in between is counted at the end.
        let lost_event = host.last_of(Stage::Projector);
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

    /// Waits for messages, at most so long.
    pub(crate) fn wait(&self, longest: Duration) -> Result<(), TransportError> {
        wait_for(&[&self.cameras[0], &self.cameras[1], &self.events], longest)
    }

    /// Takes what has come, one message of each channel in turn; `on_window` is given each window with its number as soon as
    /// it is complete.
    pub(crate) fn drain(
        &mut self,
        mut on_window: impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        loop {
            let any = self.take_event() | self.take_frame(0) | self.take_frame(1);
            self.put_out(&mut on_window)?;
            if !any {
                return Ok(());
            }
        }
    }

    /// Ends the run: what still waits for its partner is dropped.
    pub(crate) fn end(
        &mut self,
        mut on_window: impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        self.synchronizer.end();
        self.put_out(&mut on_window)
    }

    /// Counts what the cameras and the projector put out and never came.
    pub(crate) fn close(&mut self, host: &Host) -> Result<(), AccountError> {
        for ledger in [&mut self.pattern, &mut self.pairing, &mut self.windowing] {
            host.catch_up(&mut ledger.account, DropReason::Overrun)?;
        }
        Ok(())
    }

    /// Reports all three stages.
    pub(crate) fn report(&mut self, host: &mut Host) {
        let skew = self.synchronizer.take_skew();
        host.report(Stage::Pattern, self.pattern.account.counts(), None);
        host.report_pairs(Stage::Pairing, self.pairing.account.counts(), None, skew);
        host.report(Stage::Windowing, self.windowing.account.counts(), None);
    }

    /// Forgives the silence of ports that by the accounts were sent nothing that has not come. Where nobody keeps accounts,
    /// silence alone must tell of a lost connection.
    pub(crate) fn forgive_silence(&mut self, host: &Host) {
        let has_all = |ledger: &Ledger, from| host.counts_of(from).is_some() && !host.is_behind(&ledger.account);
        if has_all(&self.pairing, Stage::Camera1) {
            self.cameras.iter_mut().for_each(Subscriber::forgive_silence);
        }
        if has_all(&self.pattern, Stage::Projector) {
            self.events.forgive_silence();
        }
    }

    /// Opens ports again that lost their other side.
    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.events.ensure_connected(now_ns)?;
        self.cameras.iter_mut().try_for_each(|camera| camera.ensure_connected(now_ns).map(|_| ()))
    }

    fn take_event(&mut self) -> bool {
        let Some(event) = receive(&mut self.events) else { return false };
        let is_lost = |[session, sequence]: [u64; 2]| event.session == session && event.sequence <= sequence;
        if !self.lost_event.is_some_and(is_lost) {
            self.synchronizer.push_pattern(*event);
        }
        true
    }

    fn take_frame(&mut self, camera: usize) -> bool {
        let Some(frame) = receive(&mut self.cameras[camera]) else { return false };
        // The channel says which camera it is; a header that says otherwise would count under the other one.
        let header = FrameHeader { camera: camera as u32 + 1, ..*frame.header() };
        if self.frame_arrivals[camera].arrive(header.published).is_some() {
            self.admit(header, frame);
        }
        true
    }

    fn admit(&mut self, header: FrameHeader, frame: Received<FrameHeader, [u8]>) {
        match Image::of(frame, self.size_px, self.format) {
            Ok(image) => self.synchronizer.push_frame(header, image),
            Err(reason) => self.synchronizer.refuse_frame(&header, reason),
        }
    }

    /// Writes the accounts, then hands out the windows: what is counted is never behind what was put out.
    fn put_out(
        &mut self,
        on_window: &mut impl FnMut(u64, WindowImages<Image>) -> Result<(), ServiceError>,
    ) -> Result<(), ServiceError> {
        let first = self.windowing.account.counts().passed;
        self.write()?;
        for number in first.. {
            let Some(window) = self.synchronizer.next_window() else { break };
            on_window(number, window)?;
        }
        Ok(())
    }

    fn write(&mut self) -> Result<(), AccountError> {
        self.pattern.write(&self.synchronizer, &[])?;
        self.pairing.write(&self.synchronizer, &self.frame_arrivals.map(|arrivals| arrivals.next))?;
        self.windowing.write(&self.synchronizer, &[])
    }
}

impl Ledger {
    fn open(host: &Host, stage: Stage) -> Result<Self, AccountError> {
        let mut account = host.account(stage)?;
        host.catch_up(&mut account, DropReason::Restart)?;
        let before = *account.counts();
        Ok(Self { stage, account, before })
    }

    /// Writes the counts of the synchronizer on top of those before; a stage without numbered messages numbers its items by
    /// what it took.
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

fn settings(configuration: &ScannerConfiguration, setup: &Setup) -> Settings {
    let period_px = setup.sequence.pattern.period_px;
    let images = configuration.measurement.settings.window_images(setup.steps);
    Settings {
        steps: setup.steps,
        images,
        frame_period_ns: configuration.frame_period_ns(),
        source: match configuration.projector {
            ProjectorDriver::Cycle => StepSource::Cycle,
            ProjectorDriver::Virtual | ProjectorDriver::External => StepSource::Events { period_px },
        },
        window_stride: configuration.window_every,
        // Enough where one message of each channel is taken in turn; the channel lets this service hold these, the images of
        // the present run, and a window that waits for the next stage.
        max_waiting: images + WAITING_BEYOND_WINDOW,
    }
}
