//! The events that the page lists: losses, faults, restarts, quantities of health beyond their limits, recordings,
//! marks.
//!
//! In: counts and states, about once a second. Out: an event for each change.

use std::collections::{BTreeMap, VecDeque};

use serde::Serialize;

use fringeflow_message::{Counts, ScanState, Stage};
use fringeflow_runtime::RecorderStatus;
use fringeflow_telemetry::health::{HealthState, Quantity};
use fringeflow_telemetry::{GaugeFigures, HealthFigures, Tally};

use crate::services::{ServiceState, ServiceStatus};

/// Events that are kept for pages that connect later.
const MAX_EVENTS: usize = 100;

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Level {
    Info,
    Warning,
    Error,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Event {
    /// Counts up from 1.
    pub(crate) id: u64,
    /// Time of the wall clock, Unix milliseconds.
    pub(crate) wall_ms: f64,
    pub(crate) level: Level,
    /// Name of a stage or a service, or `instance`, `health` or `mark`.
    pub(crate) source: &'static str,
    pub(crate) text: String,
}

/// The last events, and the counts and states at the last update.
#[derive(Debug, Default)]
pub(crate) struct EventLog {
    events: VecDeque<Event>,
    last_id: u64,
    counts: BTreeMap<Stage, Counts>,
    state: Option<ScanState>,
    services: BTreeMap<&'static str, (ServiceState, u32)>,
    /// States of health at the last update.
    health: BTreeMap<Quantity, HealthState>,
    /// Number of the last recording that ended early.
    ended_early: u64,
    is_disk_nearly_full: bool,
}

impl EventLog {
    /// Adds events for what has changed since the last update. Called about once a second, so that many losses of one
    /// kind are one event.
    pub(crate) fn update(&mut self, tally: &Tally, state: &ScanState, services: &[ServiceStatus], wall_ms: f64) {
        for (stage, of_stage) in tally.stages() {
            self.update_stage(stage, &of_stage.counts, wall_ms);
        }
        self.update_state(state, wall_ms);
        services.iter().for_each(|service| self.update_service(service, wall_ms));
    }

    /// Adds events for quantities of health whose state has changed.
    pub(crate) fn update_health(&mut self, health: Option<&HealthFigures>, wall_ms: f64) {
        for gauge in health.into_iter().flat_map(|health| &health.quantities) {
            let before = self.health.insert(gauge.quantity, gauge.state).unwrap_or_default();
            let level = match gauge.state {
                HealthState::Bad => Level::Error,
                HealthState::Warn => Level::Warning,
                HealthState::Ok | HealthState::NotKnown => Level::Info,
            };
            if GaugeFigures::is_noteworthy_change(before, gauge.state) {
                self.push(wall_ms, level, "health", gauge.to_string());
            }
        }
    }

    /// Adds events if the recording has ended early, or the disk is nearly full or not any more.
    pub(crate) fn update_recorder(&mut self, state: &ScanState, recorder: Option<&RecorderStatus>, wall_ms: f64) {
        let Some(recorder) = recorder else { return };
        if let Some(why) = recorder.early_end_of(state)
            && std::mem::replace(&mut self.ended_early, state.recordings) != state.recordings
        {
            let text = format!("the recording {} has ended: {why}", state.recording_file.to_text());
            self.push(wall_ms, Level::Error, "recorder", text);
        }
        let warning = recorder.warning();
        let was_nearly_full = std::mem::replace(&mut self.is_disk_nearly_full, warning.is_some());
        match warning {
            Some(warning) if !was_nearly_full => self.push(wall_ms, Level::Warning, "recorder", warning),
            None if was_nearly_full && state.recording != 0 && recorder.early_end.is_none() => {
                self.push(wall_ms, Level::Info, "recorder", "the disk will last for ten minutes again".to_owned());
            }
            _ => {}
        }
    }

    /// Returns the events after the one with this id, oldest first.
    pub(crate) fn after(&self, id: u64) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(move |event| event.id > id)
    }

    /// Id of the last event; 0 if there is none.
    pub(crate) fn last_id(&self) -> u64 {
        self.last_id
    }

    fn update_stage(&mut self, stage: Stage, counts: &Counts, wall_ms: f64) {
        // At the first update of a stage, this reports losses from before the monitor started.
        let before = self.counts.insert(stage, *counts).unwrap_or_default();
        for (reason, count) in counts.losses() {
            let new = count.saturating_sub(before.dropped(reason));
            if new > 0 {
                let text = format!("lost {new} ({}), {count} in total", reason.name());
                self.push(wall_ms, Level::Warning, stage.name(), text);
            }
        }
        for (incident, count) in counts.incidents() {
            let new = count.saturating_sub(before.incidents[incident as usize]);
            if new > 0 {
                let text = format!("survived {} ({new} times, {count} in total)", incident.name());
                self.push(wall_ms, Level::Warning, stage.name(), text);
            }
        }
    }

    fn update_state(&mut self, state: &ScanState, wall_ms: f64) {
        let before = self.state.replace(*state).unwrap_or_default();
        // A recording that ended early has its event.
        let was_recording = before.recording != 0 && before.recordings != self.ended_early;
        let mut push = |source: &'static str, text: String| self.push(wall_ms, Level::Info, source, text);
        if state.scanning != before.scanning {
            push("instance", if state.scanning == 0 { "scanning stopped" } else { "scanning" }.to_owned());
        }
        if was_recording && (state.recording == 0 || state.recordings != before.recordings) {
            push("instance", format!("recording ended: {}", before.recording_file.to_text()));
        }
        if state.recording != 0 && state.recordings != before.recordings {
            push("instance", format!("recording: {}", state.recording_file.to_text()));
        }
        if state.marks != before.marks {
            // The same text as in recordings.
            push("mark", state.mark.to_text());
        }
    }

    fn update_service(&mut self, service: &ServiceStatus, wall_ms: f64) {
        let now = (service.state, service.restarts);
        let before = self.services.insert(service.name, now).unwrap_or((ServiceState::Ok, 0));
        if service.restarts > before.1 {
            let text = format!("restarted ({} in total)", service.restarts);
            self.push(wall_ms, Level::Warning, service.name, text);
        }
        match (before.0, service.state) {
            (before, now) if before == now => {}
            (ServiceState::Silent | ServiceState::Restarting, ServiceState::Ok | ServiceState::Slow) => {
                self.push(wall_ms, Level::Info, service.name, "reports again".to_owned());
            }
            (_, ServiceState::Silent) => self.push(wall_ms, Level::Error, service.name, service.why.clone()),
            (_, ServiceState::Restarting) => self.push(wall_ms, Level::Error, service.name, service.why.clone()),
            // A service at its limit changes between the two all the time. The table of the services shows it.
            (_, ServiceState::Ok | ServiceState::Slow) => {}
        }
    }

    fn push(&mut self, wall_ms: f64, level: Level, source: &'static str, text: String) {
        self.last_id += 1;
        self.events.push_back(Event { id: self.last_id, wall_ms, level, source, text });
        if self.events.len() > MAX_EVENTS {
            self.events.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::{DropReason, GaugeReport, Incident, StageReport, Text, WindowReport};
    use fringeflow_runtime::RecordingRate;

    fn texts(log: &EventLog, after: u64) -> Vec<String> {
        log.after(after).map(|event| format!("{}: {}", event.source, event.text)).collect()
    }

    fn tally(counts: Counts) -> Tally {
        let mut tally = Tally::default();
        tally.add(&StageReport { stage: Stage::Camera2 as u32, counts, ..StageReport::default() });
        tally
    }

    #[test]
    fn each_loss_and_fault_is_one_event_and_decisions_are_none() {
        let (mut log, mut counts) = (EventLog::default(), Counts::default());
        counts.drop_many(DropReason::CameraLost, 3);
        counts.drop_many(DropReason::NextStageBusy, 9);
        counts.note(Incident::TimeOut, 1);
        let state = ScanState::default();
        log.update(&tally(counts), &state, &[], 0.0);
        assert_eq!(
            texts(&log, 0),
            ["camera2: lost 3 (camera_lost), 3 in total", "camera2: survived time_out (1 times, 1 in total)"]
        );
        log.update(&tally(counts), &state, &[], 1.0);
        assert_eq!(log.last_id(), 2);
        counts.drop_one(DropReason::CameraLost);
        log.update(&tally(counts), &state, &[], 2.0);
        assert_eq!(texts(&log, 2), ["camera2: lost 1 (camera_lost), 4 in total"]);
    }

    #[test]
    fn recordings_and_marks_are_events() {
        let mut log = EventLog::default();
        let mut state = ScanState { scanning: 1, recording: 1, recordings: 1, ..ScanState::default() };
        state.recording_file = Text::new("/a.mcap");
        log.update(&Tally::default(), &state, &[], 0.0);
        (state.recordings, state.recording_file) = (2, Text::new("/b.mcap"));
        (state.marks, state.mark) = (1, Text::new("<ear>"));
        log.update(&Tally::default(), &state, &[], 0.0);
        assert_eq!(
            texts(&log, 0),
            [
                "instance: scanning",
                "instance: recording: /a.mcap",
                "instance: recording ended: /a.mcap",
                "instance: recording: /b.mcap",
                "mark: <ear>"
            ]
        );
    }

    #[test]
    fn an_early_end_and_a_nearly_full_disk_are_one_event_each() {
        let mut log = EventLog::default();
        let mut state = ScanState { scanning: 1, recording: 1, recordings: 1, ..ScanState::default() };
        state.recording_file = Text::new("/a.mcap");
        let rate = RecordingRate::Measured(50.0);
        let mut recorder =
            RecorderStatus { recordings: 1, early_end: None, rate, room_mb: Some(20_000.0), is_nearly_full: true };
        let mut update = |state: &ScanState, recorder: &RecorderStatus| {
            let before = log.last_id();
            log.update(&Tally::default(), state, &[], 0.0);
            log.update_recorder(state, Some(recorder), 0.0);
            texts(&log, before)
        };
        let begun = update(&state, &recorder);
        assert!(begun.len() == 3 && begun[2].starts_with("recorder: the disk will be full in 6 min"), "{begun:?}");
        assert_eq!(update(&state, &recorder), Vec::<String>::new());
        recorder.is_nearly_full = false;
        assert_eq!(update(&state, &recorder), ["recorder: the disk will last for ten minutes again"]);
        recorder.early_end = Some("disk full".to_owned());
        assert_eq!(update(&state, &recorder), ["recorder: the recording /a.mcap has ended: disk full"]);
        state.recording = 0;
        assert_eq!(update(&state, &recorder), Vec::<String>::new());
    }

    #[test]
    fn a_service_that_falls_silent_and_returns_is_an_event() {
        let mut log = EventLog::default();
        let mut update = |state, restarts| {
            let why = "no report for 3 s".to_owned();
            let service = ServiceStatus { state, why, restarts, ..ServiceStatus::new("phase", &[]) };
            let before = log.last_id();
            log.update(&Tally::default(), &ScanState::default(), &[service], 0.0);
            texts(&log, before)
        };
        assert_eq!(update(ServiceState::Ok, 0), Vec::<String>::new());
        assert_eq!(update(ServiceState::Slow, 0), Vec::<String>::new());
        assert_eq!(update(ServiceState::Silent, 0), ["phase: no report for 3 s"]);
        assert_eq!(update(ServiceState::Ok, 1), ["phase: restarted (1 in total)", "phase: reports again"]);
    }

    #[test]
    fn a_quantity_of_health_beyond_its_limits_is_an_event_when_its_state_changes() {
        let mut log = EventLog::default();
        let course = [(0.0, HealthState::NotKnown), (0.04, HealthState::Ok), (0.13, HealthState::Warn)];
        let back = [(0.14, HealthState::Warn), (0.3, HealthState::Bad), (0.07, HealthState::Ok)];
        for (level, state) in course.into_iter().chain(back) {
            let mut report = WindowReport::default();
            report.health.gauges[Quantity::Drift as usize] =
                GaugeReport { level, warn: 0.1, bad: 0.2, since_ns: 1, state: state as u32, is_known: 1 };
            log.update_health(HealthFigures::from_report(&report).as_ref(), 0.0);
            log.update_health(None, 0.0);
        }
        let levels: Vec<Level> = log.after(0).map(|event| event.level).collect();
        assert_eq!(levels, [Level::Warning, Level::Error, Level::Info]);
        let [warned, bad, ended] = &texts(&log, 0)[..] else { panic!("three events") };
        assert!(warned.contains("health: drift of the calibration: warn, 0.130 rad"), "{warned}");
        assert!(bad.contains("0.300 rad, limit 0.200 rad") && bad.contains("calibrate again"), "{bad}");
        assert!(ended.contains("is ok: 0.070 rad, within 0.100"), "{ended}");
    }

    #[test]
    fn only_the_last_events_are_kept() {
        let (mut log, mut counts) = (EventLog::default(), Counts::default());
        for _ in 0..250 {
            counts.drop_one(DropReason::Overrun);
            log.update(&tally(counts), &ScanState::default(), &[], 0.0);
        }
        assert_eq!((log.after(0).count(), log.last_id()), (MAX_EVENTS, 250));
        assert_eq!(log.after(249).count(), 1);
    }
}
