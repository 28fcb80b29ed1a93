//! CPU and wall time of work, and repetitions that take turns.

use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};

/// What some work took, nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spent {
    pub(crate) cpu_ns: f64,
    pub(crate) wall_ns: f64,
}

/// Something that is measured, once a call.
pub(crate) type Contender<'a> = Box<dyn FnMut() -> Spent + 'a>;

/// Runs work of this program; the CPU time is that of all its threads.
pub(crate) fn spent(work: impl FnOnce()) -> Spent {
    let (cpu_ns, wall) = (cpu_ns(), Instant::now());
    work();
    let wall_ns = wall.elapsed().as_nanos() as f64;
    Spent { cpu_ns: self::cpu_ns() - cpu_ns, wall_ns }
}

/// Work of this program as a contender.
pub(crate) fn contender<'a>(mut work: impl FnMut() + 'a) -> Contender<'a> {
    Box::new(move || spent(&mut work))
}

/// Runs every contender once to warm up, then all of them in turn, so often; what each took, by contender.
pub(crate) fn interleave(repetitions: usize, contenders: &mut [Contender<'_>]) -> Vec<Vec<Spent>> {
    contenders.iter_mut().for_each(|run| _ = run());
    let mut all = vec![Vec::with_capacity(repetitions); contenders.len()];
    for _ in 0..repetitions {
        for (taken, run) in all.iter_mut().zip(&mut *contenders) {
            taken.push(run());
        }
    }
    all
}

fn cpu_ns() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// The middle one.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
