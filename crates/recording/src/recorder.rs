//! The recorder: takes messages without ever waiting for the disk, and writes them in a thread of its own.
//!
//! In: messages of the channels. Out: a recording, and a count of what is in it and what was lost, by topic and reason.
//! Every half second what came is handed to the kernel, so that a killed process loses no more than that; every other
//! second the disk is asked to keep it. A disk that runs full ends the recording with a whole file; the scan goes on,
//! and what comes after is counted as lost.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};

use fringeflow_message::{DropReason, FrameHeader};

use super::buffers::{Buffers, Item};
use super::counts::RecorderCounts;
use super::error::{RecordingError, RecordingProblem};
use super::held::{Held, Places};
use super::opening::monotonic_ns;
use super::recordable::{Encoded, MOST_HEADER_BYTES, Times, encode_frame};
use super::writer::{Opening, RecordingWriter};
use super::{Recordable, Topic};

/// Bytes that the queue to the disk takes unless the configuration says otherwise: three seconds of two cameras.
pub const DEFAULT_QUEUE_BYTES: usize = 256 << 20;
/// Bytes of the disk that stay free unless the configuration says otherwise.
pub const DEFAULT_MIN_FREE_BYTES: u64 = 1 << 30;
/// Images that are held at once: enough for a chunk and those behind it, and fewer than a channel lets its subscribers hold.
pub const MOST_HELD: usize = 8;
/// Longest time that a message waits for its way to the kernel.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Longest time that it waits for its way to the disk.
const SYNC_EVERY: Duration = Duration::from_secs(2);

/// What came of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// The file.
    pub file: PathBuf,
    /// What is in it and what was lost.
    pub counts: RecorderCounts,
}

/// A running recording.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    /// The way to the thread that writes, bounded by the bytes of the buffers; `None` where nothing more will come.
    items: Option<Sender<Item>>,
    places: Places,
    writer: Option<JoinHandle<Result<PathBuf, RecordingError>>>,
}

#[derive(Debug)]
struct Shared {
    target: PathBuf,
    buffers: Buffers,
    account: Mutex<Account>,
}

#[derive(Debug, Default)]
struct Account {
    counts: RecorderCounts,
    /// Why nothing more is written.
    ended: Option<&'static str>,
}

impl Recorder {
    /// Begins a recording with a queue of `queue_bytes`.
    ///
    /// # Errors
    /// The name is taken, its folder is missing, or the disk is full.
    pub fn create(target: &Path, opening: &Opening<'_>, queue_bytes: usize) -> Result<Self, RecordingError> {
        let writer = RecordingWriter::create(target, opening)?;
        let buffers = Buffers::new(queue_bytes);
        let shared = Arc::new(Shared { target: target.to_owned(), buffers, account: Mutex::default() });
        let (work, (items, waiting)) = (Arc::clone(&shared), unbounded());
        let thread = std::thread::Builder::new().name("recorder".to_owned());
        let thread = thread.spawn(move || WriterThread::new(&work, waiting, writer).run());
        let writer = thread.map_err(|e| RecordingProblem::Unwritable(e).of(target))?;
        Ok(Self { shared, items: Some(items), places: Places::new(MOST_HELD), writer: Some(writer) })
    }

    /// Takes a message, or counts it as lost; never waits for the disk.
    pub fn push(&self, message: &Recordable<'_>) {
        let Some(topic) = message.topic() else {
            self.shared.account().counts.malformed += 1;
            return;
        };
        self.accept(topic, message.times(), message.size(), |encoded| message.encode(encoded));
    }

    /// [`Self::push`] of an image that need not be copied, since it stays as it is until it is dropped: at most
    /// [`MOST_HELD`] are held at once, each until it is in the file, and those beyond are copied.
    pub fn push_held(&self, header: &FrameHeader, image: impl AsRef<[u8]> + Send + 'static) {
        let message = Recordable::Frame { header, image: image.as_ref() };
        let Some((topic, place)) = message.topic().zip(self.places.take()) else { return self.push(&message) };
        let (times, image_bytes) = (message.times(), image.as_ref().len());
        self.accept(topic, times, MOST_HEADER_BYTES, |encoded| {
            encode_frame(header, image_bytes, encoded);
            encoded.held = Some(Held::new(image, place));
        });
    }

    /// Counts a message, and puts it into the queue if that has room for so many bytes.
    fn accept(&self, topic: Topic, times: Times, bytes: usize, encode: impl FnOnce(&mut Encoded)) {
        self.shared.account().counts.of(topic).taken += 1;
        let Some((mut encoded, items)) = self.shared.buffers.take(bytes).zip(self.items.as_ref()) else {
            self.shared.account().counts.of(topic).drop_one(DropReason::QueueFull);
            return;
        };
        let had_bytes = encoded.bytes.capacity();
        encode(&mut encoded);
        self.shared.buffers.count_growth(had_bytes, encoded.bytes.capacity());
        if items.send(Item { topic, times, encoded }).is_err() {
            // The thread that wrote is gone; ending the recording tells why.
            self.shared.account().counts.of(topic).drop_one(DropReason::DiskFull);
        }
    }

    /// What was taken, written and lost so far.
    #[must_use]
    pub fn counts(&self) -> RecorderCounts {
        self.shared.account().counts.clone()
    }

    /// Messages that wait for their way to the kernel.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.items.as_ref().map_or(0, Sender::len)
    }

    /// Why nothing more is written, though the recording was not ended; `None` while all is well.
    #[must_use]
    pub fn ended(&self) -> Option<&'static str> {
        self.shared.account().ended
    }

    /// Writes what is still in the queue, and closes the file.
    ///
    /// # Errors
    /// The file could not be finished; what was written can be recovered.
    pub fn finish(mut self) -> Result<Recorded, RecordingError> {
        let file = self.join()?;
        Ok(Recorded { file, counts: self.counts() })
    }

    fn join(&mut self) -> Result<PathBuf, RecordingError> {
        self.items = None;
        let gone = || RecordingProblem::Unfinishable("the writer thread ended".to_owned()).of(&self.shared.target);
        match self.writer.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(gone()),
        }
    }
}

