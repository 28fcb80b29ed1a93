//! All channels that are recorded, and the numbers of their messages.

use fringeflow_message::{
    Block, CloudHeader, CorrespondenceHeader, FrameHeader, MapsHeader, PatternEvent, PoseReport, PriorHeader,
    ScanState, Stage, StageReport, WindowReport,
};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{Arrivals, BEAT, Host, receive};
use fringeflow_transport::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, Header, PHASE_MAPS, PROJECTOR_PATTERN, Payload,
    REPORT_STAGE, REPORT_WINDOW, Received, Subscriber, TRACKING_POSE, TRACKING_PRIOR, TransportError, WaitSource,
    wait_for,
};

/// The receiving ends.
pub(crate) struct Channels {
    cameras: [Numbered<FrameHeader, [u8]>; 2],
    events: Numbered<(), PatternEvent>,
    maps: Option<Numbered<MapsHeader, [Block]>>,
    correspondences: Option<Numbered<CorrespondenceHeader, [Block]>>,
    clouds: Numbered<CloudHeader, [u8]>,
    reports: Subscriber<(), StageReport>,
    window_reports: Numbered<(), WindowReport>,
    poses: Option<Numbered<(), PoseReport>>,
    priors: Option<Numbered<PriorHeader, [u8]>>,
}

/// A channel whose messages are numbered.
struct Numbered<H: Header, P: Payload + ?Sized> {
    port: Subscriber<H, P>,
    /// Who sends them.
    from: Stage,
    /// `None` until the first message: what was sent before it was not for this recorder.
    arrivals: Option<Arrivals>,
}

/// A message that came.
pub(crate) enum Taken<'a> {
    /// One that is written down at once.
    Message(Recordable<'a>),
    /// An image, which may stay where it is until it is in the file.
    Image(Image),
}

/// An image in the memory that it came in.
pub(crate) struct Image(Received<FrameHeader, [u8]>);

impl Image {
    pub(crate) fn header(&self) -> FrameHeader {
        *self.0.header()
    }
}

impl AsRef<[u8]> for Image {
    fn as_ref(&self) -> &[u8] {
        self.0.payload()
    }
}

impl Channels {
    pub(crate) fn open(host: &Host) -> Result<Self, TransportError> {
        let settings = &host.configuration.recorder;
        let tracking = &host.configuration.measurement.tracking;
        Ok(Self {
            cameras: [
                Numbered::open(host, CAM1_FRAME, Stage::Camera1)?,
                Numbered::open(host, CAM2_FRAME, Stage::Camera2)?,
            ],
            events: Numbered::open(host, PROJECTOR_PATTERN, Stage::Projector)?,
            maps: settings.phase_maps.then(|| Numbered::open(host, PHASE_MAPS, Stage::Phase)).transpose()?,
            correspondences: settings
                .correspondences
                .then(|| Numbered::open(host, CORRESPONDENCE_MAP, Stage::Correspondence))
                .transpose()?,
            clouds: Numbered::open(host, CLOUD, Stage::Cloud)?,
            reports: Subscriber::open(&host.node, REPORT_STAGE, &host.sizes)?,
            window_reports: Numbered::open(host, REPORT_WINDOW, Stage::Correspondence)?,
            poses: tracking.is_enabled.then(|| Numbered::open(host, TRACKING_POSE, Stage::Tracking)).transpose()?,
            priors: tracking
                .takes_priors()
                .then(|| Numbered::open(host, TRACKING_PRIOR, Stage::Tracking))
                .transpose()?,
        })
    }

    /// Waits for messages, or for a change of the state.
    pub(crate) fn wait(&self, state: &Subscriber<(), ScanState>) -> Result<(), TransportError> {
        let mut ports: Vec<&dyn WaitSource> = vec![
            state,
            &self.cameras[0].port,
            &self.cameras[1].port,
            &self.events.port,
            &self.clouds.port,
            &self.reports,
            &self.window_reports.port,
        ];
        ports.extend(self.maps.as_ref().map(|maps| &maps.port as &dyn WaitSource));
        ports.extend(self.correspondences.as_ref().map(|found| &found.port as &dyn WaitSource));
        ports.extend(self.poses.as_ref().map(|poses| &poses.port as &dyn WaitSource));
        ports.extend(self.priors.as_ref().map(|priors| &priors.port as &dyn WaitSource));
        wait_for(&ports, BEAT)
    }

