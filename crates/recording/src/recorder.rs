//! The recorder takes messages without waiting for the disk, and writes them in its own thread.
//!
//! In: messages of the channels. Out: a recording, and counts of written and lost messages, by topic and reason. Every
//! half second the messages so far are handed to the kernel, so a killed process loses no more than that. Every two
//! seconds they are synchronized to the disk. A full disk ends the recording with a complete file. The scan goes on,
//! and later messages are counted as lost.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};

use fringeflow_message::DropReason;

use crate::buffers::{BufferPool, Item};
use crate::held_content::{HeldContent, HeldSlots};
use crate::recordable::{Encoded, MAX_HEADER_BYTES, Times};
use crate::wall_clock::{WallClock, monotonic_ns};
use crate::writer::{Opening, RecordingWriter};
use crate::{Recordable, RecorderCounts, RecordingError, RecordingProblem, Topic};

/// Default size of the queue to the disk: three seconds of two cameras.
pub const DEFAULT_QUEUE_BYTES: usize = 256 << 20;
/// Default free space that stays on the disk, bytes.
pub const DEFAULT_MIN_FREE_BYTES: u64 = 1 << 30;
/// Maximum number of images held at once: those that arrive while a chunk is written, and fewer than a channel allows
/// its subscribers to hold.
pub const MAX_HELD_IMAGES: usize = 8;
/// Maximum number of clouds held at once: their channel allows two, and one of them is being received.
const MAX_HELD_CLOUDS: usize = 1;
/// Longest time until a message is handed to the kernel.
const FLUSH_INTERVAL: Duration = Duration::from_millis(500);
/// Longest time until a message is synchronized to the disk.
const SYNC_INTERVAL: Duration = Duration::from_secs(2);

/// A finished recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// The file.
    pub file: PathBuf,
    /// Messages taken, written and lost.
    pub counts: RecorderCounts,
}

/// A running recording.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    /// Queue to the writer thread, bounded by the size of the buffers; `None` once closed.
    items: Option<Sender<Item>>,
    image_slots: HeldSlots,
    cloud_slots: HeldSlots,
    thread: Option<JoinHandle<Result<PathBuf, RecordingError>>>,
}

#[derive(Debug)]
struct Shared {
    target: PathBuf,
    clock: WallClock,
    buffers: BufferPool,
    account: Mutex<Account>,
}

#[derive(Debug, Default)]
struct Account {
    counts: RecorderCounts,
    /// Reason of the end of the recording, once it has ended.
    end_reason: Option<&'static str>,
}

impl Recorder {
    /// Starts a recording with a queue of `queue_bytes`.
    ///
    /// # Errors
    /// The file exists, its folder is missing, or the disk is full.
    pub fn create(target: &Path, opening: &Opening<'_>, queue_bytes: usize) -> Result<Self, RecordingError> {
        let writer = RecordingWriter::create(target, opening)?;
        let buffers = BufferPool::new(queue_bytes);
        let shared =
            Arc::new(Shared { target: target.to_owned(), clock: writer.clock, buffers, account: Mutex::default() });
        let (thread_shared, (items, queue)) = (Arc::clone(&shared), unbounded());
        let thread = std::thread::Builder::new().name("recorder".to_owned());
        let thread = thread.spawn(move || WriterThread::new(&thread_shared, queue, writer).run());
        let thread = thread.map_err(|e| RecordingProblem::Unwritable(e).in_file(target))?;
        let [image_slots, cloud_slots] = [MAX_HELD_IMAGES, MAX_HELD_CLOUDS].map(HeldSlots::new);
        Ok(Self { shared, items: Some(items), image_slots, cloud_slots, thread: Some(thread) })
    }

    /// Takes a message, or counts it as lost; never waits for the disk.
    pub fn push(&self, message: &Recordable<'_>) {
        let Some(topic) = message.topic() else {
            self.shared.account().counts.malformed += 1;
            return;
        };
        self.enqueue(topic, message.times(), message.encoded_size(), |encoded| {
            message.encode(self.shared.clock, encoded);
        });
    }

