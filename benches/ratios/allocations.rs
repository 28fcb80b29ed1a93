//! Allocations of a window, and growth of the memory, once everything is warm.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::bench::{Bench, STEPS};
use super::counting_allocator::{allocated, held};
use super::line::{Report, Wanted};
use super::scenes::Workers;

/// Windows that warm up, and those that are counted.
const WARM_UP: usize = 3;
const WINDOWS: usize = 10;
/// Growth of the memory, megabytes.
const GROWTH_MB: f64 = 1.0;
/// Of a long run: until the first look, and until the second.
const MINUTES: [u64; 2] = [1, 10];

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let (easy, windows) = (bench.easy(), if bench.is_measured { WINDOWS } else { 1 });
    let levels = easy.images.levels();
    let mut workers = Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
    (0..WARM_UP).for_each(|_| _ = workers.cloud(0, &levels));
    // What asks for the memory of this process asks for some too.
    let (resident, [calls, bytes]) = (resident_mb(), allocated());
    (0..windows).for_each(|_| _ = workers.cloud(0, &levels));
    let ([more_calls, more_bytes], grown_mb) = (allocated(), resident_mb() - resident);
    let [calls, bytes] = [more_calls - calls, more_bytes - bytes].map(|n| n as f64 / windows as f64);
    let name = "allocations a window after warm-up";
    let values = [format!("{:.1} MB", bytes * 1e-6), String::new()];
    report.figure(name, values, calls, &[], Wanted::AtMost(0.0));
    let name = format!("growth of memory over {windows} windows, MB");
    report.figure(&name, [String::new(), String::new()], grown_mb, &[], Wanted::AtMost(GROWTH_MB));
    let name = "growth of memory from minute 1 to minute 10, MB";
    if bench.is_long {
        let [grown_mb, held_mb] = growth_mb(|| _ = workers.cloud(0, &levels));
        let values = [format!("{held_mb:.1} MB held"), String::new()];
        report.figure(name, values, grown_mb, &[], Wanted::AtMost(GROWTH_MB));
    } else {
        report.skipped(name, "takes ten minutes: --long");
    }
}

/// Works for ten minutes; by how much the memory in RAM grew since the first, and what the program holds of it. The system may
/// make huge pages of memory that is held in part: then the one grows and the other does not.
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

/// Memory of this process that lies in RAM: field 2 of proc_pid_statm(5).
fn resident_mb() -> f64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: f64 = statm.split_ascii_whitespace().nth(1).unwrap().parse().unwrap();
    pages * rustix::param::page_size() as f64 * 1e-6
}
