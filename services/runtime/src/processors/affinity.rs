//! On which CPUs a thread may run.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use fringeflow_config::ProcessorsConfiguration;

/// CPUs that this process may not use.
#[derive(Debug, thiserror::Error)]
#[error(
    "key cpus is {wanted:?}, but this process may use CPUs {}; name some of them, or leave the key out",
    ranges(usable)
)]
pub struct AffinityError {
    wanted: Vec<usize>,
    usable: Vec<usize>,
}

/// Keeps this thread, and those that it starts from now on, on some CPUs.
pub(super) fn limit_to(cpus: &[usize]) -> Result<(), AffinityError> {
    let mut set = CpuSet::new();
    cpus.iter().for_each(|&cpu| set.set(cpu));
    // The system takes what is there of a list, and refuses one of which nothing is.
    let taken = sched_setaffinity(None, &set).is_ok();
    if taken && allowed() == cpus { Ok(()) } else { Err(AffinityError { wanted: cpus.to_vec(), usable: usable() }) }
}

/// Whether all services can have the CPUs that they are given.
///
/// # Errors
/// The first of whom one does not exist or may not be used.
pub fn check(given: &ProcessorsConfiguration) -> Result<(), (&'static str, AffinityError)> {
    let lists = given.iter().filter_map(|(&service, given)| Some((service, given.cpus.as_deref()?)));
    for (service, cpus) in lists {
        // In a thread of its own, which alone is limited.
        let tried = std::thread::scope(|scope| scope.spawn(|| limit_to(cpus)).join());
        // A thread that cannot even try says nothing against the list; the service will.
        tried.unwrap_or(Ok(())).map_err(|error| (service, error))?;
    }
    Ok(())
}

/// The CPUs that this thread may run on.
fn allowed() -> Vec<usize> {
    let set = sched_getaffinity(None).unwrap_or_else(|_| CpuSet::new());
    (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).collect()
}

/// The CPUs that this thread could be given; it is given them.
fn usable() -> Vec<usize> {
    let mut all = CpuSet::new();
    (0..CpuSet::MAX_CPU).for_each(|cpu| all.set(cpu));
    // Where it is refused, those that it has are told.
    let _ = sched_setaffinity(None, &all);
    allowed()
}

/// CPUs as people write them: `0-3, 6`.
pub(super) fn ranges(cpus: &[usize]) -> String {
    let runs = cpus.chunk_by(|before, next| before + 1 == *next);
    let text = |run: &[usize]| match run {
        [first, .., last] => format!("{first}-{last}"),
        _ => run.iter().map(usize::to_string).collect(),
    };
    runs.map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_config::ServiceProcessors;

    /// The CPUs of a thread as the system tells them: field `Cpus_allowed_list` of its `status`.
    fn told_by_the_system() -> String {
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap().trim().to_owned()
    }

    #[test]
    fn a_thread_and_those_it_starts_are_kept_on_their_cpus() {
        let last = *allowed().last().unwrap();
        std::thread::spawn(move || {
            limit_to(&[last]).unwrap();
            assert_eq!(told_by_the_system(), last.to_string());
            assert_eq!(std::thread::spawn(told_by_the_system).join().unwrap(), last.to_string());
        })
        .join()
        .unwrap();
    }

    #[test]
    fn cpus_that_do_not_exist_are_refused_and_the_caller_keeps_its_own() {
        let before = allowed();
        let given = |cpus: Vec<usize>| {
            ProcessorsConfiguration::from([(
                "phase",
                ServiceProcessors { cpus: Some(cpus), ..ServiceProcessors::default() },
            )])
        };
        // One that exists does not excuse one that does not.
        for cpus in [vec![CpuSet::MAX_CPU - 1], vec![before[0], CpuSet::MAX_CPU - 1]] {
            let (service, error) = check(&given(cpus.clone())).unwrap_err();
            let text = error.to_string();
            assert!(
                service == "phase" && text.contains(&format!("key cpus is {cpus:?}, but this process may use CPUs")),
                "{text}"
            );
        }
        check(&given(before.clone())).unwrap();
        assert_eq!(allowed(), before);
    }

    #[test]
    fn cpus_are_told_as_ranges() {
        assert_eq!(ranges(&[0, 1, 2, 3, 6, 8, 9]), "0-3, 6, 8-9");
        assert_eq!(ranges(&[5]), "5");
    }
}
