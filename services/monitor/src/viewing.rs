//! Makes pictures and clouds for the page: only while somebody is ready for them, and not more than the machine has to spare.

use fringeflow_runtime::Host;

use crate::shared::Shared;
use crate::taps::Taps;
use crate::views::{Pictures, cloud_message};

/// Shortest time from one message to the next, nanoseconds.
const SHORTEST_NS: u64 = 200_000_000;
/// Bytes a second that all pages together are sent: with many, each gets fewer pictures.
const BYTES_PER_S: u64 = 16_000_000;

/// When the next messages are due.
#[derive(Debug, Default)]
pub(crate) struct Viewing {
    due_ns: u64,
    id: u64,
}

impl Viewing {
    /// Makes what is due.
    pub(crate) fn turn(&mut self, host: &Host, shared: &Shared, taps: &mut Taps, now_ns: u64, wall_ms: f64) {
        let (pictures, clouds) = (shared.pictures.ready(), shared.cloud.ready());
        if now_ns < self.due_ns || pictures + clouds == 0 {
            return;
        }
        let mut bytes = 0;
        let cloud = taps.clouds.newest(host, now_ns);
        if pictures > 0 {
            let mut made = Pictures::default();
            for camera in &mut taps.cameras {
                if let Some(frame) = camera.newest(host, now_ns) {
                    made.add_frame(frame.header(), frame.payload());
                }
            }
            if let Some(maps) = taps.maps.newest(host, now_ns) {
                made.add_maps(maps.header(), maps.payload());
            }
            if let Some(cloud) = &cloud {
                made.add_depth(cloud.payload(), host.setup.image_size_px);
            }
            let id = self.next_id();
            let message = made.message(id, wall_ms);
            bytes += pictures * message.map_or(0, |message| shared.pictures.put_out(id, message));
        }
        if let Some(cloud) = cloud.filter(|_| clouds > 0) {
            let id = self.next_id();
            let message = cloud_message(cloud.header(), cloud.payload(), id, wall_ms);
            bytes += clouds * message.map_or(0, |message| shared.cloud.put_out(id, message));
        }
        self.due_ns = now_ns + SHORTEST_NS.max(bytes as u64 * 1_000_000_000 / BYTES_PER_S);
    }

    fn next_id(&mut self) -> u64 {
        self.id += 1;
        self.id
    }
}
