//! Two threads that make clouds of their own images, relative to one thread. Two independent loops serve as a
//! reference.

use std::hint::black_box;
use std::sync::{Arc, Barrier};

use super::bench::{Bench, PreparedScene, STEPS};
use super::clock::{Spent, interleave, measure as measure_time, median};
use super::line::{Report, Target};
use super::processors;
use super::scenes::Workers;

/// Target: throughput of two threads relative to one. If two loops do not reach their value, the result means nothing.
const TARGET: f64 = 1.7;
const LEAST_FOR_LOOPS: f64 = 1.9;
/// Clouds per repetition, and loop steps that take about as long.
const CLOUDS: usize = 2;
const LOOP_STEPS: u64 = 750_000_000;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let (cpus, easy) = (processors::all(), bench.easy());
    let repetitions = bench.repetitions.min(5);
    let steps = if bench.is_measured { LOOP_STEPS } else { 1000 };
    let name = "two workers ÷ one";
    let [Some(&first), Some(&second)] = [cpus.first(), cpus.get(1)] else {
        return report.skipped(name, "this machine has one processor");
    };
    let easy: &PreparedScene = &easy;
    let clouds = |cpus: &[usize]| run_threads(cpus, || cloud_work(easy));
    let loops = |cpus: &[usize]| run_threads(cpus, || Box::new(move || _ = black_box(count(steps))));
    let spent = interleave(
        repetitions,
        &mut [
            Box::new(|| clouds(&[second])),
            Box::new(|| clouds(&[first, second])),
            Box::new(|| loops(&[second])),
            Box::new(|| loops(&[first, second])),
        ],
    );
    let gains = |one: &[Spent], two: &[Spent]| -> Vec<f64> {
        one.iter().zip(two).map(|(one, two)| 2.0 * one.wall_ns / two.wall_ns).collect()
    };
    let (ours, calibration) = (gains(&spent[0], &spent[1]), gains(&spent[2], &spent[3]));
    let (gain, loops) = (median(ours.iter().copied()), median(calibration));
    if bench.is_measured && loops < LEAST_FOR_LOOPS {
        let why = format!(
            "two independent loops reach only {loops:.2} on this machine now, not {LEAST_FOR_LOOPS}; ours {gain:.2}"
        );
        report.skipped(name, &why);
    } else {
        report.measurement(name, [format!("{gain:.2}"), format!("{loops:.2}")], gain, &ours, Target::AtLeast(TARGET));
    }
}

/// Prepared work of one thread.
type Work<'a> = Box<dyn FnOnce() + 'a>;

/// Runs work in one pinned thread per CPU. Measures the time from when all are ready until all are done.
fn run_threads<'a>(cpus: &[usize], prepare: impl Fn() -> Work<'a> + Sync) -> Spent {
    let (ready, done) = (Barrier::new(cpus.len() + 1), Barrier::new(cpus.len() + 1));
    std::thread::scope(|scope| {
        for &cpu in cpus {
            let (ready, done, prepare) = (&ready, &done, &prepare);
            scope.spawn(move || {
                processors::pin(&[cpu]);
                let work = prepare();
                ready.wait();
                work();
                done.wait();
            });
        }
        ready.wait();
        measure_time(|| _ = done.wait())
    })
}

fn cloud_work<'a>(easy: &'a PreparedScene) -> Work<'a> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    let mut workers = pool.install(|| Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS));
    let levels = easy.images.levels();
    pool.install(|| _ = workers.cloud(0, &levels));
    Box::new(move || {
        pool.install(|| {
            for _ in 0..CLOUDS {
                _ = black_box(workers.cloud(0, &levels));
            }
        });
    })
}

/// A loop that uses no memory.
pub(crate) fn count(steps: u64) -> u64 {
    (0..steps).fold(1, |state, step| black_box(state) ^ step.rotate_left(7))
}
