//! What crosses a process border: plain structs of fixed layout, the same in Rust, C, C++ and Python.
//!
//! Every struct is `#[repr(C)]`, has no hidden padding, and carries a versioned type name: a reader of another version
//! finds no channel instead of misreading one. Whoever changes a field raises the number in the name, and
//! `docs/projector-driver.md` and `include/fringeflow.h` with it.
//!
//! | message | channel | payload beside it |
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
//! Times are nanoseconds of `CLOCK_MONOTONIC`. `published` counts what a channel's publisher has sent, without gaps and
//! across its restarts: a gap at the receiver is a loss in between, and is counted there.

#![forbid(unsafe_code)]

mod control;
mod frame;
mod health_report;
mod incident;
mod maps;
mod meaning;
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
pub use maps::{Block, CloudHeader, CorrespondenceHeader, DRIFT_NUMBERS, DriftNumbers, Fit, MapsHeader};
pub use pattern::{PATTERN_FRINGES, PatternEvent};
pub use report::{Counts, DropReason, Skew, Stage, StageReport};
pub use tracking::{LostReason, MODEL_POINT_BYTES, ModelHeader, PoseReport, PriorHeader, TrackingState};
pub use window::Window;
pub use window_report::{DELTA_PARTS, DriftReport, OUTCOMES, WindowReport};
