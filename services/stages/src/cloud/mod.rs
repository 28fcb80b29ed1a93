//! The cloud service: correspondences in, clouds out.

use std::sync::Arc;

use fringeflow::cloud::{Cloud, RECORD_BYTES};
use fringeflow::worker::CloudWorker;
use fringeflow_message::{Block, CloudHeader, CorrespondenceHeader, DropReason, Stage, Window};
use fringeflow_runtime::{Dropped, Host, ServiceArgs, ServiceError, Transform, clock, run_transform};
use fringeflow_transport::{CLOUD, CORRESPONDENCE_MAP, Channel, Publisher, Received, TransportError};
use fringeflow_wire as wire;

use crate::warm_up::WarmUp;

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "cloud")?;
    let table = Arc::new(arguments.segment_table(&host.configuration, &host.setup)?);
    let worker = CloudWorker::new(&host.setup.rig, Arc::clone(&table));
    let mut worker = worker.map_err(|e| ServiceError::Unusable(e.to_string()))?;
    if let Some(warm_up) = WarmUp::of(&host) {
        warm_up.triangulate(&table, &mut worker, &mut Cloud::default())?;
    }
    run_transform(&mut host, CloudStage { worker, correspondences: None })
}

/// The points are computed where they are sent: in the memory of the channel.
struct CloudStage {
    worker: CloudWorker,
    /// The message that the next cloud is made of, and its number of matches.
    correspondences: Option<(Received<CorrespondenceHeader, [Block]>, usize)>,
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

    fn window(header: &CorrespondenceHeader) -> Window {
        header.window
    }

    fn begin(&mut self, message: Received<CorrespondenceHeader, [Block]>) -> Result<(), Dropped> {
        let input = wire::correspondences::view(message.header(), message.payload());
        let matches = self.worker.count_matches(&input.map_err(|e| Dropped::new(DropReason::Malformed, e))?);
        if matches == 0 {
            return Err(Dropped::new(DropReason::EmptyCloud, "no pixel of camera 1 has a correspondence"));
        }
        self.correspondences = Some((message, matches));
        Ok(())
    }

    fn send(&mut self, published: u64, output: &mut Publisher<CloudHeader, [u8]>) -> Result<(), TransportError> {
        let Some((message, matches)) = self.correspondences.take() else { return Ok(()) };
        let found = message.header();
        let Ok(input) = wire::correspondences::view(found, message.payload()) else { return Ok(()) };
        let header = |points: usize| CloudHeader {
            published,
            window: found.window,
            points: points as u64,
            delta_mean_rad: found.chosen_delta_mean_rad,
            delta_sd_rad: found.chosen_delta_sd_rad,
            published_ns: clock::now_ns(),
            drift: found.drift,
        };
        let sent = output.try_send_filled(matches * RECORD_BYTES, |bytes| {
            let points = self.worker.write(&input, bytes.as_chunks_mut().0);
            // A message holds no room for the matches whose rays do not intersect. There are hardly ever any.
            if points == matches { Ok(header(points)) } else { Err(bytes[..points * RECORD_BYTES].to_vec()) }
        });
        match sent? {
            Ok(()) => Ok(()),
            Err(records) => output.send(&header(records.len() / RECORD_BYTES), &records),
        }
    }
}
