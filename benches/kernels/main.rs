//! Time of each kernel, and of the whole chain from images to cloud: `cargo bench --bench kernels [-- NAME]`.
//!
//! 1280 × 1024 pixels, one thread. For ratios and comparisons with other libraries see `cargo bench --bench ratios`.

// A program for people.
#![allow(clippy::unwrap_used, clippy::print_stderr, clippy::print_stdout)]

mod correspondence;
mod phase;
mod pipeline;
#[path = "../scenes/mod.rs"]
#[allow(dead_code, reason = "shared with another bench")]
mod scenes;

use std::time::Duration;

use criterion::Criterion;

use scenes::{FULL_PX, SMALL_PX};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    // `cargo test` runs benches without `--bench`, only to check that they run.
    let is_measured = std::env::args().any(|argument| argument == "--bench");
    let size_px = if is_measured { FULL_PX } else { SMALL_PX };
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    phase::benches(&mut criterion, size_px);
    correspondence::benches(&mut criterion, size_px);
    pipeline::benches(&mut criterion, size_px);
    criterion.final_summary();
}