    /// Takes what has come, one message of each channel in turn, each with the number of those that were overwritten before it.
    pub(crate) fn drain(&mut self, mut take: impl FnMut(Taken<'_>, u64)) {
        loop {
            let mut any = self.events.next(
                |(), event| event.sequence,
                |(), event, missing| {
                    take(Taken::Message(Recordable::Pattern(event)), missing);
                },
            );
            for camera in &mut self.cameras {
                if let Some((image, missing)) = camera.receive(|header, _| header.published) {
                    take(Taken::Image(Image(image)), missing);
                    any = true;
                }
            }
            if let Some(maps) = &mut self.maps {
                any |= maps.next(
                    |header, _| header.published,
                    |header, payload, missing| {
                        take(
                            Taken::Message(Recordable::Maps { header, payload: bytemuck::cast_slice(payload) }),
                            missing,
                        );
                    },
                );
            }
            if let Some(found) = &mut self.correspondences {
                any |= found.next(
                    |header, _| header.published,
                    |header, payload, missing| {
                        take(
                            Taken::Message(Recordable::Correspondences {
                                header,
                                payload: bytemuck::cast_slice(payload),
                            }),
                            missing,
                        );
                    },
                );
            }
            any |= self.clouds.next(
                |header, _| header.published,
                |header, records, missing| {
                    take(Taken::Message(Recordable::Cloud { header, records }), missing);
                },
            );
            any |= self.window_reports.next(
                |(), report| report.published,
                |(), report, missing| {
                    take(Taken::Message(Recordable::WindowReport(report)), missing);
                },
            );
            if let Some(poses) = &mut self.poses {
                any |= poses.next(
                    |(), report| report.published,
                    |(), report, missing| {
                        take(Taken::Message(Recordable::Pose(report)), missing);
                        if report.has_pose() {
                            take(Taken::Message(Recordable::PoseTransform(report)), 0);
                        }
                    },
                );
            }
            if let Some(priors) = &mut self.priors {
                any |= priors.next(
                    |header, _| header.published,
                    |header, relief, missing| take(Taken::Message(Recordable::Prior { header, relief }), missing),
                );
            }
            // Of many senders, whose messages have no common number.
            if let Some(report) = receive(&mut self.reports) {
                take(Taken::Message(Recordable::Report(&report)), 0);
                any = true;
            }
            if !any {
                return;
            }
        }
    }

    /// Opens ports again that lost their other side.
    pub(crate) fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        self.cameras.iter_mut().try_for_each(|camera| camera.ensure_connected(host, now_ns))?;
        self.events.ensure_connected(host, now_ns)?;
        self.maps.iter_mut().try_for_each(|maps| maps.ensure_connected(host, now_ns))?;
        self.correspondences.iter_mut().try_for_each(|found| found.ensure_connected(host, now_ns))?;
        self.clouds.ensure_connected(host, now_ns)?;
        self.window_reports.ensure_connected(host, now_ns)?;
        self.poses.iter_mut().try_for_each(|poses| poses.ensure_connected(host, now_ns))?;
        self.priors.iter_mut().try_for_each(|priors| priors.ensure_connected(host, now_ns))?;
        self.reports.ensure_connected(now_ns).map(|_| ())
    }
}

impl<H: Header, P: Payload + ?Sized> Numbered<H, P> {
    fn open(host: &Host, channel: Channel<H, P>, from: Stage) -> Result<Self, TransportError> {
        Ok(Self { port: Subscriber::open(&host.node, channel, &host.sizes)?, from, arrivals: None })
    }

    /// The next message, if there is one, and how many are missing before it.
    fn receive(&mut self, number: impl Fn(&H, &P) -> u64) -> Option<(Received<H, P>, u64)> {
        let message = receive(&mut self.port)?;
        let number = number(message.header(), message.payload());
        let arrivals = self.arrivals.get_or_insert(Arrivals::beginning_at(number));
        Some((message, arrivals.arrive(number).unwrap_or(0)))
    }

    /// Takes the next message, if there is one.
    fn next(&mut self, number: impl Fn(&H, &P) -> u64, mut take: impl FnMut(&H, &P, u64)) -> bool {
        let Some((message, missing)) = self.receive(number) else { return false };
        take(message.header(), message.payload(), missing);
        true
    }

    /// Opens the port again if it lost its other side.
    fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        let next = self.arrivals.map_or(0, |arrivals| arrivals.next);
        host.ensure_connected(&mut self.port, self.from, next, now_ns)
    }
}
