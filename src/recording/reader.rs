//! An opened recording: checked from end to end, its messages read when asked for.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::cloud::{Cloud, read_records};
use crate::config::Configuration;
use crate::dataset::{CALIBRATION_FILE, GreyImage, META_FILE, Setup, SetupText, TRUTH_FILE, Truth};
use crate::message::{CloudHeader, FrameHeader, Window};

use super::content::{Content, Header, Message};
use super::error::{RecordingError, RecordingProblem};
use super::opening::Origin;
use super::recordable::Times;
use super::scan::{Found, FoundMessage, Rigour, scan};
use super::{CONFIGURATION_FILE, FORMAT_VERSION, METADATA, RECORDER_METADATA, Topic};

/// An opened recording.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    file: File,
    setup: Setup,
    configuration: String,
    metadata: BTreeMap<String, String>,
    account: BTreeMap<String, String>,
    truth: Option<Place>,
    entries: Vec<Entry>,
    /// Entries of images by camera, session and sequence.
    frames: BTreeMap<(u32, u64, u64), usize>,
    foreign: BTreeMap<String, u64>,
    bytes: u64,
}

/// Where something stands in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    offset: u64,
    bytes: usize,
}

/// A message, not yet read.
#[derive(Clone, Debug)]
struct Entry {
    topic: Topic,
    sequence: u32,
    times: Times,
    place: Place,
    header: Option<Header>,
}

impl Recording {
    /// Opens a recording: reads it through, and checks checksums, counts, setup and that headers and payloads pair.
    ///
    /// # Errors
    /// [`RecordingError`], which names file, place and remedy: no recording, one of a newer version, unfinished or
    /// damaged.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let unreadable = |e| RecordingProblem::Unreadable(e).of(path);
        let file = File::open(path).map_err(unreadable)?;
        let mut found = Collected::default();
        let scanned = scan(&file, Rigour::Strict, &mut |item| found.take(item)).map_err(|p| p.of(path))?;
        let mut recording = found.recording(path, file).map_err(|p| p.of(path))?;
        recording.foreign = scanned.foreign;
        recording.bytes = scanned.bytes;
        Ok(recording)
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Rig, pattern and volume.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Text of the configuration that was used.
    #[must_use]
    pub fn configuration_text(&self) -> &str {
        &self.configuration
    }

    /// The configuration that was used.
    ///
    /// # Errors
    /// The text is no configuration.
    pub fn configuration(&self) -> Result<Configuration, RecordingError> {
        Configuration::parse(&self.configuration).map_err(|e| RecordingProblem::from(e).of(&self.path))
    }

    /// Where and when it was begun.
    #[must_use]
    pub fn origin(&self) -> Origin {
        Origin::of(&self.metadata)
    }

    /// Version of the fringeflow that wrote it.
    #[must_use]
    pub fn writer_version(&self) -> &str {
        self.metadata.get("version").map_or("", String::as_str)
    }

    /// What the recorder said in the end: messages taken, written and lost, by topic and reason.
    #[must_use]
    pub fn account(&self) -> &BTreeMap<String, String> {
        &self.account
    }

    /// Messages that the recorder lost; `None` if it did not say.
    #[must_use]
    pub fn lost(&self) -> Option<u64> {
        let number = |key: &str| self.account.get(key)?.parse::<u64>().ok();
        number("taken")?.checked_sub(number("written")?)
    }

    /// Messages of topics that fringeflow does not know, by name.
    #[must_use]
    pub fn foreign(&self) -> &BTreeMap<String, u64> {
        &self.foreign
    }

    /// Number of messages of a topic.
    #[must_use]
    pub fn count(&self, topic: Topic) -> usize {
        self.entries.iter().filter(|entry| entry.topic == topic).count()
    }

    /// Times of the first and the last message.
    #[must_use]
    pub fn span_ns(&self) -> Option<[u64; 2]> {
        let of = |entry: &Entry| entry.times.log_ns;
        Some([self.entries.iter().map(of).min()?, self.entries.iter().map(of).max()?])
    }

    /// All messages in the order of their times; each is read when its turn comes.
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

