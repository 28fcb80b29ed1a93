//! The life of a camera: found, opened, set, streaming; and what is tried when one of these fails.
//!
//! In: what the driver says. Out: images with their numbers and times, and notes of all that went wrong. A camera that is
//! unplugged is closed, looked for, and begun anew under whatever number it returns; one that refuses calls or falls silent
//! is stopped and begun anew, first its stream, then the whole device.

use std::rc::Rc;
use std::time::Duration;

use rustix::io::Errno;

use fringeflow_config::{Trigger, V4l2Camera};
use fringeflow_message::{DropReason, Incident};
use fringeflow_runtime::clock;

use crate::device::{self, CameraError, FindError, Prepared, Wanted};
use crate::ioctl::{CallError, Device};
use crate::notes::Notes;
use crate::numbering::{Numbered, Numbering};
use crate::queue::{FilledBuffer, Queue, Waited};
use crate::stamp::{StampClock, StampFault, Stamped, Timing};

/// Flag of V4L2: the image is damaged.
const ERROR: u32 = 0x40;
/// Refused calls in a row before the stream is begun anew; some errors pass.
const MOST_REFUSALS: u32 = 3;
/// Silences in a row before the device is opened anew.
const MOST_SILENCES: u32 = 3;
/// Time between two looks for a device that is not there, nanoseconds.
const LOOK_NS: u64 = 500_000_000;
/// Shortest and longest wait before a device that refused is tried again, nanoseconds.
const FIRST_WAIT_NS: u64 = 50_000_000;
const LONGEST_WAIT_NS: u64 = 5_000_000_000;

/// A camera.
pub(crate) struct Camera {
    settings: V4l2Camera,
    wanted: Wanted,
    state: State,
    /// Whether the settings were accepted once.
    is_proven: bool,
    /// Whether it was there and is looked for.
    is_unplugged: bool,
    /// Whether it was said that it is not there.
    is_missed: bool,
    pub(crate) notes: Notes,
}

enum State {
    /// Nothing is open.
    Closed {
        next_ns: u64,
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
    /// When the last image came, or the stream began.
    heard_ns: u64,
    /// When the last silence was counted.
    silence_ns: u64,
    silences: u32,
    refusals: u32,
}

/// An image in a buffer of the driver, to be given back.
pub(crate) struct Image {
    buffer: FilledBuffer,
    /// Tells this stream from others.
    pub(crate) session: u64,
    /// Number of the image in it.
    pub(crate) number: u64,
    /// Images before it of which none came.
    pub(crate) missing: u64,
    /// When it came.
    pub(crate) received_ns: u64,
    /// When its exposure began; or why it is no image.
    pub(crate) stamped: Result<Stamped, DropReason>,
}

impl Camera {
    pub(crate) fn new(settings: V4l2Camera, wanted: Wanted) -> Self {
        let state = State::Closed { next_ns: 0, failures: 0 };
        Self {
            settings,
            wanted,
            state,
            is_proven: false,
            is_unplugged: false,
            is_missed: false,
            notes: Notes::default(),
        }
    }

    /// Opens the device and starts its stream, where it is not and its turn has come.
    ///
    /// # Errors
    /// The device is there and refuses settings that it never accepted: the configuration must change.
    pub(crate) fn ensure_streaming(&mut self) -> Result<(), CameraError> {
        let State::Closed { next_ns, failures } = self.state else { return Ok(()) };
        if clock::now_ns() < next_ns {
            return Ok(());
        }
        match self.open() {
            Ok(streaming) => {
                self.is_proven = true;
                self.begin(streaming);
            }
            Err(CameraError::Find(error @ FindError::Absent { .. })) => self.miss(&error, failures),
            Err(error) if error.is_lasting() && !self.is_proven => return Err(error),
            Err(error) => {
                self.notes.add(Incident::CallRefused, error.to_string());
                self.close_for_a_while(failures);
            }
        }
        Ok(())
    }

    /// Stops the stream and closes the device.
    pub(crate) fn close(&mut self) {
        self.state = State::Closed { next_ns: 0, failures: 0 };
    }

