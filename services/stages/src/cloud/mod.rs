//! The cloud service: correspondences in, clouds out.

use std::convert::Infallible;
use std::sync::Arc;

use fringeflow::cloud::{Cloud, RECORD_BYTES, encode_records};
use fringeflow::worker::{CloudWorker, Correspondences};
use fringeflow_message::{Block, CloudHeader, CorrespondenceHeader, DropReason, Stage, Window};
use fringeflow_runtime::{Dropped, Host, ServiceArgs, ServiceError, Transform, clock, run_transform};
use fringeflow_transport::{CLOUD, CORRESPONDENCE_MAP, Channel, Publisher, TransportError};
use fringeflow_wire as wire;

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "cloud")?;
    let table = Arc::new(arguments.segment_table(&host.configuration, &host.setup)?);
    let worker = CloudWorker::new(&host.setup.rig, table);
    let worker = worker.map_err(|e| ServiceError::Unusable(e.to_string()))?;
    let stage = CloudStage {
        worker,
        correspondences: Correspondences::default(),
        window: Window::default(),
        cloud: Cloud::default(),
    };
    run_transform(&mut host, stage)
}

struct CloudStage {
    worker: CloudWorker,
    correspondences: Correspondences,
    window: Window,
    cloud: Cloud,
}

impl Transform for CloudStage {
    type InHeader = CorrespondenceHeader;
    type InPayload = [Block];
    type OutHeader = CloudHeader;
    type OutPayload = [u8];

    const INPUT: Channel<CorrespondenceHeader, [Block]> = CORRESPONDENCE_MAP;
    const OUTPUT: Channel<CloudHeader, [u8]> = CLOUD;
    const STAGE: Stage = Stage::Cloud;
    const NEXT: Option<Stage> = Some(Stage::Tracking);

    fn published(header: &CorrespondenceHeader) -> u64 {
        header.published
    }

    fn read(&mut self, header: &CorrespondenceHeader, payload: &[Block]) -> Result<Window, Dropped> {
        let read = wire::correspondences::read(header, payload, &mut self.correspondences);
        read.map_err(|e| Dropped::new(DropReason::Malformed, e))?;
        self.window = header.window;
        Ok(self.window)
    }

    fn step(&mut self) -> Result<(), Dropped> {
        self.worker.step(&self.correspondences, &mut self.cloud);
        if self.cloud.points.is_empty() {
            return Err(Dropped::new(
                DropReason::EmptyCloud,
                "no correspondence yields a point in front of both cameras",
            ));
        }
        Ok(())
    }

    fn send(&mut self, published: u64, output: &mut Publisher<CloudHeader, [u8]>) -> Result<(), TransportError> {
        let points = &self.cloud.points;
        let (delta_mean_rad, delta_sd_rad) = self.correspondences.matches.chosen_delta_rad;
        let sent = output.try_send_filled(points.len() * RECORD_BYTES, |bytes| {
            encode_records(bytes, points);
            Ok::<_, Infallible>(CloudHeader {
                published,
                window: self.window,
                points: points.len() as u64,
                delta_mean_rad,
                delta_sd_rad,
                published_ns: clock::now_ns(),
                drift: wire::drift::numbers(self.correspondences.drift.as_ref()),
            })
        });
        sent.map(|Ok(())| ())
    }
}
