//! Makes pictures and clouds for the page: only while somebody is ready for them, and not more than the machine has to spare.

use crate::news::{News, Wanted};
use crate::shared::{Shared, View};
use crate::views::{Pictures, cloud_message, model_message};

/// Bytes a second that all pages together are sent: with many, each gets fewer pictures.
const BYTES_PER_S: u64 = 16_000_000;

/// When the next messages are due.
#[derive(Debug, Default)]
pub(crate) struct Viewing {
    due_ns: u64,
    id: u64,
}

impl Viewing {
    /// What pages are ready for now.
    pub(crate) fn wanted(&self, shared: &Shared, now_ns: u64) -> Wanted {
        let is_due = now_ns >= self.due_ns;
        let [pictures, cloud, models] =
            [&shared.pictures, &shared.cloud, &shared.model].map(|view| is_due && view.ready() > 0);
        Wanted { frames: pictures, maps: pictures, clouds: pictures || cloud, patterns: false, models }
    }

    /// Makes what is due of what has come.
    pub(crate) fn turn(&mut self, shared: &Shared, news: &News, size_px: [usize; 2], now_ns: u64, wall_ms: f64) {
        if now_ns < self.due_ns {
            return;
        }
        let [pictures, clouds, models] = [&shared.pictures, &shared.cloud, &shared.model].map(View::ready);
        let mut bytes = 0;
        if pictures > 0 {
            let id = self.next_id();
            let message = self::pictures(news, size_px).message(id, wall_ms);
            bytes += pictures * message.map_or(0, |message| shared.pictures.put_out(id, message));
        }
        if let Some(cloud) = news.cloud.as_ref().filter(|_| clouds > 0) {
            let id = self.next_id();
            let message = cloud_message(cloud.header(), cloud.payload(), id, wall_ms);
            bytes += clouds * message.map_or(0, |message| shared.cloud.put_out(id, message));
        }
        if let Some(model) = news.model.as_ref().filter(|_| models > 0) {
            let id = self.next_id();
            let message = model_message(model.header(), model.payload(), id, wall_ms);
            bytes += models * message.map_or(0, |message| shared.model.put_out(id, message));
        }
        if bytes > 0 {
            self.due_ns = now_ns + bytes as u64 * 1_000_000_000 / BYTES_PER_S;
        }
    }

    fn next_id(&mut self) -> u64 {
        self.id += 1;
        self.id
    }
}

fn pictures(news: &News, size_px: [usize; 2]) -> Pictures {
    let mut pictures = Pictures::default();
    for frame in news.frames.iter().flatten() {
        pictures.add_frame(frame.header(), frame.payload());
    }
    if let Some(maps) = &news.maps {
        pictures.add_maps(maps.header(), maps.payload());
    }
    if let Some(cloud) = &news.cloud {
        pictures.add_depth(cloud.payload(), size_px);
    }
    pictures
}