    /// Takes an image or a cloud without copying its content; `message` makes the message of both. The content must not
    /// change until it is dropped, once the writer thread has copied it. At most [`MAX_HELD_IMAGES`] and one cloud are
    /// held at once; further ones are copied.
    pub fn push_held<H>(
        &self,
        header: &H,
        content: impl AsRef<[u8]> + Send + 'static,
        message: for<'a> fn(&'a H, &'a [u8]) -> Recordable<'a>,
    ) {
        let whole = message(header, content.as_ref());
        let topic = whole.topic();
        let slots = if topic == Some(Topic::Cloud) { &self.cloud_slots } else { &self.image_slots };
        let Some((topic, slot)) = topic.zip(slots.take()) else { return self.push(&whole) };
        self.enqueue(topic, whole.times(), MAX_HEADER_BYTES, |encoded| {
            message(header, content.as_ref()).encode_head(self.shared.clock, encoded);
            encoded.held = Some(HeldContent::new(content, slot));
        });
    }

    /// Counts messages that were overwritten in their channel before they could be taken.
    pub fn count_overrun(&self, missing: u64) {
        self.shared.account().counts.overrun += missing;
    }

    /// Counts a message, and puts it into the queue if the queue has room for `bytes`.
    fn enqueue(&self, topic: Topic, times: Times, bytes: usize, encode: impl FnOnce(&mut Encoded)) {
        self.shared.account().counts.for_topic(topic).taken += 1;
        let Some((mut encoded, items)) = self.shared.buffers.take(bytes).zip(self.items.as_ref()) else {
            self.shared.account().counts.for_topic(topic).drop_one(DropReason::QueueFull);
            return;
        };
        let old_bytes = encoded.bytes.capacity();
        encode(&mut encoded);
        self.shared.buffers.count_growth(old_bytes, encoded.bytes.capacity());
        if items.send(Item { topic, times, encoded }).is_err() {
            // The writer thread has ended; finishing the recording reports why.
            self.shared.account().counts.for_topic(topic).drop_one(DropReason::DiskFull);
        }
    }

    /// Messages taken, written and lost so far.
    #[must_use]
    pub fn counts(&self) -> RecorderCounts {
        self.shared.account().counts.clone()
    }

    /// Messages in the queue.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.items.as_ref().map_or(0, Sender::len)
    }

    /// Why the recording ended early; `None` while it runs.
    #[must_use]
    pub fn end_reason(&self) -> Option<&'static str> {
        self.shared.account().end_reason
    }

    /// Writes the rest of the queue and closes the file.
    ///
    /// # Errors
    /// The file could not be finished. The data written so far can be recovered.
    pub fn finish(mut self) -> Result<Recorded, RecordingError> {
        let file = self.join()?;
        Ok(Recorded { file, counts: self.counts() })
    }

    fn join(&mut self) -> Result<PathBuf, RecordingError> {
        self.items = None;
        let ended =
            || RecordingProblem::Unfinishable("the writer thread ended".to_owned()).in_file(&self.shared.target);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(ended()),
        }
    }
}

impl Drop for Recorder {
    /// Closes the file of a recorder that was not finished.
    fn drop(&mut self) {
        if self.thread.is_some()
            && let Err(error) = self.join()
        {
            tracing::error!("{error}");
        }
    }
}

impl Shared {
    fn account(&self) -> MutexGuard<'_, Account> {
        // Counters are valid at any time, even after a panic.
        self.account.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The thread that writes the file.
struct WriterThread<'a> {
    shared: &'a Shared,
    queue: Receiver<Item>,
    /// `None` once the file is closed.
    writer: Option<RecordingWriter>,
    /// Result of closing the file.
    closed: Option<Result<PathBuf, RecordingError>>,
    /// Messages written, but not yet handed to the kernel.
    unflushed: BTreeMap<Topic, u64>,
    flushed_at: Instant,
    synced_at: Instant,
    /// Losses that the log of the file reports.
    reported_losses: u64,
}

impl<'a> WriterThread<'a> {
    fn new(shared: &'a Shared, queue: Receiver<Item>, writer: RecordingWriter) -> Self {
        let now = Instant::now();
        let (writer, unflushed) = (Some(writer), BTreeMap::new());
        Self { shared, queue, writer, closed: None, unflushed, flushed_at: now, synced_at: now, reported_losses: 0 }
    }

