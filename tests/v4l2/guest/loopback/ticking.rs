//! Writes images to a device at a steady rate, in a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::writer::Writer;

/// Writes images in turn until it is stopped.
pub(crate) struct TickingWriter {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<u64>,
}

impl TickingWriter {
    /// Opens a device and begins to write.
    pub(crate) fn start(
        device: &str,
        size_px: [u32; 2],
        format: [u8; 4],
        images: Vec<Vec<u8>>,
        period: Duration,
    ) -> Self {
        let mut writer = Writer::open(device, size_px, &format);
        // Readers find a camera only after its first image.
        writer.show(&images[0]);
        let is_over = Arc::new(AtomicBool::new(false));
        let of_thread = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let (start, mut written) = (Instant::now(), 1_u64);
            while !of_thread.load(Ordering::Relaxed) {
                // From the start, so that delays do not add up.
                let due = start + Duration::from_nanos(period.as_nanos() as u64 * written);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                writer.show(&images[written as usize % images.len()]);
                written += 1;
            }
            written
        });
        Self { is_over, thread }
    }

    /// Ends writing. Returns the number of images that were written.
    pub(crate) fn stop(self) -> u64 {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}
