//! The monitor service: metrics for Prometheus, the dashboard, and the live view for Foxglove.
//!
//! In: reports, always, since they are small; images, phase maps, clouds and models only while a client wants them.
//! Out: HTTP and WebSocket servers.
//!
//! The monitor must not slow down the scan: it has the lowest priority, no service waits for it, and a client that
//! stops reading gets no more messages.

mod check;
mod events;
mod exposition;
mod free_space;
mod http;
mod instance_status;
mod lazy_subscribers;
mod metrics;
mod newest_messages;
mod process;
mod services;
mod shared;
mod view_messages;
mod view_updater;
mod viewers;

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use fringeflow_message::{PoseReport, ScanState, Stage, StageReport, WindowReport};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{Host, MAX_WAIT, Preparation, RecorderStatus, ServiceArgs, ServiceError, clock, receive};
use fringeflow_transport::{
    REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, Subscriber, TRACKING_POSE, TransportError, wait_for,
};

pub use check::check;

use events::Level;
use http::{Guard, Server};
use instance_status::InstanceStatus;
use lazy_subscribers::LazySubscribers;
use newest_messages::{NewestMessages, WantedChannels};
use shared::Shared;
use view_updater::ViewUpdater;
use viewers::Viewers;

/// Nice value of the process: the lowest priority.
const NICENESS: i32 = 19;
/// Pause between two reads of the report channels. Reports accumulate meanwhile, and one read takes them all.
const POLL_PAUSE: Duration = Duration::from_millis(40);
/// Time between two reads of images, phase maps, clouds and models, nanoseconds.
const VIEW_PERIOD_NS: u64 = 200_000_000;
/// Time between two messages of figures to the page, nanoseconds.
const FIGURES_PERIOD_NS: u64 = 1_000_000_000;

/// Runs the service until it is asked to stop.
///
/// # Errors
/// The instance or a channel cannot be opened, the token cannot be used, or the server cannot start.
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    // If this fails, the monitor only competes more with the other services.
    let _ = rustix::process::nice(NICENESS);
    let mut host = Host::open(arguments, "monitor")?;
    let mut channels = Channels::open(&host)?;
    let status = InstanceStatus::new(&host.configuration, &host.setup, clock::now_ns());
    let shared = Arc::new(Shared::new(host.node.instance().clone(), status));
    let monitor = &host.configuration.monitor;
    let guard = Guard::new(monitor).map_err(|problem| ServiceError::Unusable(problem.to_string()))?;
    let mut viewers = Viewers::new()
        .map_err(|error| ServiceError::Unusable(format!("the topics for viewers cannot be created: {error}")))?;
    let server = Server::start(&shared, monitor, guard, viewers.context()).map_err(ServiceError::Unusable)?;
    let mut subscribers = LazySubscribers::new();
    let mut view_updater = ViewUpdater::default();
    let (mut figures_ns, mut views_ns, mut last_event_id) = (clock::now_ns(), 0, 0);
    while !host.stop.is_requested() {
        channels.drain(&shared, &mut viewers);
        let (now_ns, wall_ms) = (clock::now_ns(), wall_ms());
        if now_ns.saturating_sub(figures_ns) >= FIGURES_PERIOD_NS {
            figures_ns = now_ns;
            let clients = shared.clients.load(std::sync::atomic::Ordering::Relaxed);
            let preparation = Preparation::read(&shared.instance);
            let recorder = RecorderStatus::read(&shared.instance);
            let figures = shared.status().end_second(preparation, recorder, now_ns, wall_ms, clients);
            shared.figures.send_replace(figures.into());
            send_new_events(&shared, &mut viewers, &mut last_event_id, now_ns);
            viewers.send_static(&host.setup, now_ns);
            subscribers.maintain(now_ns);
        }
        if now_ns.saturating_sub(views_ns) >= VIEW_PERIOD_NS {
            views_ns = now_ns;
            let wanted = view_updater.wanted(&shared, now_ns).union(WantedChannels::from_viewers(&viewers));
            let newest = NewestMessages::read(wanted, &mut subscribers, &host, now_ns);
            view_updater.update(&shared, &newest, host.setup.image_size_px, now_ns, wall_ms);
            newest.send_to(&mut viewers);
        }
        host.check_connections(|host, now_ns| channels.ensure_connected(host, now_ns));
        std::thread::sleep(POLL_PAUSE);
        channels.wait()?;
    }
    server.stop();
    Ok(())
}

/// Sends the viewers the events after `last_event_id`, and updates it.
fn send_new_events(shared: &Shared, viewers: &mut Viewers, last_event_id: &mut u64, now_ns: u64) {
    let status = shared.status();
    for event in status.events.after(*last_event_id) {
        let is_warning = event.level != Level::Info;
        viewers.send(&Recordable::Event { time_ns: now_ns, is_warning, source: event.source, text: &event.text });
    }
    *last_event_id = status.events.last_id();
}

/// Time of the wall clock, Unix milliseconds.
fn wall_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64() * 1e3)
}

/// The channels that the monitor always reads.
struct Channels {
    reports: Subscriber<(), StageReport>,
    windows: Subscriber<(), WindowReport>,
    /// Number of the next window report.
    next_window: u64,
    poses: Subscriber<(), PoseReport>,
    states: Subscriber<(), ScanState>,
}

impl Channels {
    fn open(host: &Host) -> Result<Self, TransportError> {
        Ok(Self {
            reports: Subscriber::open(&host.node, REPORT_STAGE, &host.sizes)?,
            windows: Subscriber::open(&host.node, REPORT_WINDOW, &host.sizes)?,
            next_window: 0,
            poses: Subscriber::open(&host.node, TRACKING_POSE, &host.sizes)?,
            states: Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?,
        })
    }

    /// Reads all waiting messages into the status, and sends them to the viewers.
    fn drain(&mut self, shared: &Shared, viewers: &mut Viewers) {
        let mut status = shared.status();
        while let Some(report) = receive(&mut self.reports) {
            status.add_report(report.payload());
            viewers.send(&Recordable::Report(report.payload()));
        }
        while let Some(report) = receive(&mut self.windows) {
            status.add_window(report.payload());
            self.next_window = report.published + 1;
            viewers.send(&Recordable::WindowReport(report.payload()));
        }
        while let Some(report) = receive(&mut self.poses) {
            status.add_pose(report.payload());
            viewers.send(&Recordable::Pose(report.payload()));
            viewers.send(&Recordable::PoseTransform(report.payload()));
        }
        while let Some(state) = receive(&mut self.states) {
            status.state = *state;
        }
    }

    fn wait(&self) -> Result<(), TransportError> {
        wait_for(&[&self.reports, &self.windows, &self.poses, &self.states], MAX_WAIT)
    }

    fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        self.reports.ensure_connected(now_ns)?;
        host.ensure_connected(&mut self.windows, Stage::Correspondence, self.next_window, now_ns)?;
        // When reopened, these two deliver their last message again.
        self.poses.ensure_connected(now_ns)?;
        self.states.ensure_connected(now_ns).map(|_| ())
    }
}
