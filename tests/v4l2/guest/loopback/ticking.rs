//! Writes images to a device at a steady rate, in a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::writer::Writer;

/// Images that a device is to show in turn, the first already shown: readers find a camera only then.
pub(crate) struct Shown {
    writer: Writer,
    images: Vec<Vec<u8>>,
}

/// Writes images in turn until it is stopped.
pub(crate) struct Ticking {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<u64>,
}

impl Shown {
    /// Opens a device and shows the first image.
    pub(crate) fn new(device: &str, size_px: [u32; 2], format: [u8; 4], images: Vec<Vec<u8>>) -> Self {
        let mut writer = Writer::open(device, size_px, &format);
        writer.show(&images[0]);
        Self { writer, images }
    }

    /// Writes the next images, each `period` after the one before, as if the first had been written at `start`.
    pub(crate) fn tick(self, start: Instant, period: Duration) -> Ticking {
        let Self { mut writer, images } = self;
        let is_over = Arc::new(AtomicBool::new(false));
        let of_thread = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut written = 1_u64;
            while !of_thread.load(Ordering::Relaxed) {
                // From the start, so that delays do not add up.
                let due = start + Duration::from_nanos(period.as_nanos() as u64 * written);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                writer.show(&images[written as usize % images.len()]);
                written += 1;
            }
            written
        });
        Ticking { is_over, thread }
    }
}

impl Ticking {
    /// Ends writing. Returns the number of images that were written.
    pub(crate) fn stop(self) -> u64 {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}
