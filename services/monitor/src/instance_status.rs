//! The status of an instance as the monitor knows it, and the JSON messages to the page.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use fringeflow_config::{CameraSource, ScannerConfiguration};
use fringeflow_dataset::Setup;
use fringeflow_message::{PoseReport, ScanState, Skew, Stage, StageReport, WindowReport};
use fringeflow_runtime::{Preparation, RecorderStatus, live_services, sources};
use fringeflow_telemetry::{
    Capacity, DropLine, Interval, Sample, Segment, SkewFigures, StageFigures, Tally, TrackingFigures, TrackingWatch,
    Verdict, WindowFigures,
};

use crate::events::EventLog;
use crate::free_space::FreeSpace;
use crate::services::{ServiceStatus, Services};

/// Points of the timelines, one per second, that a new page receives.
const MAX_HISTORY: usize = 600;

/// The status of an instance as the monitor knows it.
#[derive(Debug)]
pub(crate) struct InstanceStatus {
    instance: String,
    image_size_px: [usize; 2],
    steps: usize,
    rate_hz: f64,
    /// Folder of the recordings.
    recordings: PathBuf,
    /// URL that viewers connect to.
    pub(crate) foxglove: Option<String>,
    pub(crate) tally: Tally,
    pub(crate) window: Option<WindowFigures>,
    has_virtual_images: bool,
    /// Whether tracking is enabled.
    is_tracked: bool,
    tracking_watch: TrackingWatch,
    /// Figures of the tracking at the end of the last second.
    pub(crate) tracking: Option<TrackingFigures>,
    pub(crate) state: ScanState,
    /// Progress of a service that prepares before the scan can begin.
    pub(crate) preparation: Option<Preparation>,
    pub(crate) recorder: Option<RecorderStatus>,
    /// Skew since the end of the last second.
    current_skew: Skew,
    /// Skew in the last second.
    pub(crate) skew: Skew,
    pub(crate) free_space: FreeSpace,
    interval: Interval,
    history: VecDeque<Sample>,
    services: Services,
    pub(crate) service_statuses: Vec<ServiceStatus>,
    pub(crate) events: EventLog,
}

/// Figures of a stage for the page.
#[derive(Serialize)]
struct StageEntry {
    #[serde(flatten)]
    figures: StageFigures,
    rate_hz: f64,
    in_work: u64,
    waiting: u64,
}

impl InstanceStatus {
    pub(crate) fn new(configuration: &ScannerConfiguration, setup: &Setup, now_ns: u64) -> Self {
        let services: Vec<_> =
            live_services(configuration).into_iter().map(|kind| (kind.name(), kind.stages())).collect();
        let services = Services::new(&services);
        Self {
            instance: configuration.name.clone(),
            image_size_px: setup.image_size_px,
            steps: setup.steps,
            rate_hz: configuration.rate_hz,
            recordings: configuration.recorder.folder.clone(),
            foxglove: None,
            tally: Tally::default(),
            window: None,
            has_virtual_images: configuration.cameras == CameraSource::Virtual,
            is_tracked: configuration.measurement.tracking.is_enabled,
            tracking_watch: TrackingWatch::default(),
            tracking: None,
            state: ScanState::default(),
            preparation: None,
            recorder: None,
            current_skew: Skew::default(),
            skew: Skew::default(),
            free_space: FreeSpace::measure(&configuration.recorder.folder),
            interval: Interval::new(now_ns, None),
            history: VecDeque::new(),
            service_statuses: services.statuses(),
            services,
            events: EventLog::default(),
        }
    }

    pub(crate) fn add_report(&mut self, report: &StageReport) {
        let journey = self.tally.add(report);
        self.interval.add(report, journey.as_ref());
        self.current_skew.join(&report.skew);
    }

    pub(crate) fn add_window(&mut self, report: &WindowReport) {
        self.interval.add_window(report);
        self.window = Some(WindowFigures::from_report(report));
    }

    pub(crate) fn add_pose(&mut self, report: &PoseReport) {
        self.tracking_watch.add(report);
    }

    /// Ends a second: updates services and events, adds a point to the timelines, and returns the message of figures
    /// for the page.
    pub(crate) fn end_second(
        &mut self,
        preparation: Option<Preparation>,
        recorder: Option<RecorderStatus>,
        now_ns: u64,
        wall_ms: f64,
        clients: usize,
    ) -> String {
        self.preparation = preparation;
        self.recorder = recorder;
        self.services.update(&self.tally, now_ns);
        self.service_statuses = self.services.statuses();
        self.events.update(&self.tally, &self.state, &self.service_statuses, wall_ms);
        self.events.update_recorder(&self.state, self.recorder.as_ref(), wall_ms);
        self.events.update_health(self.window.as_ref().and_then(|window| window.health.as_ref()), wall_ms);
        let counts = self.tally.stage(Stage::Tracking).map(|of_stage| of_stage.counts).unwrap_or_default();
        self.tracking = self.tracking_watch.figures(&counts, now_ns);
        self.free_space = FreeSpace::measure(&self.recordings_folder());
        self.skew = std::mem::take(&mut self.current_skew);
        let sample = self.interval.sample(now_ns, wall_ms);
        self.interval = Interval::new(now_ns, Some(&self.interval));
        let figures = self.figures(&sample, clients, now_ns).to_string();
        self.history.push_back(sample);
        if self.history.len() > MAX_HISTORY {
            self.history.pop_front();
        }
        figures
    }