    fn run(mut self) -> Result<PathBuf, RecordingError> {
        loop {
            match self.queue.recv_timeout(FLUSH_INTERVAL.saturating_sub(self.flushed_at.elapsed())) {
                Ok(item) => self.write(item),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if self.flushed_at.elapsed() >= FLUSH_INTERVAL {
                self.flush();
            }
        }
        self.close("end");
        self.closed.unwrap_or_else(|| {
            Err(RecordingProblem::Unfinishable("nothing was closed".to_owned()).in_file(&self.shared.target))
        })
    }

    fn write(&mut self, item: Item) {
        let Item { topic, times, encoded } = item;
        let has_room = self.writer.as_mut().map(|writer| writer.reserve(encoded.len()));
        if has_room == Some(false) {
            tracing::error!("{}: the disk is full, the recording ends", self.shared.target.display());
            self.close("disk full");
        }
        match self.writer.as_mut().map(|writer| writer.write(topic, times, &encoded)) {
            Some(Ok(())) => *self.unflushed.entry(topic).or_default() += 1,
            Some(Err(problem)) => {
                self.count_lost(topic, 1);
                self.fail(&problem);
            }
            None => self.count_lost(topic, 1),
        }
        self.shared.buffers.give_back(encoded);
    }

    fn count_lost(&self, topic: Topic, count: u64) {
        self.shared.account().counts.for_topic(topic).drop_many(DropReason::DiskFull, count);
    }

    /// Hands everything to the kernel, and synchronizes to the disk from time to time.
    fn flush(&mut self) {
        self.flushed_at = Instant::now();
        self.log_losses();
        let Some(writer) = &mut self.writer else { return };
        let mut result = writer.flush();
        if self.synced_at.elapsed() >= SYNC_INTERVAL {
            result = result.and_then(|()| writer.sync());
            self.synced_at = Instant::now();
        }
        match result {
            Ok(()) => self.count_written(),
            Err(problem) => self.fail(&problem),
        }
    }

    fn count_written(&mut self) {
        let mut account = self.shared.account();
        for (topic, count) in std::mem::take(&mut self.unflushed) {
            account.counts.for_topic(topic).passed += count;
        }
    }

    /// Logs the losses since the last report in the file.
    fn log_losses(&mut self) {
        let lost = self.shared.account().counts.total().all_dropped();
        let Some(writer) = self.writer.as_mut().filter(|_| lost > self.reported_losses) else { return };
        let text =
            format!("{} messages were lost on their way to the file, {lost} so far", lost - self.reported_losses);
        tracing::warn!("{}: {text}", self.shared.target.display());
        self.reported_losses = lost;
        let loss = Recordable::Event { time_ns: monotonic_ns(), is_warning: true, source: "recorder", text: &text };
        let mut encoded = Encoded::default();
        loss.encode(self.shared.clock, &mut encoded);
        // A failure is ignored: the counts have the losses too, and the next write fails again.
        let _ = writer.write(Topic::Log, loss.times(), &encoded);
    }

    /// Closes the file, with the counts in its metadata.
    fn close(&mut self, reason: &'static str) {
        self.flush();
        let Some(writer) = self.writer.take() else { return };
        let mut metadata = self.shared.account().counts.metadata(reason);
        metadata.insert("ended_ns".to_owned(), monotonic_ns().to_string());
        self.shared.account().end_reason = Some(reason);
        self.closed = Some(writer.finish(&metadata));
    }

    /// Abandons the file. Messages not yet flushed are lost; the others can be recovered.
    fn fail(&mut self, problem: &RecordingProblem) {
        let problem = RecordingProblem::Unfinishable(problem.to_string()).in_file(&self.shared.target);
        tracing::error!("{problem}");
        for (topic, count) in std::mem::take(&mut self.unflushed) {
            self.count_lost(topic, count);
        }
        self.writer = None;
        self.shared.account().end_reason = Some("write error");
        self.closed = Some(Err(problem));
    }
}
