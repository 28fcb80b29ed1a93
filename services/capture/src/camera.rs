//! A camera that is found, opened, configured and streamed, and that recovers from failures.
//!
//! In: the answers of the driver. Out: images with numbers and times, and incidents for the log and the account. A
//! camera that is unplugged is closed and searched for until it returns, under whatever device number. If a camera
//! refuses calls or, running free, falls silent, its stream is restarted. If that fails, or the silence goes on, the
//! whole device is reopened.

use std::rc::Rc;
use std::time::Duration;

use rustix::io::Errno;

use fringeflow_config::{Trigger, V4l2Camera};
use fringeflow_message::{DropReason, Incident};
use fringeflow_runtime::clock;

use crate::device::{self, CameraError, FindError, Prepared, Wanted};
use crate::incident_log::IncidentLog;
use crate::ioctl::{CallError, Device};
use crate::numbering::{Numbered, Numbering};
use crate::queue::{FilledBuffer, Queue, Waited};
use crate::time_stamps::{StampClock, StampFault, Stamped, Timing};

/// `V4L2_BUF_FLAG_ERROR`: the image is damaged.
const BUF_FLAG_ERROR: u32 = 0x40;
/// Refused calls in a row before the stream is restarted; some errors are transient.
const MAX_REFUSALS: u32 = 3;
/// Timeouts in a row before the device is reopened.
const MAX_TIMEOUTS: u32 = 3;
/// Time between two searches for an absent device, nanoseconds.
const SEARCH_INTERVAL_NS: u64 = 500_000_000;
/// Shortest and longest wait before a device that refused a call is opened again, nanoseconds.
const MIN_BACKOFF_NS: u64 = 50_000_000;
const MAX_BACKOFF_NS: u64 = 5_000_000_000;

/// A camera.
pub(crate) struct Camera {
    settings: V4l2Camera,
    wanted: Wanted,
    state: State,
    /// Whether the device has accepted the settings before.
    has_accepted_settings: bool,
    /// Whether the device was unplugged and is searched for.
    is_unplugged: bool,
    /// Whether its absence was logged.
    is_absence_logged: bool,
    pub(crate) incidents: IncidentLog,
}

enum State {
    /// The device is closed.
    Closed {
        /// Time of the next attempt to open it.
        next_ns: u64,
        /// Failed attempts in a row.
        failures: u32,
    },
    Streaming(Box<Streaming>),
}

struct Streaming {
    device: Rc<Device>,
    prepared: Prepared,
    queue: Queue,
    session: u64,
    numbering: Numbering,
    stamps: StampClock,
    /// Arrival of the last image; before the first image, start of the stream.
    last_image_ns: u64,
    /// Start of the current timeout: the last image, the start of the stream, or the last timeout.
    timeout_start_ns: u64,
    /// Timeouts in a row.
    timeouts: u32,
    /// Refused calls in a row.
    refusals: u32,
}

/// An image in a buffer of the driver. The buffer must be given back.
pub(crate) struct Image {
    buffer: FilledBuffer,
    /// Session: a new one begins with each stream, and whenever numbers or times restart.
    pub(crate) session: u64,
    /// Number of the image in its session.
    pub(crate) number: u64,
    /// Number of images lost before this one.
    pub(crate) missing: u64,
    /// Arrival of the image.
    pub(crate) received_ns: u64,
    /// Start of the exposure, or the reason why the image is dropped.
    pub(crate) stamped: Result<Stamped, DropReason>,
}

impl Camera {
    pub(crate) fn new(settings: V4l2Camera, wanted: Wanted) -> Self {
        let state = State::Closed { next_ns: 0, failures: 0 };
        Self {
            settings,
            wanted,
            state,
            has_accepted_settings: false,
            is_unplugged: false,
            is_absence_logged: false,
            incidents: IncidentLog::default(),
        }
    }

    /// Opens the device and starts its stream, unless it streams already or the next attempt is not due yet.
    ///
    /// # Errors
    /// The device refuses settings that it has never accepted, or cannot be used as configured: the configuration must
    /// change.
    pub(crate) fn ensure_streaming(&mut self) -> Result<(), CameraError> {
        let State::Closed { next_ns, failures } = self.state else { return Ok(()) };
        if clock::now_ns() < next_ns {
            return Ok(());
        }
        match self.open() {
            Ok(streaming) => {
                self.has_accepted_settings = true;
                self.set_streaming(streaming);
            }
            Err(CameraError::Find(error @ FindError::Absent { .. })) => self.wait_for_device(&error, failures),
            Err(error) if error.is_lasting() && !self.has_accepted_settings => return Err(error),
            Err(error) => {
                self.incidents.add(Incident::CallRefused, error.to_string());
                self.back_off(failures);
            }
        }
        Ok(())
    }

    /// Stops the stream and closes the device.
    pub(crate) fn close(&mut self) {
        self.state = State::Closed { next_ns: 0, failures: 0 };
    }

