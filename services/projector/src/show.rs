//! Shows patterns in turn. With an instance, follows its state and announces each pattern that was shown.

use std::time::{Duration, Instant};

use serde::Serialize;

use fringeflow_message::{PATTERN_FRINGES, PatternEvent, ScanState};
use fringeflow_patterns::PatternSet;
use fringeflow_runtime::{Stop, clock, receive};
use fringeflow_transport::{
    ChannelSizes, Instance, Node, PROJECTOR_PATTERN, Publisher, SCAN_STATE, Subscriber, TransportError,
};

use crate::schedule::{Schedule, Shown};
use crate::window::{Completed, Completion, Stored, Window};
use crate::{Monitor, ProjectorError, Screen};

/// Longest wait between two looks at the state of the instance.
const MAX_WAIT: Duration = Duration::from_millis(20);
/// Time between two checks whether the instance still runs.
const CHECK_INTERVAL: Duration = Duration::from_millis(500);
/// Longest wait for the last patterns after a request to stop.
const LAST_PATTERNS: Duration = Duration::from_secs(1);
/// Refreshes over which the rate of a monitor is measured whose mode does not tell it.
const MEASURED_REFRESHES: u64 = 120;
/// Largest deviation of a slot from the period of the images: more than the rate of a monitor without a mode can be off, as
/// its timer is that of a busy machine.
const MAX_DEVIATION: f64 = 0.03;

/// The patterns of a scan as its events tell them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Images per second.
    pub rate_hz: f64,
    /// Fringe period, projector pixels.
    pub period_px: f64,
    /// Time from the vertical blank that begins a pattern to the start of the exposure, ns; may be negative.
    pub delay_ns: i64,
}

/// What became of the patterns that were due. A number of patterns is due in the time in which the instance scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ShownCounts {
    /// Patterns due.
    pub due: u64,
    /// Patterns shown and, with an instance, announced.
    pub announced: u64,
    /// Patterns that were not shown in their time, so that no event tells of them: `overrun`.
    pub dropped: u64,
}

/// How a scan ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Announced {
    /// The balance.
    pub counts: ShownCounts,
    /// Refreshes for which each pattern was shown.
    pub refreshes: u64,
}

/// Shows a set again and again, each image for some seconds, until the stop is requested.
///
/// # Errors
/// The patterns do not fit the monitor, or the server does not answer.
pub fn show(
    screen: &Screen,
    monitor: &Monitor,
    set: &PatternSet,
    seconds: f64,
    stop: &Stop,
) -> Result<Announced, ProjectorError> {
    let mut projector = Projector::open(screen, monitor, set, |refresh_hz| Ok(refresh_hz * seconds))?;
    while !stop.is_requested() {
        projector.ask()?;
        projector.step()?;
    }
    Ok(projector.result())
}

/// Shows a cycle while an instance scans, and announces each image to it. Ends with the instance, or when the stop is
/// requested.
///
/// # Errors
/// No such instance runs, the patterns do not fit the monitor or the rate, or the server does not answer.
pub fn announce(
    screen: &Screen,
    monitor: &Monitor,
    set: &PatternSet,
    cycle: &Cycle,
    instance: &Instance,
    stop: &Stop,
) -> Result<Announced, ProjectorError> {
    if !is_running(instance)? {
        return Err(TransportError::NotRunning { name: instance.name().to_owned() }.into());
    }
    let mut projector = Projector::open(screen, monitor, set, |refresh_hz| {
        let refreshes = refresh_hz / cycle.rate_hz;
        let is_whole = (refreshes / refreshes.round() - 1.0).abs() <= MAX_DEVIATION;
        let (monitor, rate_hz) = (monitor.name.clone(), cycle.rate_hz);
        is_whole.then_some(refreshes).ok_or(ProjectorError::Rate { monitor, rate_hz, refresh_hz })
    })?;
    let node = Node::open(instance, "projector")?;
    let mut channels = Channels {
        events: Publisher::open(&node, PROJECTOR_PATTERN, &ChannelSizes::default())?,
        states: Subscriber::open(&node, SCAN_STATE, &ChannelSizes::default())?,
        session: clock::now_ns(),
        sequence: 0,
        steps: set.images.len() as u32,
        cycle: *cycle,
        duration_ns: projector.slot_ns() as u64,
    };
    let (mut is_scanning, mut is_alive) = (false, true);
    let (mut checked, mut stopped) = (Instant::now(), None);
    loop {
        while let Some(state) = receive(&mut channels.states) {
            is_scanning = state.scanning != 0;
        }
        if stop.is_requested() || !is_alive {
            // What was handed over is still shown, and announced.
            is_scanning = false;
            let since = *stopped.get_or_insert_with(Instant::now);
            if projector.schedule.is_idle() || since.elapsed() >= LAST_PATTERNS {
                break;
            }
        }
        if is_scanning {
            projector.ask()?;
        }
        if let Some((shown, told)) = projector.step()? {
            channels.announce(&shown, &told);
        }
        if !is_scanning {
            projector.darken()?;
        }
        if checked.elapsed() >= CHECK_INTERVAL {
            checked = Instant::now();
            is_alive = is_running(instance)?;
            if is_alive {
                channels.ensure_connected();
            }
        }
    }
    Ok(projector.result())
}

