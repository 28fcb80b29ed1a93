//! What the operator sees while an instance runs: a line a stage in a terminal, a log line now and then elsewhere.

use std::io::{IsTerminal, Write, stderr};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use fringeflow_message::{ScanState, Stage};
use fringeflow_runtime::log::{self, Diversion};
use fringeflow_telemetry::{StageTally, Tally};

/// Time between two log lines, nanoseconds.
const LOG_NS: u64 = 10_000_000_000;

/// Shows how the stages fare.
#[derive(Debug)]
pub(crate) struct Display {
    /// Lines of a terminal; `None` where nobody watches.
    lines: Option<MultiProgress>,
    head: ProgressBar,
    stages: Vec<(Stage, ProgressBar)>,
    logged_ns: u64,
    /// Log lines go above those of the terminal, not into them.
    _diversion: Option<Diversion>,
}

impl Display {
    pub(crate) fn new() -> Self {
        let lines = stderr().is_terminal().then(MultiProgress::new);
        let head = line(lines.as_ref());
        let diversion = lines.as_ref().map(|lines| {
            let lines = lines.clone();
            log::divert(move |line| lines.suspend(|| stderr().write_all(line)))
        });
        Self { lines, head, stages: Vec::new(), logged_ns: 0, _diversion: diversion }
    }

    /// Whether somebody watches in a terminal.
    pub(crate) fn is_terminal(&self) -> bool {
        self.lines.is_some()
    }

    /// Shows the present; `waiting` names services that are not ready yet.
    pub(crate) fn show(&mut self, tally: &Tally, state: &ScanState, waiting: &[&str], now_ns: u64) {
        if self.lines.is_some() {
            self.head.set_message(headline(state, waiting));
            for (stage, of_stage) in tally.stages() {
                self.line_of(stage).set_message(stage_line(stage, of_stage, now_ns));
            }
        } else if now_ns.saturating_sub(self.logged_ns) >= LOG_NS {
            self.logged_ns = now_ns;
            let stages: Vec<String> = tally.stages().map(|(stage, of_stage)| brief(stage, of_stage, now_ns)).collect();
            tracing::info!("{}: {}", headline(state, waiting), stages.join(", "));
        }
    }

    /// Leaves the last lines as they are.
    pub(crate) fn finish(&self) {
        self.head.abandon();
        self.stages.iter().for_each(|(_, line)| line.abandon());
    }

    fn line_of(&mut self, stage: Stage) -> &ProgressBar {
        let at = self.stages.partition_point(|(other, _)| *other < stage);
        if self.stages.get(at).is_none_or(|(other, _)| *other != stage) {
            let line = line(None);
            let line = match &self.lines {
                Some(lines) => lines.insert(at + 1, line),
                None => line,
            };
            line.set_style(style());
            self.stages.insert(at, (stage, line));
        }
        &self.stages[at].1
    }
}

fn line(lines: Option<&MultiProgress>) -> ProgressBar {
    let line = ProgressBar::new_spinner().with_style(style());
    match lines {
        Some(lines) => lines.add(line),
        None => line,
    }
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

/// One line about the instance.
#[must_use]
pub fn headline(state: &ScanState, waiting: &[&str]) -> String {
    if !waiting.is_empty() {
        return format!("waiting for {}", waiting.join(", "));
    }
    let scanning = if state.scanning != 0 { "scanning" } else { "stopped" };
    if state.recording != 0 {
        format!("{scanning}, recording to {}", state.recording_file.to_text())
    } else {
        scanning.to_owned()
    }
}

/// One line about a stage: rate, median latency, items put out, drops by reason, incidents, skew, restarts.
#[must_use]
pub fn stage_line(stage: Stage, tally: &StageTally, now_ns: u64) -> String {
    let latency = tally.latencies.brief().map_or_else(String::new, |l| format!("{:8.1} ms", l.p50_ms));
    let silent = if tally.is_silent(now_ns) { "  silent" } else { "" };
    let drops = listed("dropped: ", tally.counts.reasons().map(|(reason, n)| format!("{} {n}", reason.name())));
    let incidents =
        listed("  survived: ", tally.counts.incidents().map(|(incident, n)| format!("{} {n}", incident.name())));
    let skew = tally.skew.mean_ns().map_or_else(String::new, |ns| format!("  skew {:.3} ms", ns * 1e-6));
    let restarts = if tally.restarts > 0 { format!("  restarts {}", tally.restarts) } else { String::new() };
    let (name, rate_hz, passed) = (stage.name(), tally.rate_hz, tally.counts.passed);
    format!("{name:<15}{rate_hz:7.1}/s{latency:>12}  out {passed:<9}{drops}{incidents}{skew}{restarts}{silent}")
}

/// The words after what they are; nothing where there are none.
fn listed(what: &str, words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    if words.is_empty() { String::new() } else { format!("{what}{}", words.join(", ")) }
}

fn brief(stage: Stage, tally: &StageTally, now_ns: u64) -> String {
    let silent = if tally.is_silent(now_ns) { " silent" } else { "" };
    let dropped = tally.counts.all_dropped();
    format!("{} {:.1}/s out {} dropped {dropped}{silent}", stage.name(), tally.rate_hz, tally.counts.passed)
}
