//! CPU and wall time of work, and interleaved repetitions.

use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};

/// Time of some work, nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spent {
    pub(crate) cpu_ns: f64,
    pub(crate) wall_ns: f64,
}

/// Work to measure: each call runs it once and returns its time.
pub(crate) type Contender<'a> = Box<dyn FnMut() -> Spent + 'a>;

/// Runs work and measures it. CPU time includes all threads of this program.
pub(crate) fn measure(work: impl FnOnce()) -> Spent {
    let (cpu_ns, wall) = (cpu_ns(), Instant::now());
    work();
    let wall_ns = wall.elapsed().as_nanos() as f64;
    Spent { cpu_ns: self::cpu_ns() - cpu_ns, wall_ns }
}

/// Makes a contender of work in this program.
pub(crate) fn contender<'a>(mut work: impl FnMut() + 'a) -> Contender<'a> {
    Box::new(move || measure(&mut work))
}

/// Runs each contender once to warm up, then all of them in turn, `repetitions` times. Returns the times by contender.
pub(crate) fn interleave(repetitions: usize, contenders: &mut [Contender<'_>]) -> Vec<Vec<Spent>> {
    contenders.iter_mut().for_each(|run| _ = run());
    let mut all = vec![Vec::with_capacity(repetitions); contenders.len()];
    for _ in 0..repetitions {
        for (times, run) in all.iter_mut().zip(&mut *contenders) {
            times.push(run());
        }
    }
    all
}

fn cpu_ns() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// The median; the upper one of two middle values. NaN without values.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