    /// Waits for an image. Returns `false` at once if no stream runs.
    pub(crate) fn wait(&mut self, timeout: Duration) -> bool {
        let State::Streaming(streaming) = &mut self.state else { return false };
        match streaming.queue.wait(timeout) {
            Ok(Waited::Ready | Waited::TimedOut | Waited::Interrupted) => {}
            Err(error) => self.handle_refusal(&error),
        }
        true
    }

    /// Returns the next image that has arrived.
    pub(crate) fn next_image(&mut self) -> Option<Image> {
        let State::Streaming(streaming) = &mut self.state else { return None };
        let dequeued = streaming.queue.dequeue();
        // Read after the call: the driver may delay the call, and no image may begin after its arrival.
        let now_ns = clock::now_ns();
        let interrupted = streaming.device.take_interruptions();
        self.incidents.add_many(Incident::Interrupted, interrupted, "signals interrupt the calls to the driver");
        match dequeued {
            Ok(Some(buffer)) => Some(streaming.number_and_stamp(buffer, now_ns, &mut self.incidents)),
            Ok(None) => {
                self.check_timeout(now_ns);
                None
            }
            Err(error) => {
                self.handle_refusal(&error);
                None
            }
        }
    }

    /// Returns the properties of the device as it was set; `None` while it is closed.
    pub(crate) fn prepared(&self) -> Option<&Prepared> {
        match &self.state {
            State::Streaming(streaming) => Some(&streaming.prepared),
            State::Closed { .. } => None,
        }
    }

    /// Returns the bytes of an image as the camera sent them.
    pub(crate) fn bytes<'a>(&'a self, image: &'a Image) -> &'a [u8] {
        match &self.state {
            State::Streaming(streaming) => streaming.queue.bytes(&image.buffer),
            State::Closed { .. } => &[],
        }
    }

    /// Gives the buffer of an image back to the driver.
    pub(crate) fn give_back(&mut self, image: Image) {
        let State::Streaming(streaming) = &mut self.state else { return };
        match streaming.queue.requeue(image.buffer) {
            Ok(()) => streaming.refusals = 0,
            Err(error) => self.handle_refusal(&error),
        }
    }

    fn open(&self) -> Result<Streaming, CameraError> {
        let (path, device, prepared) = device::open(&self.settings, &self.wanted)?;
        tracing::info!("{}: {}", path.display(), prepared.notes.join(", "));
        Streaming::start(Rc::new(device), prepared, &self.settings, &self.wanted)
            .map_err(|source| CameraError::Stream { path, source })
    }

    /// Schedules the next search for an absent device. Its absence is logged once.
    fn wait_for_device(&mut self, error: &FindError, failures: u32) {
        if !self.is_unplugged && !std::mem::replace(&mut self.is_absence_logged, true) {
            tracing::warn!("waiting for a camera: {error}");
        }
        self.state = State::Closed { next_ns: clock::now_ns() + SEARCH_INTERVAL_NS, failures };
    }

    fn set_streaming(&mut self, streaming: Streaming) {
        self.is_absence_logged = false;
        if std::mem::take(&mut self.is_unplugged) {
            self.incidents.add(Incident::Returned, format!("{} is back", self.settings.device));
        }
        self.state = State::Streaming(Box::new(streaming));
    }

    fn back_off(&mut self, failures: u32) {
        let wait_ns = (MIN_BACKOFF_NS << failures.min(7)).min(MAX_BACKOFF_NS);
        self.state = State::Closed { next_ns: clock::now_ns() + wait_ns, failures: failures + 1 };
    }

    /// Counts a call that the driver refused. Closes a device that is gone; restarts the stream after too many
    /// refusals.
    fn handle_refusal(&mut self, error: &CallError) {
        let State::Streaming(streaming) = &mut self.state else { return };
        if error.errno() == Some(Errno::NODEV) {
            self.incidents.add(Incident::Unplugged, format!("{} is gone: {error}", self.settings.device));
            self.is_unplugged = true;
            self.state = State::Closed { next_ns: clock::now_ns() + SEARCH_INTERVAL_NS, failures: 0 };
            return;
        }
        self.incidents.add(Incident::CallRefused, format!("{}: {error}", self.settings.device));
        streaming.refusals += 1;
        if streaming.refusals >= MAX_REFUSALS {
            self.restart("the driver refuses calls");
        }
    }

