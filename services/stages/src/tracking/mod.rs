//! The tracking service: clouds in, poses of the scanner and the growing model out.
//!
//! It takes the newest cloud, and counts the clouds that arrived while it worked, so it never delays the clouds. If the
//! configuration wants no window lost, it takes every cloud, and the stages before wait for it. A cloud that is not
//! found on the model is reported as lost, without a pose.

mod model_publisher;

use fringeflow::cloud::{RECORD_BYTES, decode_record};
use fringeflow_message::{CloudHeader, DropReason, PoseReport, PriorHeader, Stage};
use fringeflow_runtime::{
    Account, Host, ItemTimes, MAX_WAIT, ServiceArgs, ServiceError, WindowSpan, clock, receive, sent_messages,
};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::pose_report;
use fringeflow_transport::{CLOUD, Publisher, Received, Subscriber, TRACKING_POSE, TRACKING_PRIOR, wait_for};
use fringeflow_wire::{drift, prior};

use model_publisher::ModelPublisher;

/// Nice value of this service. On a shared core, the stages that make the clouds get nine tenths of the time.
const NICENESS: i32 = 10;
/// Source number of the clouds.
const CLOUD_SOURCE: usize = 0;

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    // The error is ignored: the service works with the default nice value too.
    let _ = rustix::process::nice(NICENESS);
    let mut host = Host::open(arguments, "tracking")?;
    let mut clouds = Subscriber::open(&host.node, CLOUD, &host.sizes)?;
    let mut stage = TrackingStage::open(&host)?;
    host.catch_up(&mut stage.account, DropReason::Restart)?;
    loop {
        // Read before the channel is emptied, so that the last cloud is processed too.
        let is_last = host.stop.is_requested();
        let next = stage.receive_next(&mut clouds, host.configuration.wait_when_busy)?;
        let is_idle = next.is_none();
        if let Some(cloud) = next {
            let header = cloud.header();
            let span = WindowSpan::new(Stage::Tracking, header.published);
            span.identify(&header.window);
            span.work(|| stage.track(cloud, &mut host))?;
        }
        if is_last && is_idle {
            break;
        }
        if host.is_heartbeat_due() {
            host.report(Stage::Tracking, stage.account.counts(), None);
        }
        if stage.check_connections(&mut host, &mut clouds) {
            host.catch_up(&mut stage.account, DropReason::Thinned)?;
        }
        stage.model.send_if_due(&stage.tracker, &stage.last_pose, clock::now_ns());
        // After a cloud, check for another one first: its wake-up may already have been consumed.
        if is_idle {
            wait_for(&[&clouds], MAX_WAIT)?;
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
    /// `None` if another program sends priors, or none are used.
    priors: Option<PriorOutput>,
    model: ModelPublisher,
    /// The last report with a pose.
    last_pose: PoseReport,
    /// Number of the first cloud of the model, once there is one.
    first_cloud: Option<u64>,
    is_lost: bool,
}

/// Sends priors for the next windows.
struct PriorOutput {
    output: Publisher<PriorHeader, [u8]>,
    /// Payload of the last prior.
    relief: Vec<u8>,
}

impl TrackingStage {
    fn open(host: &Host) -> Result<Self, ServiceError> {
        let configuration = &host.configuration.measurement.tracking;
        Ok(Self {
            account: host.open_account(Stage::Tracking)?,
            tracker: Tracker::new(host.setup.rig.cam1, configuration.fusion()),
            poses: Publisher::open(&host.node, TRACKING_POSE, &host.sizes)?,
            priors: if configuration.makes_priors() {
                let output = Publisher::open(&host.node, TRACKING_PRIOR, &host.sizes)?;
                Some(PriorOutput { output, relief: Vec::new() })
            } else {
                None
            },
            model: ModelPublisher::open(host, configuration)?,
            last_pose: PoseReport::default(),
            first_cloud: None,
            is_lost: false,
        })
    }

    /// Returns the newest waiting cloud; the clouds before it are dropped. If every cloud `is_kept`, the oldest is
    /// returned and the others wait: the next cloud may be sent as soon as this one is counted.
    fn receive_next(
        &mut self,
        clouds: &mut Subscriber<CloudHeader, [u8]>,
        is_kept: bool,
    ) -> Result<Option<Received<CloudHeader, [u8]>>, ServiceError> {
        let mut next = None;
        while let Some(cloud) = receive(clouds) {
            if !self.account.count_arrival_with(CLOUD_SOURCE, cloud.header().published, DropReason::Thinned)? {
                continue;
            }
            if next.replace(cloud).is_some() {
                self.account.drop_one(DropReason::Thinned)?;
            }
            if is_kept {
                break;
            }
        }
        Ok(next)
    }

    fn track(&mut self, cloud: Received<CloudHeader, [u8]>, host: &mut Host) -> Result<(), ServiceError> {
        let (taken_ns, header) = (clock::now_ns(), *cloud.header());
        let count = header.points as usize;
        if count.checked_mul(RECORD_BYTES) != Some(cloud.payload().len()) {
            tracing::warn!(cloud = header.published, "the payload of a cloud contradicts its header");
            self.account.drop_one(DropReason::Malformed)?;
            host.report(Stage::Tracking, self.account.counts(), None);
            return Ok(());
        }
        // The tracker drops the points, and with them the sample, before its work begins: the publisher needs the
        // sample back soon.
        let points = (0..count).map(move |k| decode_record(&cloud.payload().as_chunks().0[k]));
        let tracked = self.tracker.step(points, header.window.centre_ns);
        let first_cloud = self.first_cloud.unwrap_or(header.published);
        let report = pose_report(&self.tracker, &tracked, &header, first_cloud);
        let published = sent_messages(Stage::Tracking, self.account.counts());
        let is_tracked = report.has_pose();
        if is_tracked {
            self.first_cloud = Some(first_cloud);
            self.account.count_passed()?;
        } else {
            self.account.drop_one(DropReason::NotTracked)?;
        }
        let report = PoseReport { published, published_ns: clock::now_ns(), ..report };
        // A report that was not sent is missing in the channel, and its receivers count it.
        if let Err(error) = self.poses.send_message(&report) {
            tracing::warn!("{error}");
        }
        self.send_prior(&report, &header);
        self.log_lost_or_found(&report);
        if is_tracked {
            self.last_pose = report;
        }
        let (exposure_start_ns, received_ns) = (header.window.last_exposure_ns, header.window.received_ns);
        let passed_ns = report.published_ns;
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns, passed_ns, waited_ns: 0 };
        host.report(Stage::Tracking, self.account.counts(), is_tracked.then_some(times));
        Ok(())
    }

    /// Sends the prior that follows from a cloud and its report. The message is empty if the cloud gives no
    /// prior, as when it is lost.
    fn send_prior(&mut self, report: &PoseReport, cloud: &CloudHeader) {
        let Some(PriorOutput { output, relief }) = &mut self.priors else { return };
        let header = prior::encode(self.tracker.prior(drift::read(&cloud.drift)), report, relief);
        let header = PriorHeader { published_ns: clock::now_ns(), ..header };
        if let Err(error) = output.send(&header, relief) {
            tracing::warn!("{error}");
        }
    }

    /// Logs when the tracking loses the scanner, and when it finds it again.
    fn log_lost_or_found(&mut self, report: &PoseReport) {
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

    /// Checks the connections. Returns whether the channel of the clouds was opened again.
    fn check_connections(&mut self, host: &mut Host, clouds: &mut Subscriber<CloudHeader, [u8]>) -> bool {
        let mut is_reopened = false;
        let Self { account, poses, priors, model, .. } = self;
        host.check_connections(|host, now_ns| {
            if !host.is_behind(account) {
                clouds.forgive_silence();
            }
            is_reopened = clouds.ensure_connected(now_ns)?;
            poses.ensure_connected()?;
            priors.iter_mut().try_for_each(|priors| priors.output.ensure_connected().map(|_| ()))?;
            model.ensure_connected()
        });
        is_reopened
    }
}
