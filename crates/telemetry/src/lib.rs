//! What the stages report, gathered: counts, rates, latencies, where the time of each window went.
//!
//! In: [`StageReport`](fringeflow_message::StageReport)s and [`WindowReport`](fringeflow_message::WindowReport)s in the order they
//! came, live or from a recording. Out: a [`Tally`] over the whole run, [`Sample`]s of equal spans of it, [`Journey`]s of the
//! windows, and the [`TraceWriter`]'s file for trace viewers; a [`RunReport`] is all of it but the trace, in bounded memory.
//! Nothing here reads a clock: the same reports give the same figures wherever they are asked for.

#![forbid(unsafe_code)]

mod cause;
mod drop_lines;
pub mod health;
mod health_figures;
mod history;
mod interval;
mod journey;
mod latencies;
mod losses;
mod pace;
mod run_report;
mod stage_figures;
mod tally;
mod trace;
mod tracking_figures;
mod window_figures;
mod worst_windows;

pub use cause::Cause;
pub use drop_lines::{DropKind, DropLine};
pub use health_figures::{GaugeFigures, GaugeRecord, HealthFigures, HealthRecord};
pub use history::History;
pub use interval::{Interval, Sample, WindowSample};
pub use journey::{Journey, Segment};
pub use latencies::{BUCKETS_NS, Latencies, Latency};
pub use losses::Losses;
pub use pace::Pace;
pub use run_report::{Exposures, RunReport, WORST_WINDOWS};
pub use stage_figures::{SkewFigures, StageFigures};
pub use tally::{StageTally, Tally};
pub use trace::TraceWriter;
pub use tracking_figures::{TrackingFigures, TrackingWatch};
pub use window_figures::{CameraFigures, DeltaCounts, DriftFigures, MotionFigures, Shares, WindowFigures};
pub use worst_windows::WorstWindows;