    /// One image of a camera, without the bytes between its rows.
    ///
    /// # Errors
    /// It is not in the recording, has not the size of the setup, or cannot be read.
    pub fn image(&self, camera: u32, session: u64, sequence: u64) -> Result<GreyImage, RecordingError> {
        let entry = self.frames.get(&(camera, session, sequence)).and_then(|&i| self.entries.get(i));
        let missing = RecordingProblem::NoImage { camera, session, sequence };
        let entry = entry.ok_or_else(|| missing.of(&self.path))?;
        let Content::Frame(header, data) = self.read(entry)?.content else {
            return Err(entry.problem("is no image".to_owned()).of(&self.path));
        };
        let [width, height] = [header.width_px as usize, header.height_px as usize];
        if [width, height] != self.setup.image_size_px {
            let expected = self.setup.image_size_px;
            let what = format!("is {width} × {height} pixels; meta.json says {} × {}", expected[0], expected[1]);
            return Err(entry.problem(what).of(&self.path));
        }
        let rows = data.chunks_exact((header.stride_bytes as usize).max(1));
        let pixels = rows.flat_map(|row| row.iter().take(width)).copied().collect();
        Ok(GreyImage { width, height, pixels })
    }

    /// Images of camera 1 and 2 of a window, in the order of the shifts.
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

    /// Whether a window began before the first image: its own images were taken, but not recorded.
    pub(super) fn begins_after(&self, window: &Window) -> bool {
        let first = [1, 2].into_iter().filter_map(|camera| self.frame_headers(camera).next());
        first.map(|header| header.exposure_start_ns).max().is_none_or(|first_ns| window.first_exposure_ns < first_ns)
    }

    /// Whether an image is there.
    #[must_use]
    pub fn has_image(&self, camera: u32, session: u64, sequence: u64) -> bool {
        self.frames.contains_key(&(camera, session, sequence))
    }

    /// What is true of the scene, where the recording knows.
    ///
    /// # Errors
    /// The attachment is no truth file.
    pub fn truth(&self) -> Result<Option<Truth>, RecordingError> {
        let Some(bytes) = self.truth_bytes()? else { return Ok(None) };
        let truth = Truth::parse(&bytes, self.setup.image_size_px);
        truth.map(Some).map_err(|problem| RecordingProblem::Truth(problem).of(&self.path))
    }

    /// Content of the attachment `truth.npz`, where there is one.
    pub(super) fn truth_bytes(&self) -> Result<Option<Vec<u8>>, RecordingError> {
        self.truth.map(|place| self.bytes_at(place).map_err(|p| p.of(&self.path))).transpose()
    }

    /// A cloud by its number in the order of time, from 0; `None` beyond the last.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn cloud(&self, number: usize) -> Result<Option<Cloud>, RecordingError> {
        let Some(entry) = self.entries.iter().filter(|entry| entry.topic == Topic::Cloud).nth(number) else {
            return Ok(None);
        };
        let points = match self.read(entry)?.content {
            Content::Cloud(_, records) => read_records(&records),
            _ => None,
        };
        let points = points.ok_or_else(|| entry.problem("is no cloud".to_owned()).of(&self.path))?;
        Ok(Some(Cloud { points }))
    }

    fn read(&self, entry: &Entry) -> Result<Message, RecordingError> {
        let data = self.bytes_at(entry.place).map_err(|p| p.of(&self.path))?;
        let content = Content::decode(entry.topic, entry.header.as_ref(), data.into());
        Ok(Message {
            topic: entry.topic,
            log_ns: entry.times.log_ns,
            publish_ns: entry.times.publish_ns,
            content: content.map_err(|what| entry.problem(what).of(&self.path))?,
        })
    }

    /// The scan has seen these bytes, so there are as many.
    fn bytes_at(&self, place: Place) -> Result<Vec<u8>, RecordingProblem> {
        let mut bytes = vec![0; place.bytes];
        self.file.read_exact_at(&mut bytes, place.offset).map_err(RecordingProblem::Unreadable)?;
        Ok(bytes)
    }
}

impl Entry {
    fn problem(&self, what: String) -> RecordingProblem {
        RecordingProblem::Message { topic: self.topic.name(), sequence: self.sequence, offset: self.place.offset, what }
    }
}

/// What a scan has found so far.
#[derive(Default)]
struct Collected {
    texts: BTreeMap<&'static str, String>,
    metadata: Option<BTreeMap<String, String>>,
    account: Option<BTreeMap<String, String>>,
    truth: Option<Place>,
    entries: Vec<Entry>,
    /// Headers whose image or cloud has not come yet.
    headers: BTreeMap<(Topic, u32), (Header, u64)>,
}

