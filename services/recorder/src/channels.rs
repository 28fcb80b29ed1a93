//! The recorded channels, and the numbers of their messages.

use fringeflow_message::{
    Block, CloudHeader, CorrespondenceHeader, FrameHeader, MapsHeader, PatternEvent, PoseReport, PriorHeader,
    ScanState, Stage, StageReport, WindowReport,
};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{Arrivals, Host, MAX_WAIT, receive};
use fringeflow_transport::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, Header, PHASE_MAPS, PROJECTOR_PATTERN, Payload,
    REPORT_STAGE, REPORT_WINDOW, Received, Subscriber, TRACKING_POSE, TRACKING_PRIOR, TransportError, WaitSource,
    wait_for,
};

/// Subscribers of all recorded channels.
pub(crate) struct Channels {
    cameras: [NumberedSubscriber<FrameHeader, [u8]>; 2],
    events: NumberedSubscriber<(), PatternEvent>,
    maps: Option<NumberedSubscriber<MapsHeader, [Block]>>,
    correspondences: Option<NumberedSubscriber<CorrespondenceHeader, [Block]>>,
    clouds: NumberedSubscriber<CloudHeader, [u8]>,
    reports: Subscriber<(), StageReport>,
    window_reports: NumberedSubscriber<(), WindowReport>,
    poses: Option<NumberedSubscriber<(), PoseReport>>,
    priors: Option<NumberedSubscriber<PriorHeader, [u8]>>,
}

/// A subscriber of a channel whose messages are numbered.
struct NumberedSubscriber<H: Header, P: Payload + ?Sized> {
    port: Subscriber<H, P>,
    /// The stage that sends them.
    from: Stage,
    /// `None` until the first message: the messages before it are not counted as lost.
    arrivals: Option<Arrivals>,
}

/// A received message.
pub(crate) enum Incoming<'a> {
    /// A message that is copied at once.
    Message(Recordable<'a>),
    /// An image or cloud that may stay in shared memory until the writer has copied it.
    Image(Held<FrameHeader>),
    Cloud(Held<CloudHeader>),
}

/// A message in shared memory.
pub(crate) struct Held<H: Header>(Received<H, [u8]>);

impl Incoming<'_> {
    /// Approximate size in a recording, bytes.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Message(message) => message.encoded_size(),
            Self::Image(image) => Recordable::Frame { header: &image.header(), image: image.as_ref() }.encoded_size(),
            Self::Cloud(cloud) => Recordable::Cloud { header: &cloud.header(), records: cloud.as_ref() }.encoded_size(),
        }
    }
}

impl<H: Header + Copy> Held<H> {
    pub(crate) fn header(&self) -> H {
        *self.0.header()
    }
}