    /// Waits for an image; `false` where no stream runs, at once.
    pub(crate) fn wait(&mut self, rest: Duration) -> bool {
        let State::Streaming(streaming) = &mut self.state else { return false };
        match streaming.queue.wait(rest) {
            Ok(Waited::Ready | Waited::TimedOut | Waited::Interrupted) => {}
            Err(error) => self.refuse(&error),
        }
        true
    }

    /// The next image that has come.
    pub(crate) fn take(&mut self) -> Option<Image> {
        let State::Streaming(streaming) = &mut self.state else { return None };
        let taken = streaming.queue.take();
        // After the call: a driver may hold it up, and no image begins after it came.
        let now_ns = clock::now_ns();
        let interrupted = streaming.device.take_interruptions();
        self.notes.add_many(Incident::Interrupted, interrupted, "signals interrupt the calls to the driver");
        match taken {
            Ok(Some(buffer)) => Some(streaming.judge(buffer, now_ns, &mut self.notes)),
            Ok(None) => {
                self.listen(now_ns);
                None
            }
            Err(error) => {
                self.refuse(&error);
                None
            }
        }
    }

    /// What the device was found to be and set to; `None` while it is closed.
    pub(crate) fn prepared(&self) -> Option<&Prepared> {
        match &self.state {
            State::Streaming(streaming) => Some(&streaming.prepared),
            State::Closed { .. } => None,
        }
    }

    /// The bytes of an image as the camera sent them.
    pub(crate) fn bytes<'a>(&'a self, image: &'a Image) -> &'a [u8] {
        match &self.state {
            State::Streaming(streaming) => streaming.queue.bytes(&image.buffer),
            State::Closed { .. } => &[],
        }
    }

    /// Gives the buffer of an image back to the driver.
    pub(crate) fn give_back(&mut self, image: Image) {
        let State::Streaming(streaming) = &mut self.state else { return };
        match streaming.queue.give_back(image.buffer) {
            Ok(()) => streaming.refusals = 0,
            Err(error) => self.refuse(&error),
        }
    }

    fn open(&self) -> Result<Streaming, CameraError> {
        let (path, device, prepared) = device::open(&self.settings, &self.wanted)?;
        tracing::info!("{}: {}", path.display(), prepared.notes.join(", "));
        Streaming::start(Rc::new(device), prepared, &self.settings, &self.wanted)
            .map_err(|source| CameraError::Stream { path, source })
    }

    /// Looks again later for a device that is not there.
    fn miss(&mut self, error: &FindError, failures: u32) {
        if !self.is_unplugged && !std::mem::replace(&mut self.is_missed, true) {
            tracing::warn!("waiting for a camera: {error}");
        }
        self.state = State::Closed { next_ns: clock::now_ns() + LOOK_NS, failures };
    }

    fn begin(&mut self, streaming: Streaming) {
        self.is_missed = false;
        if std::mem::take(&mut self.is_unplugged) {
            self.notes.add(Incident::Returned, format!("{} is back", self.settings.device));
        }
        self.state = State::Streaming(Box::new(streaming));
    }

    fn close_for_a_while(&mut self, failures: u32) {
        let wait_ns = (FIRST_WAIT_NS << failures.min(7)).min(LONGEST_WAIT_NS);
        self.state = State::Closed { next_ns: clock::now_ns() + wait_ns, failures: failures + 1 };
    }

    /// Counts a call that the driver refused, and does what helps.
    fn refuse(&mut self, error: &CallError) {
        let State::Streaming(streaming) = &mut self.state else { return };
        if error.errno() == Some(Errno::NODEV) {
            self.notes.add(Incident::Unplugged, format!("{} is gone: {error}", self.settings.device));
            self.is_unplugged = true;
            self.state = State::Closed { next_ns: clock::now_ns() + LOOK_NS, failures: 0 };
            return;
        }
        self.notes.add(Incident::CallRefused, format!("{}: {error}", self.settings.device));
        streaming.refusals += 1;
        if streaming.refusals >= MOST_REFUSALS {
            self.restart("the driver refuses calls");
        }
    }

