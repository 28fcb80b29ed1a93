//! Writes a run as a file for trace viewers: Perfetto, `chrome://tracing`.
//!
//! The format is Chrome's trace event format (JSON). It has a process for each service, a thread for each stage, and a
//! slice for each item, from receiving it to passing it on. Arrows connect the stages of one window. Times are
//! microseconds of `CLOCK_MONOTONIC`.

use std::collections::BTreeSet;
use std::io::{self, Write};

use serde_json::{Value, json};

use fringeflow_message::{Stage, StageReport};

/// Name of the arrows.
const ARROW: &str = "window";

/// Writes a trace, report by report.
#[derive(Debug)]
pub struct TraceWriter<W: Write> {
    out: W,
    /// Processes and stages whose names are already in the file.
    named: BTreeSet<(u32, Stage)>,
    is_first: bool,
}

impl<W: Write> TraceWriter<W> {
    /// Starts a trace.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn new(mut out: W) -> io::Result<Self> {
        out.write_all(b"{\"displayTimeUnit\":\"ms\",\"traceEvents\":[")?;
        Ok(Self { out, named: BTreeSet::new(), is_first: true })
    }

    /// Adds a report. Ignores keep-alive reports and reports of unknown stages.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn add(&mut self, report: &StageReport) -> io::Result<()> {
        let Some(stage) = Stage::from_code(report.stage).filter(|_| report.of_item != 0) else { return Ok(()) };
        if self.named.insert((report.pid, stage)) {
            self.write_names(report.pid, stage)?;
        }
        let duration_ns = report.passed_ns.saturating_sub(report.taken_ns);
        self.event(&json!({
            "ph": "X", "name": stage.name(), "cat": "stage", "pid": report.pid, "tid": stage as u32,
            "ts": micros(report.taken_ns), "dur": micros(duration_ns),
            "args": { "exposure_start_ns": report.exposure_start_ns, "received_ns": report.received_ns },
        }))?;
        match stage {
            Stage::Phase => self.arrow("s", report, stage),
            Stage::Correspondence => self.arrow("t", report, stage),
            Stage::Cloud => self.arrow("f", report, stage),
            _ => Ok(()),
        }
    }

    /// Ends the trace. The file is valid JSON only afterwards.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.write_all(b"\n]}\n")?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn write_names(&mut self, pid: u32, stage: Stage) -> io::Result<()> {
        let (tid, name) = (stage as u32, stage.name());
        self.event(&json!({"ph": "M", "name": "thread_name", "pid": pid, "tid": tid, "args": {"name": name}}))?;
        self.event(&json!({"ph": "M", "name": "process_name", "pid": pid, "args": {"name": process(stage)}}))?;
        self.event(&json!({"ph": "M", "name": "process_sort_index", "pid": pid, "args": {"sort_index": tid}}))
    }

    /// Writes an event of the arrow that connects the stages of a window. The viewer attaches it to the slice around
    /// its time.
    fn arrow(&mut self, phase: &str, report: &StageReport, stage: Stage) -> io::Result<()> {
        let middle_ns = report.taken_ns.midpoint(report.passed_ns.max(report.taken_ns));
        self.event(&json!({
            "ph": phase, "name": ARROW, "cat": ARROW, "id": report.exposure_start_ns, "bp": "e",
            "pid": report.pid, "tid": stage as u32, "ts": micros(middle_ns),
        }))
    }

    fn event(&mut self, event: &Value) -> io::Result<()> {
        self.out.write_all(if std::mem::take(&mut self.is_first) { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut self.out, event).map_err(io::Error::from)
    }
}

/// Name of the process of a stage.
fn process(stage: Stage) -> &'static str {
    match stage {
        Stage::Camera1 | Stage::Camera2 => "cameras",
        Stage::Projector => "projector",
        Stage::Pattern | Stage::Pairing | Stage::Windowing | Stage::Phase => "phase",
        Stage::Correspondence => "correspondence",
        Stage::Cloud => "cloud",
        Stage::Tracking => "tracking",
        Stage::Recorder => "recorder",
    }
}

fn micros(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(stage: Stage, pid: u32, taken_ns: u64) -> StageReport {
        let passed_ns = taken_ns + 2_000;
        StageReport {
            stage: stage as u32,
            pid,
            of_item: 1,
            exposure_start_ns: 77,
            taken_ns,
            passed_ns,
            ..StageReport::default()
        }
    }

    #[test]
    fn a_window_is_three_slices_joined_by_arrows() {
        let mut trace = TraceWriter::new(Vec::new()).unwrap();
        for (stage, pid, taken_ns) in
            [(Stage::Phase, 5, 1_000), (Stage::Correspondence, 6, 4_000), (Stage::Cloud, 7, 8_000)]
        {
            trace.add(&report(stage, pid, taken_ns)).unwrap();
        }
        trace.add(&StageReport { of_item: 0, ..report(Stage::Cloud, 7, 9_000) }).unwrap();
        trace.add(&StageReport { stage: 99, ..report(Stage::Cloud, 7, 9_000) }).unwrap();
        let trace: Value = serde_json::from_slice(&trace.finish().unwrap()).unwrap();
        let events = trace["traceEvents"].as_array().unwrap();
        let with_phase = |phase: &str| events.iter().filter(|event| event["ph"] == phase).collect::<Vec<_>>();
        assert_eq!(["X", "M", "s", "t", "f"].map(|phase| with_phase(phase).len()), [3, 9, 1, 1, 1]);
        let second = with_phase("X")[1];
        assert_eq!((second["ts"].as_f64(), second["dur"].as_f64()), (Some(4.0), Some(2.0)));
        assert_eq!(with_phase("f")[0]["id"], 77);
    }

    #[test]
    fn an_empty_trace_is_valid() {
        let trace = TraceWriter::new(Vec::new()).unwrap().finish().unwrap();
        assert_eq!(serde_json::from_slice::<Value>(&trace).unwrap()["traceEvents"], json!([]));
    }
}