    /// Returns the first message to a page.
    pub(crate) fn hello_message(&self) -> String {
        let hello = json!({
            "type": "hello",
            "instance": self.instance,
            "version": env!("CARGO_PKG_VERSION"),
            "image_size_px": self.image_size_px,
            "steps": self.steps,
            "rate_hz": self.rate_hz,
            "stages": Stage::ALL.map(Stage::name),
            "segments": Segment::ALL.map(Segment::name),
            "foxglove": self.foxglove,
            "virtual_images": self.has_virtual_images,
            "tracked": self.is_tracked,
            "history": self.history,
            "events": self.events.after(0).collect::<Vec<_>>(),
        });
        hello.to_string()
    }

    /// Returns a message with the events after the one with this id; `None` if there are none.
    pub(crate) fn events_message(&self, id: u64) -> Option<String> {
        let events: Vec<_> = self.events.after(id).collect();
        (!events.is_empty()).then(|| json!({"type": "events", "events": events}).to_string())
    }

    /// Returns the folder of the running recording, else that of recordings without a path.
    fn recordings_folder(&self) -> PathBuf {
        let file = PathBuf::from(self.state.recording_file.to_text());
        let folder = file.parent().filter(|_| self.state.recording != 0);
        folder.map_or_else(|| self.recordings.clone(), Path::to_owned)
    }

    /// Whether a recording runs: one was asked for, and it has not ended early.
    pub(crate) fn is_recording(&self) -> bool {
        let early_end = self.recorder.as_ref().and_then(|recorder| recorder.early_end_of(&self.state));
        self.state.recording != 0 && early_end.is_none()
    }

    /// Items that a stage has taken and not finished.
    pub(crate) fn in_work(&self, stage: Stage) -> u64 {
        self.tally.stage(stage).and_then(|of_stage| of_stage.counts.in_work()).unwrap_or(0)
    }

    /// Items that the previous stages have put out and this stage has not taken, by the last reports of all.
    pub(crate) fn waiting(&self, stage: Stage) -> u64 {
        let Some(of_stage) = self.tally.stage(stage) else { return 0 };
        // One item of a stage may consist of several items of its source, such as a pair of two images.
        let put_out = sources(stage)
            .iter()
            .map(|source| self.tally.stage(source.from).map_or(0, |before| before.counts.passed / source.items));
        put_out.sum::<u64>().saturating_sub(of_stage.counts.taken)
    }

    fn figures(&self, sample: &Sample, clients: usize, now_ns: u64) -> Value {
        let counts: Vec<_> = self.tally.stages().map(|(stage, of_stage)| (stage, of_stage.counts)).collect();
        json!({
            "type": "figures",
            "wall_ms": sample.wall_ms,
            "sample": sample,
            "state": state_entry(&self.state, self.recorder.as_ref()),
            "preparation": self.preparation.as_ref().map(ToString::to_string),
            "services": self.service_statuses,
            "stages": self.tally.stages().map(|(stage, _)| self.stage_entry(stage)).collect::<Vec<_>>(),
            "exposure_to_cloud": self.tally.total().brief(),
            "drops": DropLine::from_counts(&counts),
            "losses": Verdict::from_counts(&counts).to_string(),
            "capacity": Capacity::from_tally(&self.tally).map(|capacity| capacity.to_string()),
            "skew": SkewFigures::from_skew(&self.skew),
            "window": self.window,
            "health_for_s": self.health_for_s(now_ns),
            "tracking": self.tracking,
            "room": self.free_space,
            "recorder": self.recorder.as_ref().map(recorder_entry),
            "clients": clients,
        })
    }

    /// Returns the time that each quantity of health has been in its state, seconds, by name. Unknown quantities are
    /// left out.
    fn health_for_s(&self, now_ns: u64) -> BTreeMap<&'static str, f64> {
        let health = self.window.as_ref().and_then(|window| window.health.as_ref());
        let quantities = health.into_iter().flat_map(|health| &health.quantities);
        quantities.filter_map(|gauge| Some((gauge.quantity.name(), gauge.seconds_in_state(now_ns)?))).collect()
    }

    fn stage_entry(&self, stage: Stage) -> Option<StageEntry> {
        let of_stage = self.tally.stage(stage)?;
        Some(StageEntry {
            figures: StageFigures::new(stage, &of_stage.counts, Some(of_stage)),
            rate_hz: of_stage.rate_hz,
            in_work: self.in_work(stage),
            waiting: self.waiting(stage),
        })
    }
}

/// Returns the state of the scan as JSON for the page.
pub(crate) fn state_entry(state: &ScanState, recorder: Option<&RecorderStatus>) -> Value {
    json!({
        "scanning": state.scanning != 0,
        "recording": (state.recording != 0).then(|| state.recording_file.to_text()),
        "recording_ended": recorder.and_then(|recorder| recorder.early_end_of(state)),
        "recordings": state.recordings,
        "marks": state.marks,
    })
}

/// Returns how much a recording takes and how long the disk lasts, as JSON for the page.
fn recorder_entry(recorder: &RecorderStatus) -> Value {
    json!({
        "text": recorder.to_string(),
        "is_short": recorder.is_short(),
        "full_in": recorder.full_in(),
    })
}