    /// Looks whether the camera has been silent for too long, and offers buffers that were refused.
    fn listen(&mut self, now_ns: u64) {
        let State::Streaming(streaming) = &mut self.state else { return };
        if let Err(error) = streaming.queue.offer_again() {
            return self.refuse(&error);
        }
        let timeout_ns = self.settings.timeout_ns;
        if now_ns.saturating_sub(streaming.silence_ns) < timeout_ns {
            return;
        }
        let silent_ms = now_ns.saturating_sub(streaming.heard_ns) / 1_000_000;
        streaming.silence_ns = now_ns;
        streaming.silences += 1;
        let is_fault = self.settings.trigger == Trigger::Free;
        if is_fault || streaming.silences == 1 {
            self.notes.add(Incident::TimeOut, format!("{}: no image for {silent_ms} ms", self.settings.device));
        }
        match streaming.silences {
            _ if !is_fault => {}
            1..MOST_SILENCES => self.restart("the camera is silent"),
            _ => self.close(),
        }
    }

    /// Begins the stream anew on the same device; closes it where that fails.
    fn restart(&mut self, why: &str) {
        let closed = State::Closed { next_ns: 0, failures: 0 };
        let State::Streaming(old) = std::mem::replace(&mut self.state, closed) else { return };
        self.notes.add(Incident::StreamRestart, format!("{}: {why}; its stream is restarted", self.settings.device));
        let Streaming { device, prepared, queue, silences, heard_ns, .. } = *old;
        // Its buffers must be gone before the driver gives others.
        drop(queue);
        match Streaming::start(device, prepared, &self.settings, &self.wanted) {
            Ok(streaming) => self.begin(Streaming { silences, heard_ns, ..streaming }),
            Err(error) => {
                self.notes.add(Incident::CallRefused, format!("{}: {error}", self.settings.device));
                self.close_for_a_while(0);
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
            heard_ns: now_ns,
            silence_ns: now_ns,
            silences: 0,
            refusals: 0,
        })
    }

    /// Numbers a buffer and tells when its exposure began.
    fn judge(&mut self, buffer: FilledBuffer, now_ns: u64, notes: &mut Notes) -> Image {
        (self.heard_ns, self.silence_ns, self.silences, self.refusals) = (now_ns, now_ns, 0, 0);
        let filled = buffer.filled;
        let (number, missing, stamped) = if filled.flags & ERROR != 0 {
            (0, self.numbering.take_damaged(filled.sequence), Err(DropReason::BadImage))
        } else {
            let numbered = self.numbering.take(filled.sequence);
            if let Numbered::Anew { number } = numbered {
                notes.add(Incident::NumberingRestart, format!("the driver restarted its image numbers at {number}"));
                self.session = now_ns;
            }
            match numbered {
                Numbered::Repeated => (0, 0, Err(DropReason::Duplicate)),
                Numbered::Anew { number } => (number, 0, self.stamp(&buffer, now_ns, notes)),
                Numbered::Next { number, missing } => (number, missing, self.stamp(&buffer, now_ns, notes)),
            }
        };
        Image { buffer, session: self.session, number, missing, received_ns: now_ns, stamped }
    }

    fn stamp(&mut self, buffer: &FilledBuffer, now_ns: u64, notes: &mut Notes) -> Result<Stamped, DropReason> {
        let stamped = self.stamps.take(buffer.filled.stamp, buffer.filled.flags, now_ns);
        match stamped.fault {
            None => Ok(stamped),
            Some(StampFault::Ahead { by_ns }) => {
                let by_ms = by_ns as f64 * 1e-6;
                notes.add(Incident::StampAhead, format!("time stamps are {by_ms:.3} ms later than the arrival"));
                Ok(stamped)
            }
            Some(StampFault::Jump) => {
                notes.add(
                    Incident::StampJump,
                    "time stamps jump or use an unknown clock; times now count from an arrival",
                );
                // Times before and after say nothing of each other.
                self.session = now_ns;
                Ok(stamped)
            }
            Some(StampFault::Repeated) => Err(DropReason::BadTime),
        }
    }
}
