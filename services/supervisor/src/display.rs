//! Shows a running instance to the operator: one line per stage in a terminal, else a log line every ten seconds.

use std::io::{IsTerminal, Write, stderr};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use fringeflow_message::{DropReason, ScanState, Stage};
use fringeflow_runtime::log::{self, Redirection};
use fringeflow_runtime::{Preparation, RecorderStatus};
use fringeflow_telemetry::{StageTally, Tally};
use fringeflow_transport::Instance;

/// Time between two log lines, nanoseconds.
const LOG_INTERVAL_NS: u64 = 10_000_000_000;

/// Shows the state of the stages.
#[derive(Debug)]
pub(crate) struct Display {
    /// Lines in the terminal; `None` if standard error is not a terminal.
    lines: Option<MultiProgress>,
    headline: ProgressBar,
    /// One line per stage, in pipeline order.
    stages: Vec<(Stage, ProgressBar)>,
    logged_ns: u64,
    /// Whether the images are exposed live. Latencies since the exposure mean nothing in a replay.
    is_live: bool,
    /// Whether no camera takes the images.
    has_virtual_images: bool,
    /// Keeps log lines above the lines in the terminal.
    _diversion: Option<Redirection>,
}

impl Display {
    pub(crate) fn new(is_live: bool, has_virtual_images: bool) -> Self {
        let lines = stderr().is_terminal().then(MultiProgress::new);
        let headline = new_line(lines.as_ref());
        let diversion = lines.as_ref().map(|lines| {
            let lines = lines.clone();
            log::redirect(move |line| lines.suspend(|| stderr().write_all(line)))
        });
        Self { lines, headline, stages: Vec::new(), logged_ns: 0, is_live, has_virtual_images, _diversion: diversion }
    }

    /// Returns whether the lines are drawn in a terminal.
    pub(crate) fn is_terminal(&self) -> bool {
        self.lines.is_some()
    }

    /// Updates the lines, or logs a line if it is time. `recorder` says what the recorder does, and `waiting` what the
    /// scan waits for.
    pub(crate) fn show(
        &mut self,
        tally: &Tally,
        state: &ScanState,
        recorder: Option<&RecorderStatus>,
        waiting: Option<&str>,
        now_ns: u64,
    ) {
        if self.lines.is_some() {
            self.headline.set_message(headline(state, recorder, waiting, self.has_virtual_images));
            for (stage, stage_tally) in tally.stages() {
                self.line_for(stage).set_message(stage_line(stage, stage_tally, now_ns));
            }
        } else if now_ns.saturating_sub(self.logged_ns) >= LOG_INTERVAL_NS {
            self.logged_ns = now_ns;
            let scan_line = || log_line(tally, state, recorder, [self.is_live, self.has_virtual_images], now_ns);
            tracing::info!("{}", waiting.map_or_else(scan_line, str::to_owned));
        }
    }

    /// Leaves the last lines on the terminal.
    pub(crate) fn finish(&self) {
        self.headline.abandon();
        self.stages.iter().for_each(|(_, line)| line.abandon());
    }

    /// Returns the line of a stage. Adds it when the stage first reports.
    fn line_for(&mut self, stage: Stage) -> &ProgressBar {
        let index = self.stages.partition_point(|(other, _)| *other < stage);
        if self.stages.get(index).is_none_or(|(other, _)| *other != stage) {
            let line = new_line(None);
            let line = match &self.lines {
                // The headline is line 0.
                Some(lines) => lines.insert(index + 1, line),
                None => line,
            };
            line.set_style(style());
            self.stages.insert(index, (stage, line));
        }
        &self.stages[index].1
    }
}

fn new_line(lines: Option<&MultiProgress>) -> ProgressBar {
    let line = ProgressBar::new_spinner().with_style(style());
    match lines {
        Some(lines) => lines.add(line),
        None => line,
    }
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

/// Returns one line about the instance: what it waits for, or whether it scans, which images, and records. `recorder`
/// says whether the recording has ended early, or the disk is nearly full.
#[must_use]
pub fn headline(
    state: &ScanState,
    recorder: Option<&RecorderStatus>,
    waiting: Option<&str>,
    has_virtual_images: bool,
) -> String {
    let doing = waiting.map_or_else(|| scanning(state, has_virtual_images), str::to_owned);
    let file = state.recording_file.to_text();
    if let Some(why) = recorder.and_then(|recorder| recorder.early_end_of(state)) {
        return format!("{doing}; the recording {file} has ended: {why}");
    }
    let full_in = recorder.and_then(RecorderStatus::full_in);
    let warning = full_in.map_or_else(String::new, |time| format!("; the disk will be full in {time}"));
    if state.recording != 0 { format!("{doing}, recording to {file}{warning}") } else { doing }
}

/// Returns what an instance that has not scanned yet waits for: a preparation, or the start of its services. Works from
/// any process.
#[must_use]
pub fn read_startup_status(instance: &Instance, state: &ScanState) -> Option<String> {
    let preparation = Preparation::read(instance).map(|preparation| preparation.to_string());
    preparation.or_else(|| (state.revision == 0).then(|| "starting".to_owned()))
}

fn scanning(state: &ScanState, has_virtual_images: bool) -> String {
    let images = if has_virtual_images { " (virtual images)" } else { "" };
    format!("{}{images}", if state.scanning != 0 { "scanning" } else { "stopped" })
}

/// Returns one line for the log: clouds per second, latency, drops by reason, silent stages.
fn log_line(
    tally: &Tally,
    state: &ScanState,
    recorder: Option<&RecorderStatus>,
    [is_live, has_virtual_images]: [bool; 2],
    now_ns: u64,
) -> String {
    let recording = match recorder.and_then(|recorder| recorder.early_end_of(state)) {
        Some(why) => format!(", the recording has ended ({why})"),
        None if state.recording != 0 => ", recording".to_owned(),
        None => String::new(),
    };
    let clouds_hz = tally.stage(Stage::Cloud).map_or(0.0, |cloud| cloud.rate_hz);
    let latency = tally.total().brief().filter(|_| is_live);
    let latency = latency.map_or_else(String::new, |l| format!(", latency p50 {:.0} ms", l.p50_ms));
    let dropped = join(", dropped: ", drops(tally).map(|(reason, count)| format!("{} {count}", reason.name())));
    let silent = tally.stages().filter(|(_, stage_tally)| stage_tally.is_silent(now_ns));
    let silent = join(", silent: ", silent.map(|(stage, _)| stage.name().to_owned()));
    format!("{}{recording}: {clouds_hz:.1} clouds/s{latency}{dropped}{silent}", scanning(state, has_virtual_images))
}

/// Returns how many items all stages dropped, by reason. Leaves out drops that the configuration asks for.
fn drops(tally: &Tally) -> impl Iterator<Item = (DropReason, u64)> + '_ {
    const PLANNED: [DropReason; 4] =
        [DropReason::BetweenWindows, DropReason::Beginning, DropReason::NotRecording, DropReason::Thinned];
    let reasons = DropReason::ALL.into_iter().filter(|reason| !PLANNED.contains(reason));
    let count = |reason| tally.stages().map(|(_, stage_tally)| stage_tally.counts.dropped(reason)).sum();
    reasons.map(move |reason| (reason, count(reason))).filter(|&(_, count)| count > 0)
}

