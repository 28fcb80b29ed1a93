//! The monitor service: metrics for Prometheus, the dashboard, the live view of Foxglove.
//!
//! It listens to reports, which are small, and looks into images, maps and clouds only while somebody watches. It gives way to
//! all others: its priority is the lowest, nobody waits for it, and a client that does not read is served no further.

mod board;
mod check;
mod events;
mod exposition;
mod http;
mod metrics;
mod news;
mod process;
mod room;
mod services;
mod shared;
mod taps;
mod viewers;
mod viewing;
mod views;

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use fringeflow_message::{PoseReport, ScanState, Stage, StageReport, WindowReport};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{BEAT, Host, Preparation, ServiceArgs, ServiceError, clock, receive};
use fringeflow_transport::{
    REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, Subscriber, TRACKING_POSE, TransportError, wait_for,
};

pub use check::check;

use board::Board;
use events::Level;
use http::{Guard, Server};
use news::{News, Wanted};
use shared::Shared;
use taps::Taps;
use viewers::Viewers;
use viewing::Viewing;

/// How much the monitor gives way to the others: as much as there is.
const NICENESS: i32 = 19;
/// Rest between two looks at the channels: reports wait meanwhile, and many are taken at once.
const REST: Duration = Duration::from_millis(40);
/// Time between two looks at images, maps and clouds, nanoseconds.
const LOOK_NS: u64 = 200_000_000;
/// Time between two messages to the page, nanoseconds.
const SECOND_NS: u64 = 1_000_000_000;

/// Runs the service until it is to end.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    // Without it, it is only less polite.
    let _ = rustix::process::nice(NICENESS);
    let mut host = Host::open(arguments, "monitor")?;
    let mut channels = Channels::open(&host)?;
    let board = Board::new(&host.configuration, &host.setup, clock::now_ns());
    let shared = Arc::new(Shared::new(host.node.instance().clone(), board));
    let monitor = &host.configuration.monitor;
    let guard = Guard::new(monitor).map_err(|problem| ServiceError::Unusable(problem.to_string()))?;
    let mut viewers = Viewers::new().map_err(|error| ServiceError::Unusable(format!("viewers: {error}")))?;
    let server = Server::start(&shared, monitor, guard, viewers.context()).map_err(ServiceError::Unusable)?;
    let mut taps = Taps::new();
    let mut viewing = Viewing::default();
    let (mut turned_ns, mut looked_ns, mut told) = (clock::now_ns(), 0, 0);
    while !host.stop.is_requested() {
        channels.drain(&shared, &mut viewers);
        let (now_ns, wall_ms) = (clock::now_ns(), wall_ms());
        if now_ns.saturating_sub(turned_ns) >= SECOND_NS {
            turned_ns = now_ns;
            let clients = shared.clients.load(std::sync::atomic::Ordering::Relaxed);
            let preparation = Preparation::read(&shared.instance);
            let figures = shared.board().turn(preparation, now_ns, wall_ms, clients);
            shared.figures.send_replace(figures.into());
            tell(&shared, &mut viewers, &mut told, now_ns);
            viewers.send_standing(&host.setup, now_ns);
            taps.tend(now_ns);
        }
        if now_ns.saturating_sub(looked_ns) >= LOOK_NS {
            looked_ns = now_ns;
            let wanted = viewing.wanted(&shared, now_ns).or(Wanted::by_viewers(&viewers));
            let news = News::gather(wanted, &mut taps, &host, now_ns);
            viewing.turn(&shared, &news, host.setup.image_size_px, now_ns, wall_ms);
            news.send(&mut viewers);
        }
        host.tend(|host, now_ns| channels.ensure_connected(host, now_ns));
        std::thread::sleep(REST);
        channels.wait()?;
    }
    server.stop();
    Ok(())
}

/// Sends the events to the viewers that were not sent yet.
fn tell(shared: &Shared, viewers: &mut Viewers, told: &mut u64, now_ns: u64) {
    let board = shared.board();
    for event in board.events.after(*told) {
        let is_warning = event.level != Level::Info;
        viewers.send(&Recordable::Event { time_ns: now_ns, is_warning, source: event.source, text: &event.text });
    }
    *told = board.events.last_id();
}

/// Now on the wall clock, Unix milliseconds.
fn wall_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64() * 1e3)
}

/// The channels that are always listened to.
struct Channels {
    reports: Subscriber<(), StageReport>,
    windows: Subscriber<(), WindowReport>,
    /// Number of the report of a window that comes next.
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

    fn drain(&mut self, shared: &Shared, viewers: &mut Viewers) {
        let mut board = shared.board();
        while let Some(report) = receive(&mut self.reports) {
            board.take_report(report.payload());
            viewers.send(&Recordable::Report(report.payload()));
        }
        while let Some(report) = receive(&mut self.windows) {
            board.take_window(report.payload());
            self.next_window = report.published + 1;
            viewers.send(&Recordable::WindowReport(report.payload()));
        }
        while let Some(report) = receive(&mut self.poses) {
            board.take_pose(report.payload());
            viewers.send(&Recordable::Pose(report.payload()));
            viewers.send(&Recordable::PoseTransform(report.payload()));
        }
        while let Some(state) = receive(&mut self.states) {
            board.state = *state;
        }
    }

    fn wait(&self) -> Result<(), TransportError> {
        wait_for(&[&self.reports, &self.windows, &self.poses, &self.states], BEAT)
    }

    fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        self.reports.ensure_connected(now_ns)?;
        host.ensure_connected(&mut self.windows, Stage::Correspondence, self.next_window, now_ns)?;
        // Its last message is told again to whoever opens it.
        self.poses.ensure_connected(now_ns)?;
        self.states.ensure_connected(now_ns).map(|_| ())
    }
}
