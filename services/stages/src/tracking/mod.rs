//! The tracking service: clouds in, poses of the scanner and the model that grows out.
//!
//! It never holds up the clouds, unless the configuration wants no window lost: it takes the newest, and counts those that
//! came while it worked. A cloud that is not found on the model is told as lost, without a pose.

mod shown;

use fringeflow::cloud::{Cloud, read_records};
use fringeflow_message::{CloudHeader, DropReason, PoseReport, PriorHeader, Stage};
use fringeflow_runtime::{Account, BEAT, Host, ItemTimes, ServiceArgs, ServiceError, clock, messages, receive};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::pose_report;
use fringeflow_transport::{CLOUD, Publisher, Received, Subscriber, TRACKING_POSE, TRACKING_PRIOR, wait_for};
use fringeflow_wire::{drift, prior};

use shown::Shown;

/// How much it gives way to the stages that make the clouds: nine tenths of a core that they share are theirs.
const NICENESS: i32 = 10;
/// Place of the clouds among the sources of the stage.
const CLOUDS: usize = 0;

/// Runs the service until it is to end.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    // Without it, it is only less polite.
    let _ = rustix::process::nice(NICENESS);
    let mut host = Host::open(arguments, "tracking")?;
    let mut clouds = Subscriber::open(&host.node, CLOUD, &host.sizes)?;
    let mut stage = TrackingStage::open(&host)?;
    host.catch_up(&mut stage.account, DropReason::Restart)?;
    loop {
        // Asked before the channel is emptied, so that what the cloud service put out last is not left.
        let is_last = host.stop.is_requested();
        let newest = stage.newest(&mut clouds)?;
        let is_idle = newest.is_none();
        newest.map_or(Ok(()), |cloud| stage.track(cloud, &mut host))?;
        if is_last {
            break;
        }
        if host.beat_is_due() {
            host.report(Stage::Tracking, stage.account.counts(), None);
        }
        if stage.tend(&mut host, &mut clouds) {
            host.catch_up(&mut stage.account, DropReason::Thinned)?;
        }
        stage.shown.turn(&stage.tracker, &stage.last, clock::now_ns());
        // Another may have come meanwhile, and its wake-up have been heard.
        if is_idle {
            wait_for(&[&clouds], BEAT)?;
        }
    }
    host.catch_up(&mut stage.account, DropReason::Thinned)?;
    host.report(Stage::Tracking, stage.account.counts(), None);
    Ok(())
}

struct TrackingStage {
    account: Account,
    tracker: Tracker,
    poses: Publisher<(), PoseReport>,
    /// What tells the next windows; none where another program does.
    priors: Option<Priors>,
    shown: Shown,
    /// The last report on a cloud with a pose.
    last: PoseReport,
    /// Number of the first cloud of the model, once there is one.
    first_cloud: Option<u64>,
    is_lost: bool,
}

/// Tells the next windows what is known.
struct Priors {
    output: Publisher<PriorHeader, [u8]>,
    relief: Vec<u8>,
}

impl TrackingStage {
    fn open(host: &Host) -> Result<Self, ServiceError> {
        let configuration = &host.configuration.measurement.tracking;
        Ok(Self {
            account: host.account(Stage::Tracking)?,
            tracker: Tracker::new(host.setup.rig.cam1.clone(), configuration.fusion()),
            poses: Publisher::open(&host.node, TRACKING_POSE, &host.sizes)?,
            priors: if configuration.makes_priors() {
                Some(Priors { output: Publisher::open(&host.node, TRACKING_PRIOR, &host.sizes)?, relief: Vec::new() })
            } else {
                None
            },
            shown: Shown::open(host, configuration)?,
            last: PoseReport::default(),
            first_cloud: None,
            is_lost: false,
        })
    }

