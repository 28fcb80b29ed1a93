//! Encodes pictures, clouds and models for the dashboard pages.
//!
//! It encodes only while a page is ready for the next message, and limits the bytes per second to all pages together.

use crate::newest_messages::{NewestMessages, WantedChannels};
use crate::shared::{Shared, View};
use crate::view_messages::{Pictures, cloud_message, model_message};

/// Bytes per second that are sent to all pages together. With many pages, each gets fewer messages.
const BYTES_PER_S: u64 = 16_000_000;

/// Encodes the newest messages when they are due.
#[derive(Debug, Default)]
pub(crate) struct ViewUpdater {
    due_ns: u64,
    id: u64,
}

impl ViewUpdater {
    /// Returns the channels that are needed for the pages that are ready now.
    pub(crate) fn wanted(&self, shared: &Shared, now_ns: u64) -> WantedChannels {
        let is_due = now_ns >= self.due_ns;
        let [pictures, cloud, models] =
            [&shared.pictures, &shared.cloud, &shared.model].map(|view| is_due && view.ready_pages() > 0);
        WantedChannels { frames: pictures, maps: pictures, clouds: pictures || cloud, patterns: false, models }
    }

    /// Encodes and publishes what pages are ready for, if the rate allows it.
    pub(crate) fn update(
        &mut self,
        shared: &Shared,
        newest: &NewestMessages,
        size_px: [usize; 2],
        now_ns: u64,
        wall_ms: f64,
    ) {
        if now_ns < self.due_ns {
            return;
        }
        let [pictures, clouds, models] = [&shared.pictures, &shared.cloud, &shared.model].map(View::ready_pages);
        let mut bytes = 0;
        if pictures > 0 {
            let id = self.next_id();
            let message = collect_pictures(newest, size_px).message(id, wall_ms);
            bytes += pictures * message.map_or(0, |message| shared.pictures.publish(id, message));
        }
        if let Some(cloud) = newest.cloud.as_ref().filter(|_| clouds > 0) {
            let id = self.next_id();
            let message = cloud_message(cloud.header(), cloud.payload(), id, wall_ms);
            bytes += clouds * message.map_or(0, |message| shared.cloud.publish(id, message));
        }
        if let Some(model) = newest.model.as_ref().filter(|_| models > 0) {
            let id = self.next_id();
            let message = model_message(model.header(), model.payload(), id, wall_ms);
            bytes += models * message.map_or(0, |message| shared.model.publish(id, message));
        }
        // The next messages are due when these bytes are sent at the allowed rate.
        if bytes > 0 {
            self.due_ns = now_ns + bytes as u64 * 1_000_000_000 / BYTES_PER_S;
        }
    }

    fn next_id(&mut self) -> u64 {
        self.id += 1;
        self.id
    }
}

fn collect_pictures(newest: &NewestMessages, size_px: [usize; 2]) -> Pictures {
    let mut pictures = Pictures::default();
    for frame in newest.frames.iter().flatten() {
        pictures.add_frame(frame.header(), frame.payload());
    }
    if let Some(maps) = &newest.maps {
        pictures.add_maps(maps.header(), maps.payload());
    }
    if let Some(cloud) = &newest.cloud {
        pictures.add_depth(cloud.payload(), size_px);
    }
    pictures
}