    /// Queues again the buffers that the driver refused, and checks whether the camera has been silent for too long.
    fn check_timeout(&mut self, now_ns: u64) {
        let State::Streaming(streaming) = &mut self.state else { return };
        if let Err(error) = streaming.queue.retry_refused() {
            return self.handle_refusal(&error);
        }
        let timeout_ns = self.settings.timeout_ns;
        if now_ns.saturating_sub(streaming.timeout_start_ns) < timeout_ns {
            return;
        }
        let silent_ms = now_ns.saturating_sub(streaming.last_image_ns) / 1_000_000;
        streaming.timeout_start_ns = now_ns;
        streaming.timeouts += 1;
        // With an external trigger silence is no fault, and only the first timeout is counted.
        let is_fault = self.settings.trigger == Trigger::Free;
        if is_fault || streaming.timeouts == 1 {
            self.incidents.add(Incident::TimeOut, format!("{}: no image for {silent_ms} ms", self.settings.device));
        }
        match streaming.timeouts {
            _ if !is_fault => {}
            1..MAX_TIMEOUTS => self.restart("the camera is silent"),
            _ => self.close(),
        }
    }

    /// Restarts the stream on the same device. Closes the device if that fails.
    fn restart(&mut self, why: &str) {
        let closed = State::Closed { next_ns: 0, failures: 0 };
        let State::Streaming(old) = std::mem::replace(&mut self.state, closed) else { return };
        self.incidents
            .add(Incident::StreamRestart, format!("{}: {why}; its stream is restarted", self.settings.device));
        let Streaming { device, prepared, queue, timeouts, last_image_ns, .. } = *old;
        // The driver allocates no new buffers before the old ones are freed.
        drop(queue);
        match Streaming::start(device, prepared, &self.settings, &self.wanted) {
            Ok(streaming) => self.set_streaming(Streaming { timeouts, last_image_ns, ..streaming }),
            Err(error) => {
                self.incidents.add(Incident::CallRefused, format!("{}: {error}", self.settings.device));
                self.back_off(0);
            }
        }
    }
}

impl Streaming {
    fn start(
        device: Rc<Device>,
        prepared: Prepared,
        settings: &V4l2Camera,
        wanted: &Wanted,
    ) -> Result<Self, CallError> {
        let queue = Queue::start(Rc::clone(&device), prepared.kind, settings.buffers)?;
        let timing = Timing {
            period_ns: (1e9 / wanted.rate_hz) as u64,
            exposure_ns: prepared.exposure_ns.unwrap_or(0),
            readout_ns: settings.readout_ns,
            moment: settings.stamp,
        };
        let now_ns = clock::now_ns();
        Ok(Self {
            device,
            prepared,
            queue,
            session: now_ns,
            numbering: Numbering::default(),
            stamps: StampClock::new(timing),
            last_image_ns: now_ns,
            timeout_start_ns: now_ns,
            timeouts: 0,
            refusals: 0,
        })
    }

    /// Numbers an image and finds the start of its exposure.
    fn number_and_stamp(&mut self, buffer: FilledBuffer, now_ns: u64, incidents: &mut IncidentLog) -> Image {
        (self.last_image_ns, self.timeout_start_ns, self.timeouts, self.refusals) = (now_ns, now_ns, 0, 0);
        let metadata = buffer.metadata;
        let (number, missing, stamped) = if metadata.flags & BUF_FLAG_ERROR != 0 {
            (0, self.numbering.extend_damaged(metadata.sequence), Err(DropReason::BadImage))
        } else {
            let numbered = self.numbering.extend(metadata.sequence);
            if let Numbered::Restarted { number } = numbered {
                incidents
                    .add(Incident::NumberingRestart, format!("the driver restarted its image numbers at {number}"));
                // Numbers before and after the restart cannot be compared.
                self.session = now_ns;
            }
            match numbered {
                Numbered::Repeated => (0, 0, Err(DropReason::Duplicate)),
                Numbered::Restarted { number } => (number, 0, self.stamp(&buffer, now_ns, incidents)),
                Numbered::Next { number, missing } => (number, missing, self.stamp(&buffer, now_ns, incidents)),
            }
        };
        Image { buffer, session: self.session, number, missing, received_ns: now_ns, stamped }
    }

    fn stamp(
        &mut self,
        buffer: &FilledBuffer,
        now_ns: u64,
        incidents: &mut IncidentLog,
    ) -> Result<Stamped, DropReason> {
        let stamped = self.stamps.convert(buffer.metadata.stamp, buffer.metadata.flags, now_ns);
        match stamped.fault {
            None => Ok(stamped),
            Some(StampFault::Ahead { by_ns }) => {
                let by_ms = by_ns as f64 * 1e-6;
                incidents.add(
                    Incident::StampAhead,
                    format!("time stamps are {by_ms:.3} ms later than the arrival of their images"),
                );
                Ok(stamped)
            }
            Some(StampFault::Jump) => {
                incidents.add(
                    Incident::StampJump,
                    "time stamps jump or use an unknown clock; times are now relative to the arrival of an image",
                );
                // Times before and after the jump cannot be compared.
                self.session = now_ns;
                Ok(stamped)
            }
            Some(StampFault::Repeated) => Err(DropReason::BadTime),
        }
    }
}
