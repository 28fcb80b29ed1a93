//! An opened recording. Opening checks the whole file; messages are read on request.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use fringeflow::cloud::{Cloud, read_records};
use fringeflow_dataset::{GreyImage, Setup, Truth};
use fringeflow_message::{CloudHeader, FrameHeader, PixelFormat, Window};

use crate::collect::Collected;
use crate::content::Header;
use crate::recordable::Times;
use crate::scan::{ScanMode, scan};
use crate::{Content, Message, Origin, RecordingError, RecordingProblem, Topic};

/// An opened recording.
#[derive(Debug)]
pub struct Recording {
    pub(super) path: PathBuf,
    pub(super) file: File,
    pub(super) setup: Setup,
    pub(super) configuration: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) recorder_account: BTreeMap<String, String>,
    pub(super) truth: Option<FileRange>,
    pub(super) entries: Vec<Entry>,
    /// Entries of images by camera, session and sequence.
    pub(super) frames: BTreeMap<(u32, u64, u64), usize>,
    pub(super) foreign_messages: BTreeMap<String, u64>,
    pub(super) bytes: u64,
}

/// A part of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FileRange {
    pub(super) offset: u64,
    pub(super) bytes: usize,
}

/// A message that is not read yet.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) range: FileRange,
    pub(super) header: Option<Header>,
}

impl Recording {
    /// Opens a recording. Reads the whole file and checks the checksums, the counts, the setup, and that every header has its
    /// message.
    ///
    /// # Errors
    /// The file is no recording, of a newer version, unfinished or damaged. The error names file, offset and remedy.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let unreadable = |e| RecordingProblem::Unreadable(e).in_file(path);
        let file = File::open(path).map_err(unreadable)?;
        let mut collected = Collected::default();
        let scanned = scan(&file, ScanMode::Strict, &mut |found| collected.add(found)).map_err(|p| p.in_file(path))?;
        collected.into_recording(path, file, scanned).map_err(|p| p.in_file(path))
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the file, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Rig, pattern and measurement volume.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Text of the configuration of the scan.
    #[must_use]
    pub fn configuration_text(&self) -> &str {
        &self.configuration
    }

    /// Machine and time at the start of the recording.
    #[must_use]
    pub fn origin(&self) -> Origin {
        Origin::from_metadata(&self.metadata)
    }

    /// Version of fringeflow that wrote the recording.
    #[must_use]
    pub fn writer_version(&self) -> &str {
        self.metadata.get("version").map_or("", String::as_str)
    }

    /// Final account of the recorder: messages taken, written and lost, by topic and reason. Empty if the recorder was
    /// killed.
    #[must_use]
    pub fn recorder_account(&self) -> &BTreeMap<String, String> {
        &self.recorder_account
    }

    /// Number of messages that the recorder lost; `None` if unknown.
    #[must_use]
    pub fn lost_messages(&self) -> Option<u64> {
        let number = |key: &str| self.recorder_account.get(key)?.parse::<u64>().ok();
        number("taken")?.checked_sub(number("written")?)
    }

    /// Number of messages of unknown topics, by name.
    #[must_use]
    pub fn foreign_messages(&self) -> &BTreeMap<String, u64> {
        &self.foreign_messages
    }

    /// Number of messages of a topic.
    #[must_use]
    pub fn count(&self, topic: Topic) -> usize {
        self.entries.iter().filter(|entry| entry.topic == topic).count()
    }

    /// Times of the first and the last message, without the messages for viewers.
    #[must_use]
    pub fn span_ns(&self) -> Option<[u64; 2]> {
        let mut times =
            self.entries.iter().filter(|entry| !entry.topic.is_for_viewers()).map(|entry| entry.times.log_ns);
        let first_ns = times.next()?;
        Some([first_ns, times.next_back().unwrap_or(first_ns)])
    }

