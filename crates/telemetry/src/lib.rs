//! Statistics of a run from the reports of its stages: counts, rates, latencies, and the times of each window.
//!
//! ```text
//! StageReport, WindowReport ──► RunReport ──► Tally (whole run), History (timeline), WorstWindows
//!   (live or from a recording)           └──► HealthRecord
//! ```
//!
//! [`Tally`] holds the totals of each stage, [`History`] the timeline as [`Sample`]s of equal intervals, and
//! [`Journey`] the times of one window. [`RunReport`] combines them in bounded memory. [`TraceWriter`] writes a file
//! for trace viewers. No function here reads a clock: the same reports give the same figures, live or later.
//!
//! ```
//! use fringeflow_message::{Counts, Stage, StageReport};
//! use fringeflow_telemetry::{Exposures, RunReport, WORST_WINDOWS};
//!
//! let mut run = RunReport::new(Exposures::Live, WORST_WINDOWS);
//! for window in 1..=2 {
//!     let (exposure_start_ns, passed_ns) = (window * 1_000_000_000, window * 1_000_000_000 + 40_000_000);
//!     let counts = Counts { taken: window, passed: window, ..Counts::default() };
//!     let report = StageReport { stage: Stage::Cloud as u32, of_item: 1, counts, ..StageReport::default() };
//!     run.add(&StageReport { exposure_start_ns, passed_ns, time_ns: passed_ns, ..report });
//! }
//! assert_eq!(run.tally().stage(Stage::Cloud).unwrap().mean_rate_hz(), Some(1.0));
//! assert_eq!(run.tally().total().count(), 2);
//! ```

#![forbid(unsafe_code)]

mod capacity;
mod cause;
mod drop_lines;
pub mod health;
mod health_figures;
mod history;
mod interval;
mod journey;
mod latencies;
mod load;
mod losses;
mod run_report;
mod stage_figures;
mod tally;
mod trace;
mod tracking_figures;
mod verdict;
mod window_figures;
mod worst_windows;

pub use capacity::{Bound, Capacity, Remedy};
pub use cause::Cause;
pub use drop_lines::{DropKind, DropLine};
pub use health_figures::{GaugeFigures, HealthFigures, HealthRecord};
pub use history::History;
pub use interval::{Interval, Sample, WindowSample};
pub use journey::{Journey, Segment};
pub use latencies::{BUCKETS_NS, Latencies, Latency};
pub use load::Load;
pub use losses::Losses;
pub use run_report::{Exposures, RunReport, WORST_WINDOWS};
pub use stage_figures::{SkewFigures, StageFigures};
pub use tally::{StageTally, Tally};
pub use trace::TraceWriter;
pub use tracking_figures::{TrackingFigures, TrackingWatch};
pub use verdict::{LeftOut, Verdict};
pub use window_figures::{CameraFigures, DeltaCounts, DriftFigures, MotionFigures, Shares, WindowFigures};
pub use worst_windows::WorstWindows;