/// Returns one line about a stage: rate, median latency, items passed on, drops by reason, incidents, skew, restarts.
#[must_use]
pub fn stage_line(stage: Stage, tally: &StageTally, now_ns: u64) -> String {
    let latency = tally.latencies.brief().map_or_else(String::new, |l| format!("{:8.1} ms", l.p50_ms));
    let silent = if tally.is_silent(now_ns) { "  silent" } else { "" };
    let drops = join("dropped: ", tally.counts.reasons().map(|(reason, n)| format!("{} {n}", reason.name())));
    let incidents =
        join("  survived: ", tally.counts.incidents().map(|(incident, n)| format!("{} {n}", incident.name())));
    let skew = tally.skew.mean_ns().map_or_else(String::new, |ns| format!("  skew {:.3} ms", ns * 1e-6));
    let restarts = if tally.restarts > 0 { format!("  restarts {}", tally.restarts) } else { String::new() };
    let (name, rate_hz, passed) = (stage.name(), tally.rate_hz, tally.counts.passed);
    format!("{name:<15}{rate_hz:7.1}/s{latency:>12}  out {passed:<9}{drops}{incidents}{skew}{restarts}{silent}")
}

/// Returns `label` and the words, separated by commas. Returns an empty string if there are no words.
fn join(label: &str, words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    if words.is_empty() { String::new() } else { format!("{label}{}", words.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::{StageReport, Text};
    use fringeflow_runtime::RecordingRate;

    #[test]
    fn a_recording_that_ended_early_is_not_called_running() {
        let recording_file = Text::new("/a.mcap");
        let state = ScanState { scanning: 1, recording: 1, recordings: 1, recording_file, ..ScanState::default() };
        let rate = RecordingRate::Measured(50.0);
        let running =
            RecorderStatus { recordings: 1, early_end: None, rate, room_mb: Some(20_000.0), is_nearly_full: false };
        assert_eq!(headline(&state, Some(&running), None, false), "scanning, recording to /a.mcap");
        let filling = RecorderStatus { is_nearly_full: true, ..running.clone() };
        let line = headline(&state, Some(&filling), None, false);
        assert_eq!(line, "scanning, recording to /a.mcap; the disk will be full in 6 min");
        let ended = RecorderStatus { early_end: Some("disk full".to_owned()), ..running };
        assert_eq!(headline(&state, Some(&ended), None, false), "scanning; the recording /a.mcap has ended: disk full");
        let line = log_line(&Tally::default(), &state, Some(&ended), [true, false], 0);
        assert_eq!(line, "scanning, the recording has ended (disk full): 0.0 clouds/s");
        let stopped = ScanState { scanning: 0, recording: 0, ..state };
        assert_eq!(headline(&stopped, Some(&ended), None, false), "stopped");
    }

    #[test]
    fn the_log_line_shows_losses_and_silent_stages_but_no_zeros() {
        let (mut tally, state) = (Tally::default(), ScanState { scanning: 1, ..ScanState::default() });
        assert_eq!(log_line(&tally, &state, None, [true; 2], 0), "scanning (virtual images): 0.0 clouds/s");
        let ms = 1_000_000;
        for stage in [Stage::Camera1, Stage::Camera2, Stage::Cloud] {
            let mut report =
                StageReport { stage: stage as u32, of_item: 1, passed_ns: 40 * ms, ..StageReport::default() };
            report.counts.drop_many(DropReason::Overrun, 2);
            report.counts.drop_many(DropReason::BetweenWindows, 9);
            tally.add(&report);
        }
        assert!(!log_line(&tally, &state, None, [false; 2], 0).contains("latency"));
        let line = log_line(&tally, &state, None, [true, false], 10_000 * ms);
        assert_eq!(
            line,
            "scanning: 0.0 clouds/s, latency p50 40 ms, dropped: overrun 6, silent: camera1, camera2, cloud"
        );
    }
}
