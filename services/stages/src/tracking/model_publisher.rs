//! Sends the model to viewers: thinned to a limited number of points, at fixed intervals.

use fringeflow_config::TrackingConfiguration;
use fringeflow_message::{ModelHeader, PoseReport};
use fringeflow_runtime::{Host, clock};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::model_message;
use fringeflow_transport::{Publisher, TRACKING_MODEL, TransportError};

/// Sends the model.
pub(crate) struct ModelPublisher {
    output: Publisher<ModelHeader, [u8]>,
    max_points: usize,
    interval_ns: u64,
    min_support: u32,
    /// Voxel size at which the last model had few enough points.
    voxel_m: f64,
    last_sent_ns: u64,
    /// Header and points of the last message.
    header: ModelHeader,
    points: Vec<u8>,
}

impl ModelPublisher {
    pub(crate) fn open(host: &Host, configuration: &TrackingConfiguration) -> Result<Self, TransportError> {
        Ok(Self {
            output: Publisher::open(&host.node, TRACKING_MODEL, &host.sizes)?,
            max_points: configuration.shown_points,
            interval_ns: configuration.shown_every_ns,
            min_support: configuration.fusion().min_support,
            voxel_m: 0.0,
            last_sent_ns: 0,
            header: ModelHeader::default(),
            points: Vec::new(),
        })
    }

    /// Sends the model if its interval has ended. A model that has not grown is sent again, so that new viewers see it
    /// while the scanner is lost. `last_pose` is the report on the last cloud in the model.
    pub(crate) fn send_if_due(&mut self, tracker: &Tracker, last_pose: &PoseReport, now_ns: u64) {
        let clouds = tracker.model().clouds() as u64;
        if clouds == 0 || now_ns.saturating_sub(self.last_sent_ns) < self.interval_ns {
            return;
        }
        self.last_sent_ns = now_ns;
        if clouds != self.header.clouds {
            let thinned = tracker.model().thinned(self.min_support, self.max_points, self.voxel_m);
            self.voxel_m = thinned.voxel_m;
            self.header = model_message(tracker, &thinned, last_pose, &mut self.points);
        }
        let header = ModelHeader { published_ns: clock::now_ns(), ..self.header };
        // A model that was not sent must not end the service: the next one replaces it.
        if let Err(error) = self.output.send(&header, &self.points) {
            tracing::debug!(%error, "the model was not sent");
        }
    }

    pub(crate) fn ensure_connected(&mut self) -> Result<(), TransportError> {
        self.output.ensure_connected().map(|_| ())
    }
}