impl Collected {
    fn take(&mut self, found: Found<'_>) -> Result<(), RecordingProblem> {
        match found {
            Found::Message(message) => self.message(&message),
            Found::Attachment { name, data, offset, .. } => self.attachment(name, data, offset),
            Found::Metadata { name: METADATA, entries } => {
                check_version(&entries)?;
                self.metadata = Some(entries);
                Ok(())
            }
            Found::Metadata { name: RECORDER_METADATA, entries } => {
                self.account = Some(entries);
                Ok(())
            }
            Found::Metadata { .. } => Ok(()),
        }
    }

    fn attachment(&mut self, name: &str, data: &[u8], offset: u64) -> Result<(), RecordingProblem> {
        if name == TRUTH_FILE {
            self.truth = Some(Place { offset, bytes: data.len() });
        }
        let Some(name) = [CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE].into_iter().find(|n| *n == name) else {
            return Ok(());
        };
        let text = std::str::from_utf8(data);
        let no_text = |_| RecordingProblem::Damaged { offset, what: format!("attachment {name} is no UTF-8 text") };
        self.texts.insert(name, text.map_err(no_text)?.to_owned());
        Ok(())
    }

    fn message(&mut self, found: &FoundMessage<'_>) -> Result<(), RecordingProblem> {
        let FoundMessage { topic, sequence, times, data, offset } = *found;
        let place = Place { offset, bytes: data.len() };
        let mut entry = Entry { topic, sequence, times, place, header: None };
        if topic.is_header() {
            let header = Header::decode(topic, data).map_err(|what| entry.problem(what))?;
            self.headers.insert((topic, sequence), (header, offset));
            return Ok(());
        }
        if let Some(header) = topic.header() {
            let header = self.headers.remove(&(header, sequence)).map(|(header, _)| header);
            entry.header = Some(header.ok_or_else(|| entry.problem("its header is missing".to_owned()))?);
        }
        self.entries.push(entry);
        Ok(())
    }

    fn recording(mut self, path: &Path, file: File) -> Result<Recording, RecordingProblem> {
        let metadata = self.metadata.ok_or(RecordingProblem::Missing { what: "metadata fringeflow" })?;
        if let Some(((topic, sequence), (_, offset))) = self.headers.pop_first() {
            let (topic, what) = (topic.name(), "what it describes is missing".to_owned());
            return Err(RecordingProblem::Message { topic, sequence, offset, what });
        }
        let mut text = |name, what| self.texts.remove(name).ok_or(RecordingProblem::Missing { what });
        let calibration = text(CALIBRATION_FILE, "attachment calibration.yml")?;
        let description = text(META_FILE, "attachment meta.json")?;
        let configuration = text(CONFIGURATION_FILE, "attachment configuration.toml")?;
        let setup = Setup::parse(SetupText { description, calibration }, None)?;
        // Stable: what has the same time stays in the order of the file.
        self.entries.sort_by_key(|entry| entry.times.log_ns);
        let frames = self.entries.iter().enumerate().filter_map(|(i, entry)| match &entry.header {
            Some(Header::Frame(header)) => Some(((header.camera, header.session, header.sequence), i)),
            _ => None,
        });
        let frames = frames.collect();
        Ok(Recording {
            path: path.to_owned(),
            file,
            setup,
            configuration,
            metadata,
            account: self.account.unwrap_or_default(),
            truth: self.truth,
            entries: self.entries,
            frames,
            foreign: BTreeMap::new(),
            bytes: 0,
        })
    }
}

/// Refuses a newer format before anything in it is misread.
pub(super) fn check_version(metadata: &BTreeMap<String, String>) -> Result<(), RecordingProblem> {
    let writer = metadata.get("version").cloned().unwrap_or_default();
    match metadata.get("format").and_then(|format| format.parse::<u64>().ok()) {
        Some(found) if found > FORMAT_VERSION => Err(RecordingProblem::NewerFormat { found, writer }),
        Some(1..) => Ok(()),
        Some(0) | None => Err(RecordingProblem::Missing { what: "format version in its metadata fringeflow" }),
    }
}
