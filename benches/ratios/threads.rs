//! The chain of a window with 1, 2, 4 … threads: clouds per second, speed-up, and the share of each stage that is
//! serial.
//!
//! Amdahl's law: `T(n) = T(1) · (s + (1 − s) / n)`. The serial share `s` is fitted to the times with several threads,
//! and no number of threads is faster than `1 / s`. Independent loops show what the machine itself gives now: a chain
//! cannot do better; two windows searched at once, as the correspondence service does where it has many threads, come
//! nearer to it than one. Times are wall times for a window, and a ratio compares times of one run.

use std::hint::black_box;
use std::sync::Arc;

use rayon::prelude::*;
use serde_json::json;

use fringeflow_base::grey::GreyLevels;

use super::bench::{Bench, PreparedScene, STEPS};
use super::clock::{measure as measure_time, median};
use super::line::{Report, short};
use super::processors;
use super::scenes::Workers;
use super::sliding::window;
use super::workers::count;

/// Numbers of threads, as far as the machine has processors.
const THREADS: [usize; 5] = [1, 2, 4, 8, 16];
/// What is measured. The stages come first.
const ROWS: [&str; 6] = ["phase", "correspondence", "cloud", "all", "correspondence, two at once", "independent loops"];
const ALL: usize = 3;
/// Number of independent loops, divisible by all numbers of threads, and steps of each.
const LOOPS: usize = 16;
const LOOP_STEPS: u64 = 20_000_000;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let (cpus, easy) = (processors::all(), bench.easy());
    let threads: Vec<usize> = THREADS.into_iter().filter(|&threads| threads <= cpus.len()).collect();
    if threads.len() < 2 {
        return report.skipped("speed-up by threads", "this machine has one processor");
    }
    let loop_steps = if bench.is_measured { LOOP_STEPS } else { 1000 };
    let images = easy.scene.moving_images(STEPS);
    let images = window(&images, 0);
    let mut chains: Vec<Chain> = threads.iter().map(|&threads| Chain::new(&easy, &cpus[..threads])).collect();
    let mut spent_ns = vec![Vec::new(); chains.len()];
    // The first round warms up. All numbers of threads take turns.
    for round in 0..=bench.repetitions {
        for (chain, spent_ns) in chains.iter_mut().zip(&mut spent_ns) {
            let times_ns = chain.run(&images, loop_steps);
            if round > 0 {
                spent_ns.push(times_ns);
            }
        }
    }
    let median_ns = |row: usize| -> Vec<f64> {
        spent_ns.iter().map(|rounds| median(rounds.iter().map(|times_ns| times_ns[row]))).collect()
    };
    let rows: Vec<Row> = (0..ROWS.len()).map(|row| Row::new(ROWS[row], &threads, &median_ns(row))).collect();
    report.note(format_table(&threads, &rows));
    let entry = |row: &Row| json!({"what": row.name, "ms": row.ms, "speed_up": row.speed_ups(), "serial_share": row.serial_share});
    report.data("threads", json!({"threads": threads, "rows": rows.iter().map(entry).collect::<Vec<_>>()}));
}

/// Workers in a pool of threads, and those of a second window.
struct Chain {
    pool: rayon::ThreadPool,
    workers: Workers,
    second: (rayon::ThreadPool, Workers),
}

impl Chain {
    /// Creates workers with one thread for each of these CPUs.
    fn new(easy: &PreparedScene, cpus: &[usize]) -> Self {
        let pool = || {
            let own = cpus.to_vec();
            // Threads inherit the one CPU of this thread, so each takes those of its pool.
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(cpus.len()).start_handler(move |_| processors::pin(&own));
            pool.build().unwrap()
        };
        let workers = || Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
        Self { pool: pool(), workers: workers(), second: (pool(), workers()) }
    }

    /// Makes the cloud of a window, searches two windows at once, and runs the loops. Returns the wall time of each row
    /// for one window, nanoseconds.
    fn run(&mut self, images: &[Vec<GreyLevels<'_>>; 2], loop_steps: u64) -> [f64; ROWS.len()] {
        let Self { pool, workers, second: (second_pool, second_workers) } = self;
        let [phase, correspondence, cloud] = pool.install(|| {
            let phase = measure_time(|| workers.decode(0, images)).wall_ns;
            let correspondence = measure_time(|| workers.search()).wall_ns;
            [phase, correspondence, measure_time(|| _ = black_box(workers.triangulate())).wall_ns]
        });
        second_pool.install(|| second_workers.decode(0, images));
        let two = measure_time(|| {
            std::thread::scope(|scope| {
                scope.spawn(|| second_pool.install(|| second_workers.search()));
                pool.install(|| workers.search());
            });
        });
        let run_loops = || {
            let loops = (0..LOOPS).into_par_iter().with_max_len(1);
            loops.for_each(|_| _ = black_box(count(loop_steps)));
        };
        let loops = pool.install(|| measure_time(run_loops).wall_ns);
        [phase, correspondence, cloud, phase + correspondence + cloud, two.wall_ns / 2.0, loops]
    }
}

/// Times of one row by number of threads.
struct Row {
    name: &'static str,
    ms: Vec<f64>,
    /// Share of the work that one thread does alone.
    serial_share: f64,
}

impl Row {
    /// A row of times with these numbers of threads, the first of which is 1.
    fn new(name: &'static str, threads: &[usize], times_ns: &[f64]) -> Self {
        // T(n) / T(1) − 1/n = s · (1 − 1/n), by least squares.
        let (mut numerator, mut denominator) = (0.0, 0.0);
        for (&threads, time_ns) in threads.iter().zip(times_ns) {
            let parallel = 1.0 / threads as f64;
            numerator += (time_ns / times_ns[0] - parallel) * (1.0 - parallel);
            denominator += (1.0 - parallel) * (1.0 - parallel);
        }
        Self { name, ms: times_ns.iter().map(|ns| ns * 1e-6).collect(), serial_share: numerator / denominator }
    }

    fn speed_ups(&self) -> Vec<f64> {
        self.ms.iter().map(|ms| self.ms[0] / ms).collect()
    }

    /// The speed-up that no number of threads exceeds; none if no serial share shows.
    fn limit(&self) -> String {
        if self.serial_share > 0.0 { short(1.0 / self.serial_share) } else { "none".to_owned() }
    }
}

/// Formats the speed-ups, the clouds per second, and what Amdahl's law says of each row.
fn format_table(threads: &[usize], rows: &[Row]) -> String {
    let cells = |values: &[f64]| values.iter().map(|&value| format!("{:>9}", short(value))).collect::<String>();
    let numbers = cells(&threads.iter().map(|&threads| threads as f64).collect::<Vec<_>>());
    let mut text = format!("{:<28}{numbers}{:>12}{:>9}", "speed-up, by threads", "serial, %", "limit");
    for row in rows {
        let (speed_ups, serial) = (cells(&row.speed_ups()), short(100.0 * row.serial_share));
        text += &format!("\n{:<28}{speed_ups}{serial:>12}{:>9}", row.name, row.limit());
    }
    let clouds_hz: Vec<f64> = rows[ALL].ms.iter().map(|ms| 1000.0 / ms).collect();
    text + &format!("\n{:<28}{}", "clouds per second", cells(&clouds_hz))
}
