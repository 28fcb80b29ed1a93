//! Writes a run as a file for trace viewers: Perfetto, `chrome://tracing`.
//!
//! The format is Chrome's trace event format (JSON). It has a process for each service, a thread for each stage, and a
//! slice for each item, from receiving it to passing it on. A stage that works on several items at once has as many
//! threads. Arrows connect the stages of one window. Times are microseconds of `CLOCK_MONOTONIC`.

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde_json::{Value, json};

use fringeflow_message::{Stage, StageReport};

/// Name of the arrows.
const ARROW: &str = "window";
/// Number of stages.
const STAGES: u32 = Stage::ALL.len() as u32;

/// Writes a trace, report by report.
#[derive(Debug)]
pub struct TraceWriter<W: Write> {
    out: W,
    /// Processes and stages that are in the file; by their threads, the end of the last slice, nanoseconds.
    threads_end_ns: BTreeMap<(u32, Stage), Vec<u64>>,
    is_first: bool,
}

impl<W: Write> TraceWriter<W> {
    /// Starts a trace.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn new(mut out: W) -> io::Result<Self> {
        out.write_all(b"{\"displayTimeUnit\":\"ms\",\"traceEvents\":[")?;
        Ok(Self { out, threads_end_ns: BTreeMap::new(), is_first: true })
    }

    /// Adds a report. Ignores keep-alive reports and reports of unknown stages.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn add(&mut self, report: &StageReport) -> io::Result<()> {
        let Some(stage) = Stage::from_code(report.stage).filter(|_| report.of_item != 0) else { return Ok(()) };
        let tid = self.thread(report, stage)?;
        let duration_ns = report.passed_ns.saturating_sub(report.taken_ns);
        self.event(&json!({
            "ph": "X", "name": stage.name(), "cat": "stage", "pid": report.pid, "tid": tid,
            "ts": micros(report.taken_ns), "dur": micros(duration_ns),
            "args": { "exposure_start_ns": report.exposure_start_ns, "received_ns": report.received_ns },
        }))?;
        match stage {
            Stage::Phase => self.arrow("s", report, tid),
            Stage::Correspondence => self.arrow("t", report, tid),
            Stage::Cloud => self.arrow("f", report, tid),
            _ => Ok(()),
        }
    }

    /// Returns the first thread of the stage that has no slice at the time of the item, and names it if it is new.
    fn thread(&mut self, report: &StageReport, stage: Stage) -> io::Result<u32> {
        let threads_end_ns = self.threads_end_ns.entry((report.pid, stage)).or_default();
        let is_free = |end_ns: &u64| *end_ns <= report.taken_ns;
        let number = threads_end_ns.iter().position(is_free).unwrap_or(threads_end_ns.len());
        if let Some(end_ns) = threads_end_ns.get_mut(number) {
            *end_ns = report.passed_ns;
        } else {
            threads_end_ns.push(report.passed_ns);
            self.write_names(report.pid, stage, number)?;
        }
        Ok(thread_id(stage, number))
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

    fn write_names(&mut self, pid: u32, stage: Stage, number: usize) -> io::Result<()> {
        let (tid, name) = (thread_id(stage, number), stage.name());
        self.event(&json!({"ph": "M", "name": "thread_name", "pid": pid, "tid": tid, "args": {"name": name}}))?;
        self.event(&json!({"ph": "M", "name": "process_name", "pid": pid, "args": {"name": process(stage)}}))?;
        self.event(&json!({"ph": "M", "name": "process_sort_index", "pid": pid, "args": {"sort_index": stage as u32}}))
    }

    /// Writes an event of the arrow that connects the stages of a window. The viewer attaches it to the slice around
    /// its time.
    fn arrow(&mut self, phase: &str, report: &StageReport, tid: u32) -> io::Result<()> {
        let middle_ns = report.taken_ns.midpoint(report.passed_ns.max(report.taken_ns));
        self.event(&json!({
            "ph": phase, "name": ARROW, "cat": ARROW, "id": report.exposure_start_ns, "bp": "e",
            "pid": report.pid, "tid": tid, "ts": micros(middle_ns),
        }))
    }

    fn event(&mut self, event: &Value) -> io::Result<()> {
        self.out.write_all(if std::mem::take(&mut self.is_first) { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut self.out, event).map_err(io::Error::from)
    }
}

/// Number of a thread of a stage.
fn thread_id(stage: Stage, number: usize) -> u32 {
    stage as u32 + STAGES * number as u32
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
    fn items_in_work_at_once_have_threads_of_their_own() {
        let mut trace = TraceWriter::new(Vec::new()).unwrap();
        for (taken_ns, passed_ns) in [(0, 4_000), (2_000, 6_000), (4_000, 8_000), (7_000, 9_000)] {
            let report = StageReport { passed_ns, ..report(Stage::Correspondence, 6, taken_ns) };
            trace.add(&report).unwrap();
        }
        let trace: Value = serde_json::from_slice(&trace.finish().unwrap()).unwrap();
        let slices = trace["traceEvents"].as_array().unwrap().iter().filter(|event| event["ph"] == "X");
        let threads: Vec<u64> = slices.map(|slice| slice["tid"].as_u64().unwrap()).collect();
        let [first, second] = [0, 1].map(|number| u64::from(thread_id(Stage::Correspondence, number)));
        assert_eq!(threads, [first, second, first, second]);
    }

    #[test]
    fn an_empty_trace_is_valid() {
        let trace = TraceWriter::new(Vec::new()).unwrap().finish().unwrap();
        assert_eq!(serde_json::from_slice::<Value>(&trace).unwrap()["traceEvents"], json!([]));
    }
}
