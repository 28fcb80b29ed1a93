//! Recordings: MCAP files with the messages of the channels and everything else that a measurement needs.
//!
//! ```text
//!  channels ─► Recordable ─► queue ─► MCAP writer ─► NAME.mcap ─► scan ─► Recording ─► messages, image pairs, priors
//!                              └─ full: counted as lost    └─ damaged: recover()
//! ```
//!
//! | topic | schema | content |
//! |---|---|---|
//! | `/cam1/frame`, `/cam2/frame` | foxglove.RawImage | images |
//! | `/cam1/header`, `/cam2/header` | fringeflow.FrameHeader | headers of the images |
//! | `/projector/pattern` | fringeflow.PatternEvent | patterns of the projector |
//! | `/phase/maps` | fringeflow.PhaseMaps | phase maps, if they are recorded |
//! | `/correspondence/map` | fringeflow.CorrespondenceMap | correspondences, if they are recorded |
//! | `/cloud` | foxglove.PointCloud | clouds: records of the exported fields, lengths in metres |
//! | `/cloud/header` | fringeflow.CloudHeader | headers of the clouds |
//! | `/report/stage` | fringeflow.StageReport | work and losses of the stages |
//! | `/report/window` | fringeflow.WindowReport | quality of each window |
//! | `/log` | foxglove.Log | marks, and losses of the recorder |
//! | `/tracking/pose` | fringeflow.PoseReport | pose of the scanner at each tracked cloud, or why it was lost |
//! | `/tracking/prior` | fringeflow.Prior | prior of the next windows: motion and coarse depth |
//! | `/tf` | foxglove.FrameTransforms | camera 2, projector and volume in the frame of camera 1, once; `cam1` in `model`, each pose |
//! | `/truth/pose` | foxglove.FrameTransform | of the virtual scanner: `object` in `cam1_exact`, at every exposure |
//! | `/cam1/calibration`, `/cam2/calibration` | foxglove.CameraCalibration | for viewers, once |
//!
//! An image or cloud and its header have the same MCAP sequence number; the header comes first. `log_time` is the time
//! of receipt or publication, `publish_time` the start of the exposure. Both are nanoseconds since 1970. The time stamps
//! in messages of Fringeflow's own schemas are those of `CLOCK_MONOTONIC`; the metadata `fringeflow` relate both clocks
//! ([`WallClock`]), and messages are read with the times of `CLOCK_MONOTONIC`. The attachments `calibration.yml`, `meta.json` and
//! `configuration.toml` are read by the measurement, so its numbers are the same as those of the rig; `truth.npz` is
//! attached if there is ground truth. The metadata `fringeflow.recorder` at the end count written and lost messages.
//!
//! The schema of the messages of Fringeflow is `schema/fringeflow.proto`.
//!
//! ```
//! use fringeflow_recording::{Content, OfflineRecorder, Opening, Origin, Recordable, Recording, Topic};
//! # use fringeflow_lab::simulation::{Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};
//! let folder = tempfile::tempdir()?;
//! # let rig = RigOptions { size_px: [64, 64], period_px: 64.0, sd_rad: 0.0, ..RigOptions::usual(0.025) };
//! # let options = SimulationOptions { board: Board::None, rig, gray: false, ..SimulationOptions::usual(Object::Plane) };
//! # let options = SimulationOptions { steps: 4, noise: NoiseLevel::None, supersampling: 1, ..options };
//! # Simulation::new(options)?.write(&folder.path().join("plane"), || ())?;
//! let setup = fringeflow_dataset::Dataset::open(&folder.path().join("plane"), None)?.setup;
//! let file = folder.path().join("scan.mcap");
//! let origin = Origin::here();
//! let opening = Opening { setup: &setup, configuration: "", origin: &origin, min_free_bytes: 0 };
//! let mut recorder = OfflineRecorder::create(&file, &opening)?;
//! recorder.put(&Recordable::Mark { time_ns: 5, text: "left side" })?;
//! recorder.finish()?;
//!
//! let recording = Recording::open(&file)?;
//! let message = recording.messages_of(Topic::Log).next().expect("the mark")?;
//! assert!(matches!(message.content, Content::Mark(text) if text == "left side"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod block_writer;
mod buffers;
mod check;
mod collected;
mod content;
mod convert;
mod counts;
mod entry;
mod error;
mod export;
mod fields;
mod file;
mod held_content;
mod import;
mod losses;
mod mcap_writer;
mod offline;
mod opening;
mod pairing;
mod pairs;
mod place;
mod priors;
mod reader;
mod recordable;
mod recorder;
mod recover;
mod scan;
mod schema;
mod summary;
mod topic;
mod truth_poses;
mod viewers;
mod wall_clock;
mod writer;

pub use check::Check;
pub use content::{Content, Message};
pub use counts::RecorderCounts;
pub use error::{RecordingError, RecordingProblem};
pub use export::{ExportError, export_images};
pub use fringeflow_wire::prior::{Priors, WindowPrior};
pub use import::{ImportError, ImportOptions, import};
pub use losses::Losses;
pub use offline::OfflineRecorder;
pub use opening::Origin;
pub use pairs::{ImagePair, cycle_starts, window_starts};
pub use reader::Recording;
pub use recordable::{Encoded, Recordable};
pub use recorder::{DEFAULT_MIN_FREE_BYTES, DEFAULT_QUEUE_BYTES, MAX_HELD_IMAGES, Recorded, Recorder};
pub use recover::{Recovered, recover};
pub use summary::{Remark, StageSummary, Summary, TopicSummary};
pub use topic::Topic;
pub use truth_poses::{TruthPose, TruthPoses};
pub use viewers::static_messages;
pub use wall_clock::WallClock;
pub use writer::Opening;

#[cfg(test)]
mod tests;

/// Version of the format. It is increased when older readers would misread a recording.
pub const FORMAT_VERSION: u64 = 2;
/// First version whose log and publish times are those of the wall clock, and not of `CLOCK_MONOTONIC`.
const WALL_CLOCK_VERSION: u64 = 2;
/// Suffix of the name of an unfinished recording.
pub const UNFINISHED: &str = ".part";
/// Suffix during a recovery, so that `NAME.mcap.part` can be recovered to `NAME.mcap`.
const UNFINISHED_RECOVERY: &str = ".recovered.part";
/// Start of the name of the library in the header of a recording.
const LIBRARY: &str = "fringeflow ";
/// Profile in the header of a recording.
const PROFILE: &str = "fringeflow";
/// Name of the metadata about origin and setup.
const METADATA: &str = "fringeflow";
/// Name of the metadata about written and lost messages.
const RECORDER_METADATA: &str = "fringeflow.recorder";
/// Name of the attachment with the configuration.
pub const CONFIGURATION_FILE: &str = "configuration.toml";
