//! An opened recording. Opening checks the whole file; messages are read on request.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use fringeflow::cloud::{Cloud, read_records};
use fringeflow_dataset::{CALIBRATION_FILE, GreyImage, META_FILE, Setup, SetupText, Truth};
use fringeflow_message::{CloudHeader, FrameHeader, PixelFormat, Window};

use crate::collected::{Collected, format_version};
use crate::content::Header;
use crate::entry::Entry;
use crate::place::{Place, PlaceReader};
use crate::recordable::Times;
use crate::scan::{ScanMode, Scanned, scan};
use crate::{
    CONFIGURATION_FILE, Content, Message, Origin, RecordingError, RecordingProblem, Topic, TruthPose, TruthPoses,
    WALL_CLOCK_VERSION,
};

/// An opened recording.
#[derive(Debug)]
pub struct Recording {
    pub(super) path: PathBuf,
    pub(super) file: PlaceReader,
    pub(super) setup: Setup,
    pub(super) configuration: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) recorder_account: BTreeMap<String, String>,
    pub(super) truth: Option<Place>,
    pub(super) entries: Vec<Entry>,
    /// Index of the image entries by camera, session and sequence number.
    pub(super) frames: BTreeMap<(u32, u64, u64), usize>,
    pub(super) foreign_messages: BTreeMap<String, u64>,
    pub(super) bytes: u64,
}