/// Whether other processes of an instance live.
fn is_running(instance: &Instance) -> Result<bool, TransportError> {
    let own = std::process::id();
    Ok(instance.participants()?.iter().any(|participant| participant.pid != own))
}

/// A window with its images, and their order.
struct Projector<'a> {
    window: Window<'a>,
    images: Vec<Stored>,
    schedule: Schedule,
    refreshes: u64,
    refresh_ns: f64,
    now_refresh: u64,
    counts: ShownCounts,
    is_dark: bool,
}

impl<'a> Projector<'a> {
    /// Stores the images. `refreshes` tells from the rate of the monitor for how many refreshes each image is shown.
    fn open(
        screen: &'a Screen,
        monitor: &Monitor,
        set: &PatternSet,
        refreshes: impl FnOnce(f64) -> Result<f64, ProjectorError>,
    ) -> Result<Self, ProjectorError> {
        let window = Window::open(screen, monitor)?;
        let images = (0..set.images.len()).filter_map(|index| set.image(index));
        let images = images.map(|image| window.store(&image)).collect::<Result<Vec<_>, _>>()?;
        let refresh_hz = match monitor.refresh_hz {
            Some(refresh_hz) => refresh_hz,
            None => measured_refresh_hz(&window)?,
        };
        let refreshes = (refreshes(refresh_hz)?.round() as u64).max(1);
        Ok(Self {
            schedule: Schedule::new(images.len(), refreshes),
            window,
            images,
            refreshes,
            refresh_ns: 1e9 / refresh_hz,
            now_refresh: 0,
            counts: ShownCounts::default(),
            is_dark: true,
        })
    }

    fn result(&self) -> Announced {
        Announced { counts: self.counts, refreshes: self.refreshes }
    }

    /// Time of a slot, ns.
    fn slot_ns(&self) -> f64 {
        self.refreshes as f64 * self.refresh_ns
    }

    /// Hands over the next images.
    fn ask(&mut self) -> Result<(), ProjectorError> {
        if self.is_dark {
            self.now_refresh = self.window.time(0)?.refresh;
            self.is_dark = false;
        }
        while let Some(request) = self.schedule.next(self.now_refresh) {
            self.window.present(self.images[request.pattern], request.serial, request.refresh)?;
        }
        Ok(())
    }

    /// Waits a while for what the server shows, and counts it. Returns what is to be announced.
    fn step(&mut self) -> Result<Option<(Shown, Completion)>, ProjectorError> {
        let Some(told) = self.window.wait(MAX_WAIT)? else { return Ok(None) };
        self.now_refresh = self.now_refresh.max(told.refresh);
        let is_shown = matches!(told.kind, Completed::Shown { .. });
        let Some(shown) = self.schedule.complete(told.serial, told.refresh, is_shown) else { return Ok(None) };
        if shown.missed > 0 || shown.late_refreshes > 0 {
            tracing::warn!(missed = shown.missed, late_refreshes = shown.late_refreshes, "a pattern came too late");
        }
        self.counts.due += shown.missed + 1;
        self.counts.dropped += shown.missed + u64::from(!shown.has_slot);
        self.counts.announced += u64::from(shown.has_slot);
        Ok(shown.has_slot.then_some((shown, told)))
    }

    /// Shows nothing, once the images that were handed over were shown.
    fn darken(&mut self) -> Result<(), ProjectorError> {
        if !self.is_dark && self.schedule.is_idle() {
            self.schedule.pause();
            // Its number belongs to no request.
            self.window.present(self.window.black(), 0, 0)?;
            self.is_dark = true;
        }
        Ok(())
    }
}

fn measured_refresh_hz(window: &Window<'_>) -> Result<f64, ProjectorError> {
    let begin = window.time(0)?;
    let end = window.time(begin.refresh + MEASURED_REFRESHES)?;
    let count = end.refresh.saturating_sub(begin.refresh);
    Ok(count as f64 * 1e9 / end.time_ns.saturating_sub(begin.time_ns).max(1) as f64)
}

/// The channels of an instance.
struct Channels {
    events: Publisher<(), PatternEvent>,
    states: Subscriber<(), ScanState>,
    session: u64,
    sequence: u64,
    steps: u32,
    cycle: Cycle,
    duration_ns: u64,
}

impl Channels {
    fn announce(&mut self, shown: &Shown, told: &Completion) {
        let event = PatternEvent {
            session: self.session,
            sequence: self.sequence,
            exposure_start_ns: told.time_ns.saturating_add_signed(self.cycle.delay_ns),
            duration_ns: self.duration_ns,
            period_px: self.cycle.period_px,
            step: shown.pattern as u32,
            steps: self.steps,
            kind: PATTERN_FRINGES,
            reserved: 0,
        };
        self.sequence += 1;
        // An event that cannot be sent leaves a gap in the numbers, and the instance counts it as lost.
        if let Err(error) = self.events.send_message(&event) {
            tracing::warn!("{error}");
        }
    }

    /// An error is logged, and the next check tries again.
    fn ensure_connected(&mut self) {
        let connected = self.events.ensure_connected();
        if let Err(error) = connected.and_then(|_| self.states.ensure_connected(clock::now_ns())) {
            tracing::warn!("{error}");
        }
    }
}