impl Drop for Recorder {
    /// A recorder that nobody finished closes its file all the same.
    fn drop(&mut self) {
        if self.writer.is_some()
            && let Err(error) = self.join()
        {
            tracing::error!("{error}");
        }
    }
}

impl Shared {
    fn account(&self) -> MutexGuard<'_, Account> {
        // Counters are whole at any moment.
        self.account.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The thread that writes.
struct WriterThread<'a> {
    shared: &'a Shared,
    waiting: Receiver<Item>,
    /// `None` once the file is closed.
    writer: Option<RecordingWriter>,
    /// What came of closing it before the end.
    closed: Option<Result<PathBuf, RecordingError>>,
    /// Written, but not yet handed to the kernel.
    unflushed: BTreeMap<Topic, u64>,
    flushed_at: Instant,
    synced_at: Instant,
    /// Losses that the file tells of.
    told: u64,
}

impl<'a> WriterThread<'a> {
    fn new(shared: &'a Shared, waiting: Receiver<Item>, writer: RecordingWriter) -> Self {
        let now = Instant::now();
        let (writer, unflushed) = (Some(writer), BTreeMap::new());
        Self { shared, waiting, writer, closed: None, unflushed, flushed_at: now, synced_at: now, told: 0 }
    }

    fn run(mut self) -> Result<PathBuf, RecordingError> {
        loop {
            match self.waiting.recv_timeout(FLUSH_EVERY.saturating_sub(self.flushed_at.elapsed())) {
                Ok(item) => self.take(item),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if self.flushed_at.elapsed() >= FLUSH_EVERY {
                self.flush();
            }
        }
        self.close("end");
        self.closed.unwrap_or_else(|| {
            Err(RecordingProblem::Unfinishable("nothing was closed".to_owned()).of(&self.shared.target))
        })
    }

    fn take(&mut self, item: Item) {
        let Item { topic, times, encoded } = item;
        let admitted = self.writer.as_mut().map(|writer| writer.admits(encoded.len()));
        if admitted == Some(false) {
            tracing::error!("{}: the disk is full, the recording ends", self.shared.target.display());
            self.close("disk full");
        }
        match self.writer.as_mut().map(|writer| writer.write(topic, times, encoded)) {
            Some(Ok(())) => *self.unflushed.entry(topic).or_default() += 1,
            Some(Err(problem)) => {
                self.lose(topic, 1);
                self.fail(&problem);
            }
            None => self.lose(topic, 1),
        }
        self.give_back();
    }

    /// Gives back the buffers whose content is in the file.
    fn give_back(&mut self) {
        let released = self.writer.iter_mut().flat_map(RecordingWriter::released);
        released.for_each(|buffer| self.shared.buffers.give_back(buffer));
    }

    fn lose(&self, topic: Topic, count: u64) {
        self.shared.account().counts.of(topic).drop_many(DropReason::DiskFull, count);
    }

    /// Hands everything to the kernel, and now and then to the disk.
    fn flush(&mut self) {
        self.flushed_at = Instant::now();
        self.tell_losses();
        let Some(writer) = &mut self.writer else { return };
        let mut result = writer.flush();
        if self.synced_at.elapsed() >= SYNC_EVERY {
            result = result.and_then(|()| writer.sync());
            self.synced_at = Instant::now();
        }
        self.give_back();
        match result {
            Ok(()) => self.count_written(),
            Err(problem) => self.fail(&problem),
        }
    }

    fn count_written(&mut self) {
        let mut account = self.shared.account();
        for (topic, count) in std::mem::take(&mut self.unflushed) {
            account.counts.of(topic).passed += count;
        }
    }

    /// Writes into the file how many messages are missing from it since it last said so.
    fn tell_losses(&mut self) {
        let lost = self.shared.account().counts.total().all_dropped();
        let Some(writer) = self.writer.as_mut().filter(|_| lost > self.told) else { return };
        let text = format!("{} messages were lost on their way to the file, {lost} so far", lost - self.told);
        tracing::warn!("{}: {text}", self.shared.target.display());
        self.told = lost;
        let loss = Recordable::Event { time_ns: monotonic_ns(), is_warning: true, source: "recorder", text: &text };
        let mut encoded = Encoded::default();
        loss.encode(&mut encoded);
        // The counts tell it too, so a failure here loses nothing; the next write comes upon it again.
        let _ = writer.write(Topic::Log, loss.times(), encoded);
    }

    /// Closes the file with the account of what is in it.
    fn close(&mut self, why: &'static str) {
        self.flush();
        let Some(writer) = self.writer.take() else { return };
        let mut metadata = self.shared.account().counts.metadata(why);
        metadata.insert("ended_ns".to_owned(), monotonic_ns().to_string());
        self.shared.account().ended = Some(why);
        self.closed = Some(writer.finish(&metadata));
    }

    /// Gives the file up where it is; what was not flushed is lost, what was can be recovered.
    fn fail(&mut self, problem: &RecordingProblem) {
        let problem = RecordingProblem::Unfinishable(problem.to_string()).of(&self.shared.target);
        tracing::error!("{problem}");
        for (topic, count) in std::mem::take(&mut self.unflushed) {
            self.lose(topic, count);
        }
        self.writer = None;
        self.shared.account().ended = Some("write error");
        self.closed = Some(Err(problem));
    }
}