impl Recording {
    /// Opens a recording. Reads the whole file; checks the checksums, the counts and the setup, and that every header
    /// has its message.
    ///
    /// # Errors
    /// The file is not a recording, or it is of a newer version, unfinished or damaged. The error states file, offset
    /// and remedy.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let unreadable = |e| RecordingProblem::Unreadable(e).in_file(path);
        let file = File::open(path).map_err(unreadable)?;
        let mut collected = Collected::default();
        let scanned = scan(&file, ScanMode::Strict, &mut |found| collected.add(found)).map_err(|p| p.in_file(path))?;
        Self::from_collected(collected, path, file, scanned).map_err(|p| p.in_file(path))
    }

    /// Creates the recording after the whole file has been scanned.
    fn from_collected(
        mut collected: Collected,
        path: &Path,
        file: File,
        scanned: Scanned,
    ) -> Result<Self, RecordingProblem> {
        collected.check(&scanned)?;
        let metadata = collected.metadata.ok_or(RecordingProblem::Missing { what: "metadata fringeflow" })?;
        let mut text = |name, what| collected.texts.remove(name).ok_or(RecordingProblem::Missing { what });
        let calibration = text(CALIBRATION_FILE, "attachment calibration.yml")?;
        let description = text(META_FILE, "attachment meta.json")?;
        let configuration = text(CONFIGURATION_FILE, "attachment configuration.toml")?;
        let setup = Setup::parse(SetupText { description, calibration }, None)?;
        // Time stamps of messages are those of CLOCK_MONOTONIC, so the times of the messages are converted to it.
        if format_version(&metadata).is_some_and(|version| version >= WALL_CLOCK_VERSION) {
            let clock = Origin::from_metadata(&metadata).wall_clock();
            for Times { log_ns, publish_ns } in collected.entries.iter_mut().map(|entry| &mut entry.times) {
                (*log_ns, *publish_ns) = (clock.monotonic_ns(*log_ns), clock.monotonic_ns(*publish_ns));
            }
        }
        // The sort is stable: messages with the same time stay in the order of the file.
        collected.entries.sort_by_key(|entry| entry.times.log_ns);
        let frames = collected.entries.iter().enumerate().filter_map(|(i, entry)| match &entry.header {
            Some(Header::Frame(header)) => Some(((header.camera, header.session, header.sequence), i)),
            _ => None,
        });
        let frames = frames.collect();
        Ok(Self {
            path: path.to_owned(),
            file: PlaceReader::new(file),
            setup,
            configuration,
            metadata,
            recorder_account: collected.recorder_account,
            truth: collected.truth,
            entries: collected.entries,
            frames,
            foreign_messages: scanned.foreign_messages,
            bytes: scanned.bytes,
        })
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

    /// Computer and time at the start of the recording.
    #[must_use]
    pub fn origin(&self) -> Origin {
        Origin::from_metadata(&self.metadata)
    }

    /// Version of fringeflow that wrote the recording.
    #[must_use]
    pub fn writer_version(&self) -> &str {
        self.metadata.get("version").map_or("", String::as_str)
    }

    /// Final counts of the recorder: messages taken, written and lost, by topic and reason. Empty if the recorder was
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

    /// Returns all messages in the order of their times. Each message is read when the iterator reaches it.
    pub fn messages(&self) -> impl Iterator<Item = Result<Message, RecordingError>> + '_ {
        self.entries.iter().map(|entry| self.read(entry))
    }

    /// Returns the messages of one topic in the order of their times.
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

    /// Reads one image of a camera and removes the padding of its rows.
    ///
    /// # Errors
    /// The image is not in the recording, does not have the size of the setup, or cannot be read.
    pub fn image(&self, camera: u32, session: u64, sequence: u64) -> Result<GreyImage, RecordingError> {
        let entry = self.frames.get(&(camera, session, sequence)).and_then(|&i| self.entries.get(i));
        let missing = RecordingProblem::NoImage { camera, session, sequence };
        let entry = entry.ok_or_else(|| missing.in_file(&self.path))?;
        let Content::Frame(header, data) = self.read(entry)?.content else {
            return Err(entry.problem("is not an image".to_owned()).in_file(&self.path));
        };
        let [width, height] = [header.width_px as usize, header.height_px as usize];
        if [width, height] != self.setup.image_size_px {
            let expected = self.setup.image_size_px;
            let what = format!("is {width} × {height} pixels; meta.json states {} × {}", expected[0], expected[1]);
            return Err(entry.problem(what).in_file(&self.path));
        }
        // The format was checked when the header was decoded.
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

    /// Whether the recording starts after the start of a window, so that images of the window are not recorded.
    #[must_use]
    pub fn begins_after(&self, window: &Window) -> bool {
        let first = [1, 2].into_iter().filter_map(|camera| self.frame_headers(camera).next());
        first.map(|header| header.exposure_start_ns).max().is_none_or(|first_ns| window.first_exposure_ns < first_ns)
    }

    /// Whether the recording contains an image.
    #[must_use]
    pub fn has_image(&self, camera: u32, session: u64, sequence: u64) -> bool {
        self.frames.contains_key(&(camera, session, sequence))
    }

    /// Reads the ground truth of the scene, if the recording contains it.
    ///
    /// # Errors
    /// The attachment is not a valid truth file.
    pub fn truth(&self) -> Result<Option<Truth>, RecordingError> {
        let Some(bytes) = self.truth_bytes()? else { return Ok(None) };
        let truth = Truth::parse(&bytes, self.setup.image_size_px);
        truth.map(Some).map_err(|problem| RecordingProblem::Truth(problem).in_file(&self.path))
    }

    /// Returns the content of the attachment `truth.npz`, if there is one.
    pub(super) fn truth_bytes(&self) -> Result<Option<Vec<u8>>, RecordingError> {
        self.truth.map(|place| self.file.read(place).map_err(|p| p.in_file(&self.path))).transpose()
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
        let points = points.ok_or_else(|| entry.problem("is not a cloud".to_owned()).in_file(&self.path))?;
        Ok(Some(Cloud { points }))
    }

    fn read(&self, entry: &Entry) -> Result<Message, RecordingError> {
        let data = self.file.read(entry.place).map_err(|p| p.in_file(&self.path))?;
        let content = Content::decode(entry.topic, entry.header.as_ref(), data.into());
        Ok(Message {
            topic: entry.topic,
            log_ns: entry.times.log_ns,
            publish_ns: entry.times.publish_ns,
            content: content.map_err(|what| entry.problem(what).in_file(&self.path))?,
        })
    }

    /// Reads the true poses of the object; empty if the recording has none.
    ///
    /// # Errors
    /// A pose cannot be read.
    pub fn truth_poses(&self) -> Result<TruthPoses, RecordingError> {
        let mut poses = Vec::new();
        for message in self.messages_of(Topic::TruthPose) {
            let message = message?;
            if let Content::TruthPose(cam1_from_object) = message.content {
                poses.push(TruthPose { exposure_start_ns: message.publish_ns, cam1_from_object });
            }
        }
        Ok(TruthPoses::new(poses))
    }
}