    /// The newest cloud that waits; those before it are passed over.
    fn newest(
        &mut self,
        clouds: &mut Subscriber<CloudHeader, [u8]>,
    ) -> Result<Option<Received<CloudHeader, [u8]>>, ServiceError> {
        let mut newest = None;
        while let Some(cloud) = receive(clouds) {
            if self.account.arrive_after(CLOUDS, cloud.header().published, DropReason::Thinned)?
                && newest.replace(cloud).is_some()
            {
                self.account.drop_one(DropReason::Thinned)?;
            }
        }
        Ok(newest)
    }

    fn track(&mut self, cloud: Received<CloudHeader, [u8]>, host: &mut Host) -> Result<(), ServiceError> {
        let (taken_ns, header) = (clock::now_ns(), *cloud.header());
        let points = read_records(cloud.payload()).filter(|points| points.len() as u64 == header.points);
        // The publisher needs the sample back sooner than the work is done.
        drop(cloud);
        let Some(points) = points else {
            tracing::warn!(cloud = header.published, "the payload of a cloud contradicts its header");
            self.account.drop_one(DropReason::Malformed)?;
            host.report(Stage::Tracking, self.account.counts(), None);
            return Ok(());
        };
        let tracked = self.tracker.step(&Cloud { points }, header.window.centre_ns);
        let first_cloud = self.first_cloud.unwrap_or(header.published);
        let report = pose_report(&self.tracker, &tracked, &header, first_cloud);
        let published = messages(Stage::Tracking, self.account.counts());
        let is_tracked = report.has_pose();
        if is_tracked {
            self.first_cloud = Some(first_cloud);
            self.account.pass()?;
        } else {
            self.account.drop_one(DropReason::NotTracked)?;
        }
        let report = PoseReport { published, published_ns: clock::now_ns(), ..report };
        // What could not be sent is missing in the channel, and counted there.
        if let Err(error) = self.poses.send_message(&report) {
            tracing::warn!("{error}");
        }
        self.tell_next_windows(&report, &header);
        self.tell(&report);
        if is_tracked {
            self.last = report;
        }
        let (exposure_start_ns, received_ns) = (header.window.last_exposure_ns, header.window.received_ns);
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns, passed_ns: report.published_ns };
        host.report(Stage::Tracking, self.account.counts(), is_tracked.then_some(times));
        Ok(())
    }

    /// Says what the cloud of a report tells of the windows behind it: nothing where it was lost.
    fn tell_next_windows(&mut self, report: &PoseReport, cloud: &CloudHeader) {
        let Some(Priors { output, relief }) = &mut self.priors else { return };
        let header = prior::encode(self.tracker.prior(drift::read(&cloud.drift)), report, relief);
        let header = PriorHeader { published_ns: clock::now_ns(), ..header };
        if let Err(error) = output.send(&header, relief) {
            tracing::warn!("{error}");
        }
    }

    /// Says when the scanner is lost, and when it is found again.
    fn tell(&mut self, report: &PoseReport) {
        let was_lost = std::mem::replace(&mut self.is_lost, !report.has_pose());
        match (was_lost, report.reason()) {
            (false, Some(reason)) => tracing::warn!(
                reason = reason.name(),
                cloud = report.cloud,
                "the tracking has lost the scanner; move the scanner back to where it was"
            ),
            (true, None) => tracing::info!(cloud = report.cloud, "the tracking has found the scanner again"),
            _ => {}
        }
    }

    /// Looks after the connections; whether the clouds were opened anew.
    fn tend(&mut self, host: &mut Host, clouds: &mut Subscriber<CloudHeader, [u8]>) -> bool {
        let mut is_renewed = false;
        let Self { account, poses, priors, shown, .. } = self;
        host.tend(|host, now_ns| {
            if !host.is_behind(account) {
                clouds.forgive_silence();
            }
            is_renewed = clouds.ensure_connected(now_ns)?;
            poses.ensure_connected()?;
            priors.iter_mut().try_for_each(|priors| priors.output.ensure_connected().map(|_| ()))?;
            shown.ensure_connected()
        });
        is_renewed
    }
}