    /// All messages in the order of their times. Each is read when the iterator reaches it.
    pub fn messages(&self) -> impl Iterator<Item = Result<Message, RecordingError>> + '_ {
        self.entries.iter().map(|entry| self.read(entry))
    }

    /// Messages of one topic in the order of their times.
    pub fn messages_of(&self, topic: Topic) -> impl Iterator<Item = Result<Message, RecordingError>> + '_ {
        self.entries.iter().filter(move |entry| entry.topic == topic).map(|entry| self.read(entry))
    }

    /// Headers of the images of a camera, 1 or 2, in the order of their times.
    pub fn frame_headers(&self, camera: u32) -> impl Iterator<Item = &FrameHeader> + '_ {
        self.entries.iter().filter_map(move |entry| match &entry.header {
            Some(Header::Frame(header)) if header.camera == camera => Some(header),
            _ => None,
        })
    }

    /// Format of the first image.
    #[must_use]
    pub fn pixel_format(&self) -> PixelFormat {
        let first = [1, 2].into_iter().find_map(|camera| self.frame_headers(camera).next());
        first.and_then(|header| PixelFormat::from_code(header.pixel_format)).unwrap_or_default()
    }

    /// Headers of the clouds in the order of their times.
    pub fn cloud_headers(&self) -> impl Iterator<Item = &CloudHeader> + '_ {
        self.entries.iter().filter_map(|entry| match &entry.header {
            Some(Header::Cloud(header)) => Some(header.as_ref()),
            _ => None,
        })
    }

    /// Times of the messages of a topic, in order.
    pub(super) fn times_of(&self, topic: Topic) -> impl Iterator<Item = u64> + '_ {
        self.entries.iter().filter(move |entry| entry.topic == topic).map(|entry| entry.times.log_ns)
    }

    /// Reads one image of a camera, without the padding of its rows.
    ///
    /// # Errors
    /// The image is not in the recording, does not have the size of the setup, or cannot be read.
    pub fn image(&self, camera: u32, session: u64, sequence: u64) -> Result<GreyImage, RecordingError> {
        let entry = self.frames.get(&(camera, session, sequence)).and_then(|&i| self.entries.get(i));
        let missing = RecordingProblem::NoImage { camera, session, sequence };
        let entry = entry.ok_or_else(|| missing.in_file(&self.path))?;
        let Content::Frame(header, data) = self.read(entry)?.content else {
            return Err(entry.problem("is no image".to_owned()).in_file(&self.path));
        };
        let [width, height] = [header.width_px as usize, header.height_px as usize];
        if [width, height] != self.setup.image_size_px {
            let expected = self.setup.image_size_px;
            let what = format!("is {width} × {height} pixels; meta.json says {} × {}", expected[0], expected[1]);
            return Err(entry.problem(what).in_file(&self.path));
        }
        // Decoding has checked the format.
        let format = PixelFormat::from_code(header.pixel_format).unwrap_or_default();
        let rows = data.chunks_exact((header.stride_bytes as usize).max(1));
        let pixels = rows.flat_map(|row| row.iter().take(width * format.bytes())).copied().collect();
        Ok(GreyImage { width, height, format, pixels })
    }

    /// Reads the images of camera 1 and 2 of a window, in the order of the exposures.
    ///
    /// # Errors
    /// As [`Self::image`].
    pub fn images(&self, window: &Window) -> Result<[Vec<GreyImage>; 2], RecordingError> {
        let mut images = [Vec::new(), Vec::new()];
        for [first, second] in window.pairs() {
            images[0].push(self.image(1, window.cam1_session, first)?);
            images[1].push(self.image(2, window.cam2_session, second)?);
        }
        Ok(images)
    }

    /// Whether the recording begins after the start of a window, so that images of the window are not recorded.
    #[must_use]
    pub fn begins_after(&self, window: &Window) -> bool {
        let first = [1, 2].into_iter().filter_map(|camera| self.frame_headers(camera).next());
        first.map(|header| header.exposure_start_ns).max().is_none_or(|first_ns| window.first_exposure_ns < first_ns)
    }

    /// Whether the recording has an image.
    #[must_use]
    pub fn has_image(&self, camera: u32, session: u64, sequence: u64) -> bool {
        self.frames.contains_key(&(camera, session, sequence))
    }

    /// Ground truth of the scene, if the recording has it.
    ///
    /// # Errors
    /// The attachment is no valid truth file.
    pub fn truth(&self) -> Result<Option<Truth>, RecordingError> {
        let Some(bytes) = self.truth_bytes()? else { return Ok(None) };
        let truth = Truth::parse(&bytes, self.setup.image_size_px);
        truth.map(Some).map_err(|problem| RecordingProblem::Truth(problem).in_file(&self.path))
    }

    /// Content of the attachment `truth.npz`, if there is one.
    pub(super) fn truth_bytes(&self) -> Result<Option<Vec<u8>>, RecordingError> {
        self.truth.map(|range| self.read_bytes(range).map_err(|p| p.in_file(&self.path))).transpose()
    }

    /// Reads a cloud by its index in the order of time, from 0; `None` after the last.
    ///
    /// # Errors
    /// The cloud cannot be read.
    pub fn cloud(&self, index: usize) -> Result<Option<Cloud>, RecordingError> {
        let Some(entry) = self.entries.iter().filter(|entry| entry.topic == Topic::Cloud).nth(index) else {
            return Ok(None);
        };
        let points = match self.read(entry)?.content {
            Content::Cloud(_, records) => read_records(&records),
            _ => None,
        };
        let points = points.ok_or_else(|| entry.problem("is no cloud".to_owned()).in_file(&self.path))?;
        Ok(Some(Cloud { points }))
    }

    fn read(&self, entry: &Entry) -> Result<Message, RecordingError> {
        let data = self.read_bytes(entry.range).map_err(|p| p.in_file(&self.path))?;
        let content = Content::decode(entry.topic, entry.header.as_ref(), data.into());
        Ok(Message {
            topic: entry.topic,
            log_ns: entry.times.log_ns,
            publish_ns: entry.times.publish_ns,
            content: content.map_err(|what| entry.problem(what).in_file(&self.path))?,
        })
    }

    /// Reads a part of the file that the scan has already seen, so its size is right.
    fn read_bytes(&self, range: FileRange) -> Result<Vec<u8>, RecordingProblem> {
        let mut bytes = vec![0; range.bytes];
        self.file.read_exact_at(&mut bytes, range.offset).map_err(RecordingProblem::Unreadable)?;
        Ok(bytes)
    }
}

impl Entry {
    /// The problem of an invalid message.
    pub(super) fn problem(&self, what: String) -> RecordingProblem {
        RecordingProblem::Message { topic: self.topic.name(), sequence: self.sequence, offset: self.range.offset, what }
    }
}