impl<H: Header> AsRef<[u8]> for Held<H> {
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
                NumberedSubscriber::open(host, CAM1_FRAME, Stage::Camera1)?,
                NumberedSubscriber::open(host, CAM2_FRAME, Stage::Camera2)?,
            ],
            events: NumberedSubscriber::open(host, PROJECTOR_PATTERN, Stage::Projector)?,
            maps: settings.phase_maps.then(|| NumberedSubscriber::open(host, PHASE_MAPS, Stage::Phase)).transpose()?,
            correspondences: settings
                .correspondences
                .then(|| NumberedSubscriber::open(host, CORRESPONDENCE_MAP, Stage::Correspondence))
                .transpose()?,
            clouds: NumberedSubscriber::open(host, CLOUD, Stage::Cloud)?,
            reports: Subscriber::open(&host.node, REPORT_STAGE, &host.sizes)?,
            window_reports: NumberedSubscriber::open(host, REPORT_WINDOW, Stage::Correspondence)?,
            poses: tracking
                .is_enabled
                .then(|| NumberedSubscriber::open(host, TRACKING_POSE, Stage::Tracking))
                .transpose()?,
            priors: tracking
                .takes_priors()
                .then(|| NumberedSubscriber::open(host, TRACKING_PRIOR, Stage::Tracking))
                .transpose()?,
        })
    }

    /// Waits for messages, or for a change of the state.
    pub(crate) fn wait(&self, states: &Subscriber<(), ScanState>) -> Result<(), TransportError> {
        let mut ports: Vec<&dyn WaitSource> = vec![
            states,
            &self.cameras[0].port,
            &self.cameras[1].port,
            &self.events.port,
            &self.clouds.port,
            &self.reports,
            &self.window_reports.port,
        ];
        ports.extend(self.maps.as_ref().map(|maps| &maps.port as &dyn WaitSource));
        ports.extend(self.correspondences.as_ref().map(|correspondences| &correspondences.port as &dyn WaitSource));
        ports.extend(self.poses.as_ref().map(|poses| &poses.port as &dyn WaitSource));
        ports.extend(self.priors.as_ref().map(|priors| &priors.port as &dyn WaitSource));
        wait_for(&ports, MAX_WAIT)
    }

    /// Receives all waiting messages, one of each channel in turn. Calls `on_message` with each message and the number
    /// of messages that were overwritten before it.
    pub(crate) fn drain(&mut self, mut on_message: impl FnMut(Incoming<'_>, u64)) {
        loop {
            let mut has_received = self.events.handle_next(
                |(), event| event.sequence,
                |(), event, missing| {
                    on_message(Incoming::Message(Recordable::Pattern(event)), missing);
                },
            );
            for camera in &mut self.cameras {
                if let Some((image, missing)) = camera.receive(|header, _| header.published) {
                    on_message(Incoming::Image(Held(image)), missing);
                    has_received = true;
                }
            }
            if let Some(maps) = &mut self.maps {
                has_received |= maps.handle_next(
                    |header, _| header.published,
                    |header, payload, missing| {
                        on_message(
                            Incoming::Message(Recordable::Maps { header, payload: bytemuck::cast_slice(payload) }),
                            missing,
                        );
                    },
                );
            }
            if let Some(correspondences) = &mut self.correspondences {
                has_received |= correspondences.handle_next(
                    |header, _| header.published,
                    |header, payload, missing| {
                        on_message(
                            Incoming::Message(Recordable::Correspondences {
                                header,
                                payload: bytemuck::cast_slice(payload),
                            }),
                            missing,
                        );
                    },
                );
            }
            if let Some((cloud, missing)) = self.clouds.receive(|header, _| header.published) {
                on_message(Incoming::Cloud(Held(cloud)), missing);
                has_received = true;
            }
            has_received |= self.window_reports.handle_next(
                |(), report| report.published,
                |(), report, missing| {
                    on_message(Incoming::Message(Recordable::WindowReport(report)), missing);
                },
            );
            if let Some(poses) = &mut self.poses {
                has_received |= poses.handle_next(
                    |(), report| report.published,
                    |(), report, missing| {
                        on_message(Incoming::Message(Recordable::Pose(report)), missing);
                        if report.has_pose() {
                            on_message(Incoming::Message(Recordable::PoseTransform(report)), 0);
                        }
                    },
                );
            }
            if let Some(priors) = &mut self.priors {
                has_received |= priors.handle_next(
                    |header, _| header.published,
                    |header, relief, missing| {
                        on_message(Incoming::Message(Recordable::Prior { header, relief }), missing);
                    },
                );
            }
            // These come from many senders, so they have no common numbers.
            if let Some(report) = receive(&mut self.reports) {
                on_message(Incoming::Message(Recordable::Report(&report)), 0);
                has_received = true;
            }
            if !has_received {
                return;
            }
        }
    }

    /// Returns how many images, maps, correspondences and clouds were sent and have not arrived. All stages must have
    /// stopped. No later number tells that the last messages of a channel are missing.
    pub(crate) fn never_arrived(&mut self, host: &Host) -> u64 {
        let cameras: u64 = self.cameras.iter_mut().map(|camera| camera.never_arrived(host)).sum();
        let maps = self.maps.as_mut().map_or(0, |maps| maps.never_arrived(host));
        let correspondences = self.correspondences.as_mut().map_or(0, |found| found.never_arrived(host));
        cameras + maps + correspondences + self.clouds.never_arrived(host)
    }

    /// Opens ports again that lost their connection.
    pub(crate) fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        self.cameras.iter_mut().try_for_each(|camera| camera.ensure_connected(host, now_ns))?;
        self.events.ensure_connected(host, now_ns)?;
        self.maps.iter_mut().try_for_each(|maps| maps.ensure_connected(host, now_ns))?;
        self.correspondences.iter_mut().try_for_each(|port| port.ensure_connected(host, now_ns))?;
        self.clouds.ensure_connected(host, now_ns)?;
        self.window_reports.ensure_connected(host, now_ns)?;
        self.poses.iter_mut().try_for_each(|poses| poses.ensure_connected(host, now_ns))?;
        self.priors.iter_mut().try_for_each(|priors| priors.ensure_connected(host, now_ns))?;
        self.reports.ensure_connected(now_ns).map(|_| ())
    }
}

impl<H: Header, P: Payload + ?Sized> NumberedSubscriber<H, P> {
    fn open(host: &Host, channel: Channel<H, P>, from: Stage) -> Result<Self, TransportError> {
        Ok(Self { port: Subscriber::open(&host.node, channel, &host.sizes)?, from, arrivals: None })
    }

    /// Receives the next message, if there is one. Returns it and the number of messages missing before it.
    fn receive(&mut self, number: impl Fn(&H, &P) -> u64) -> Option<(Received<H, P>, u64)> {
        let message = receive(&mut self.port)?;
        let number = number(message.header(), message.payload());
        let arrivals = self.arrivals.get_or_insert(Arrivals::new(number));
        Some((message, arrivals.arrive(number).unwrap_or(0)))
    }

    /// Receives the next message, if there is one, and calls `on_message` with it and the number of messages missing
    /// before it. Returns whether there was one.
    fn handle_next(&mut self, number: impl Fn(&H, &P) -> u64, mut on_message: impl FnMut(&H, &P, u64)) -> bool {
        let Some((message, missing)) = self.receive(number) else { return false };
        on_message(message.header(), message.payload(), missing);
        true
    }

    /// Returns how many messages were sent and have not arrived. The numbers of the channel must be those of the items
    /// that its stage passes on.
    fn never_arrived(&mut self, host: &Host) -> u64 {
        let sent = host.read_counts(self.from).map_or(0, |counts| counts.passed);
        match &mut self.arrivals {
            Some(arrivals) => arrivals.catch_up(sent),
            // Before a restart, another process received them.
            None => {
                if host.restarts() == 0 {
                    sent
                } else {
                    0
                }
            }
        }
    }

    /// Opens the port again if it lost its connection.
    fn ensure_connected(&mut self, host: &Host, now_ns: u64) -> Result<(), TransportError> {
        let next = self.arrivals.map_or(0, |arrivals| arrivals.next);
        host.ensure_connected(&mut self.port, self.from, next, now_ns)
    }
}
