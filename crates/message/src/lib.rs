//! Messages between processes: plain structs of fixed layout, the same in Rust, C, C++ and Python.
//!
//! ```text
//!  cameras ──────► FrameHeader ─┐
//!                               ├─► synchronization ─► Window ─► MapsHeader ─► CorrespondenceHeader ─► CloudHeader
//!  projector ────► PatternEvent ┘                         ▲                                                │
//!                                                         └────────────── PriorHeader ◄─ PoseReport ◄──────┘
//! ```
//!
//! | message | channel | payload |
//! |---|---|---|
//! | [`FrameHeader`] | `cam1/frame`, `cam2/frame` | bytes of the image |
//! | [`PatternEvent`] | `projector/pattern` | – |
//! | [`MapsHeader`] | `phase/maps` | [`Block`]s, see `fringeflow_wire` |
//! | [`CorrespondenceHeader`] | `correspondence/map` | [`Block`]s, see `fringeflow_wire` |
//! | [`CloudHeader`] | `cloud` | records of the exported fields, lengths in metres |
//! | [`StageReport`] | `report/stage` | – |
//! | [`WindowReport`] | `report/window` | – |
//! | [`PoseReport`] | `tracking/pose` | – |
//! | [`PriorHeader`] | `tracking/prior` | inverse depths, see `fringeflow_wire` |
//! | [`ModelHeader`] | `tracking/model` | points of [`MODEL_POINT_BYTES`] |
//! | [`ScanState`] | `control/state` | – |
//! | [`ControlRequest`], [`ControlResponse`] | `control` | – |
//!
//! Every struct is `#[repr(C)]`, has no hidden padding, and carries a versioned type name. A reader of another version
//! finds no channel, instead of misreading one. When a field changes, the number in the type name is increased, and
//! `docs/projector-driver.md` and `include/fringeflow.h` are updated.
//!
//! Times are nanoseconds of `CLOCK_MONOTONIC`. `published` numbers the messages of a channel without gaps, also across
//! restarts of the publisher. The receiver counts a gap as messages lost in the channel.
//!
//! [`synchronization`] finds the images that belong together:
//!
//! ```
//! use fringeflow_message::synchronization::{Settings, StepSource, Synchronizer};
//! use fringeflow_message::{FrameHeader, PATTERN_FRINGES, PatternEvent};
//!
//! let source = StepSource::Events { period_px: 16.0 };
//! let (frame_period_ns, max_skew_ns) = (10_000_000, 500_000);
//! let settings =
//!     Settings { steps: 4, images: 4, frame_period_ns, max_skew_ns, source, window_stride: 4, max_waiting: 8 };
//! let mut synchronizer = Synchronizer::new(settings)?;
//! for number in 0..4 {
//!     let exposure_start_ns = 1_000_000_000 + 10_000_000 * number;
//!     let received_ns = exposure_start_ns + 9_000_000;
//!     let event = PatternEvent { sequence: number, exposure_start_ns, period_px: 16.0, ..PatternEvent::default() };
//!     synchronizer.push_pattern(PatternEvent { step: number as u32, steps: 4, kind: PATTERN_FRINGES, ..event });
//!     for camera in [1, 2] {
//!         let header = FrameHeader { camera, sequence: number, published: number, ..FrameHeader::default() };
//!         let pixels = format!("image {number} of camera {camera}");
//!         synchronizer.push_frame(FrameHeader { exposure_start_ns, received_ns, ..header }, pixels);
//!     }
//! }
//! let images = synchronizer.next_window().expect("four pairs are a window");
//! assert_eq!((images.window.first_step, images.cam2[3].as_str()), (0, "image 3 of camera 2"));
//! # Ok::<(), fringeflow_message::synchronization::SettingsError>(())
//! ```

#![forbid(unsafe_code)]

mod codes;
mod control;
mod frame;
mod health_report;
mod incident;
mod maps;
mod pattern;
mod report;
pub mod synchronization;
mod tracking;
mod window;
mod window_report;

pub use control::{Command, ControlRequest, ControlResponse, ScanState, Text};
pub use frame::{FrameHeader, flags};
pub use fringeflow_base::grey::PixelFormat;
pub use health_report::{GAUGES, GaugeReport, HealthReport};
pub use incident::Incident;
pub use maps::{Block, CloudHeader, CorrespondenceHeader, DELTA_PARTS, DRIFT_NUMBERS, DriftNumbers, Fit, MapsHeader};
pub use pattern::{PATTERN_FRINGES, PatternEvent};
pub use report::{Counts, DropMeaning, DropReason, Skew, Stage, StageReport};
pub use tracking::{LostReason, MODEL_POINT_BYTES, ModelHeader, PoseReport, PriorHeader, TrackingState};
pub use window::Window;
pub use window_report::{DriftReport, OUTCOMES, WindowReport};
