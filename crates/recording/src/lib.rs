//! Recordings: MCAP files of what the channels carried, and of all that a measurement needs beside it.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/cam1/frame`, `/cam2/frame` | foxglove.RawImage, mono8 | images |
//! | `/cam1/header`, `/cam2/header` | fringeflow.FrameHeader | their headers |
//! | `/projector/pattern` | fringeflow.PatternEvent | what the projector showed |
//! | `/phase/maps` | fringeflow.PhaseMaps | phase maps, where they are recorded |
//! | `/correspondence/map` | fringeflow.CorrespondenceMap | correspondences, where they are recorded |
//! | `/cloud` | foxglove.PointCloud | clouds: the records of the exported fields, lengths in metres |
//! | `/cloud/header` | fringeflow.CloudHeader | their headers |
//! | `/report/stage` | fringeflow.StageReport | what the stages did and lost |
//! | `/report/window` | fringeflow.WindowReport | how well each window was measured |
//! | `/log` | foxglove.Log | marks, and what the recorder lost |
//! | `/tracking/pose` | fringeflow.PoseReport | where the scanner was at each cloud that was tracked, or that it was lost |
//! | `/tracking/prior` | fringeflow.Prior | what each cloud told of the windows behind it: motion and coarse depth |
//! | `/tf` | foxglove.FrameTransforms | camera 2, projector and volume in the frame of camera 1, once; `cam1` in `model`, each pose |
//! | `/truth/pose` | foxglove.FrameTransform | of the virtual scanner: `object` in `cam1_exact`, at every exposure |
//! | `/cam1/calibration`, `/cam2/calibration` | foxglove.CameraCalibration | for viewers, once |
//!
//! An image or cloud and its header have the same MCAP sequence number, the header first. `log_time` is when a message
//! was received or published, `publish_time` the start of its exposure; both are nanoseconds of `CLOCK_MONOTONIC`, and
//! the metadata `fringeflow` says which wall clock that was. Attachments: `calibration.yml`, `meta.json`,
//! `configuration.toml` (what the measurement reads, so that a recording has the same numbers as the rig had), and
//! `truth.npz` where it is known. The metadata `fringeflow.recorder` at the end says what was written and what was lost.
//!
//! The schema of our own messages is `schema/fringeflow.proto`.

#![forbid(unsafe_code)]

mod buffers;
mod check;
mod collect;
mod content;
mod convert;
mod counts;
mod error;
mod export;
mod fields;
mod file;
mod held;
mod import;
mod mcap_writer;
mod offline;
mod opening;
mod pairs;
mod priors;
mod reader;
mod recordable;
mod recorder;
mod recover;
mod scan;
mod schema;
mod summary;
mod topic;
mod tracking;
mod truth_poses;
mod writer;

pub use check::Check;
pub use content::{Content, Message};
pub use counts::RecorderCounts;
pub use error::{RecordingError, RecordingProblem};
pub use export::{ExportError, export_images};
pub use file::UNFINISHED;
pub use import::{ImportError, ImportOptions, import};
pub use offline::OfflineRecorder;
pub use opening::{Origin, standing_messages};
pub use pairs::{ImagePair, cycles, windows};
pub use priors::{Known, Priors};
pub use reader::Recording;
pub use recordable::{Encoded, Recordable};
pub use recorder::{DEFAULT_MIN_FREE_BYTES, DEFAULT_QUEUE_BYTES, MOST_HELD, Recorded, Recorder};
pub use recover::{Recovered, recover};
pub use summary::{Remark, StageSummary, Summary, TopicSummary};
pub use topic::Topic;
pub use truth_poses::{TruthPose, TruthPoses};
pub use writer::Opening;

#[cfg(test)]
mod tests;

/// Version of the format; raised when older readers would misread a recording.
pub const FORMAT_VERSION: u64 = 1;
/// Name of the metadata about origin and setup.
const METADATA: &str = "fringeflow";
/// Name of the metadata about what was written and lost.
const RECORDER_METADATA: &str = "fringeflow.recorder";
/// Name of the attachment that holds the configuration.
pub const CONFIGURATION_FILE: &str = "configuration.toml";
