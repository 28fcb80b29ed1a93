//! The model as it is shown: few enough points, now and then.

use fringeflow_config::TrackingConfiguration;
use fringeflow_message::{ModelHeader, PoseReport};
use fringeflow_runtime::{Host, clock};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::model_message;
use fringeflow_transport::{Publisher, TRACKING_MODEL, TransportError};

/// Puts out the model.
pub(crate) struct Shown {
    output: Publisher<ModelHeader, [u8]>,
    limit: usize,
    every_ns: u64,
    min_support: u32,
    /// Side of the cubes that were small enough last.
    voxel_m: f64,
    sent_ns: u64,
    /// What was sent last.
    header: ModelHeader,
    points: Vec<u8>,
}

impl Shown {
    pub(crate) fn open(host: &Host, configuration: &TrackingConfiguration) -> Result<Self, TransportError> {
        Ok(Self {
            output: Publisher::open(&host.node, TRACKING_MODEL, &host.sizes)?,
            limit: configuration.shown_points,
            every_ns: configuration.shown_every_ns,
            min_support: configuration.fusion().min_support,
            voxel_m: 0.0,
            sent_ns: 0,
            header: ModelHeader::default(),
            points: Vec::new(),
        })
    }

    /// Puts out the model when its time has come, the same again where it has not grown: whoever begins to watch while the
    /// scanner is lost sees it too. `last` is the report on the last cloud in it.
    pub(crate) fn turn(&mut self, tracker: &Tracker, last: &PoseReport, now_ns: u64) {
        let clouds = tracker.model().clouds() as u64;
        if clouds == 0 || now_ns.saturating_sub(self.sent_ns) < self.every_ns {
            return;
        }
        self.sent_ns = now_ns;
        if clouds != self.header.clouds {
            let shown = tracker.model().thinned(self.min_support, self.limit, self.voxel_m);
            self.voxel_m = shown.voxel_m;
            self.header = model_message(tracker, &shown, last, &mut self.points);
        }
        let header = ModelHeader { published_ns: clock::now_ns(), ..self.header };
        // A model that nobody sees is not worth a service; the next one comes.
        if let Err(error) = self.output.send(&header, &self.points) {
            tracing::debug!(%error, "no model");
        }
    }

    pub(crate) fn ensure_connected(&mut self) -> Result<(), TransportError> {
        self.output.ensure_connected().map(|_| ())
    }
}
