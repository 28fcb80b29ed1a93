//! Allocations per window, and growth of memory, after warm-up.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::bench::{Bench, STEPS};
use super::counting_allocator::{allocated, held};
use super::line::{Report, Target};
use super::scenes::Workers;

/// Windows for warm-up, and windows that are measured.
const WARM_UP: usize = 3;
const WINDOWS: usize = 10;
/// Largest growth of memory, megabytes.
const MAX_GROWTH_MB: f64 = 1.0;
/// Minutes of a long run at which the memory is measured.
const MINUTES: [u64; 2] = [1, 10];

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let (easy, windows) = (bench.easy(), if bench.is_measured { WINDOWS } else { 1 });
    let levels = easy.images.levels();
    let mut workers = Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
    (0..WARM_UP).for_each(|_| _ = workers.cloud(0, &levels));
    // Read resident memory first, because that allocates too.
    let (resident, [calls, bytes]) = (resident_mb(), allocated());
    (0..windows).for_each(|_| _ = workers.cloud(0, &levels));
    let ([more_calls, more_bytes], grown_mb) = (allocated(), resident_mb() - resident);
    let [calls, bytes] = [more_calls - calls, more_bytes - bytes].map(|n| n as f64 / windows as f64);
    let name = "allocations a window after warm-up";
    let values = [format!("{:.1} MB", bytes * 1e-6), String::new()];
    report.measurement(name, values, calls, &[], Target::AtMost(0.0));
    let name = format!("growth of memory over {windows} windows, MB");
    report.measurement(&name, [String::new(), String::new()], grown_mb, &[], Target::AtMost(MAX_GROWTH_MB));
    let name = "growth of memory from minute 1 to minute 10, MB";
    if bench.is_long {
        let [grown_mb, held_mb] = growth_mb(|| _ = workers.cloud(0, &levels));
        let values = [format!("{held_mb:.1} MB held"), String::new()];
        report.measurement(name, values, grown_mb, &[], Target::AtMost(MAX_GROWTH_MB));
    } else {
        report.skipped(name, "takes ten minutes: --long");
    }
}

/// Works for ten minutes. Returns the growth from minute 1 to 10, megabytes: of memory in RAM, and of memory that is
/// allocated. The system may turn partly allocated memory into huge pages; then the first grows and the second does
/// not.
fn growth_mb(mut work: impl FnMut()) -> [f64; 2] {
    let start = Instant::now();
    let [first, last] = MINUTES.map(|minutes| {
        while start.elapsed() < Duration::from_secs(60 * minutes) {
            work();
        }
        [resident_mb(), held() as f64 * 1e-6]
    });
    [last[0] - first[0], last[1] - first[1]]
}

/// Memory of this process in RAM, megabytes: field 2 of proc_pid_statm(5).
fn resident_mb() -> f64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: f64 = statm.split_ascii_whitespace().nth(1).unwrap().parse().unwrap();
    pages * rustix::param::page_size() as f64 * 1e-6
}
