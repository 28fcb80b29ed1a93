//! The CPUs that a thread may use.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use fringeflow_config::ProcessorsConfiguration;

/// CPUs that this process may not use.
#[derive(Debug, thiserror::Error)]
#[error(
    "key cpus is {wanted:?}, but this process may use CPUs {}; name some of them, or leave the key out",
    format_ranges(usable)
)]
pub struct AffinityError {
    wanted: Vec<usize>,
    usable: Vec<usize>,
}

/// Limits this thread, and the threads that it starts later, to some CPUs.
pub(super) fn limit_to(cpus: &[usize]) -> Result<(), AffinityError> {
    let mut set = CpuSet::new();
    cpus.iter().for_each(|&cpu| set.set(cpu));
    // The system ignores CPUs that do not exist, unless none of the list exists. So the result is compared with the
    // list.
    let is_set = sched_setaffinity(None, &set).is_ok();
    if is_set && allowed() == cpus { Ok(()) } else { Err(AffinityError { wanted: cpus.to_vec(), usable: usable() }) }
}

/// Checks that all services can have the CPUs in their settings.
///
/// # Errors
/// The first service with a CPU that does not exist or may not be used.
pub fn check(settings: &ProcessorsConfiguration) -> Result<(), (&'static str, AffinityError)> {
    let lists = settings.iter().filter_map(|(&service, settings)| Some((service, settings.cpus.as_deref()?)));
    for (service, cpus) in lists {
        // In a thread of its own, so that the calling thread keeps its CPUs.
        let tried = std::thread::scope(|scope| scope.spawn(|| limit_to(cpus)).join());
        // If the thread panics, the list is accepted here: the service tries it again when it starts.
        tried.unwrap_or(Ok(())).map_err(|error| (service, error))?;
    }
    Ok(())
}

/// Returns the CPUs that this thread may use.
fn allowed() -> Vec<usize> {
    let set = sched_getaffinity(None).unwrap_or_else(|_| CpuSet::new());
    (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).collect()
}

/// Returns the CPUs that this thread could be given, and gives them to it.
fn usable() -> Vec<usize> {
    let mut all = CpuSet::new();
    (0..CpuSet::MAX_CPU).for_each(|cpu| all.set(cpu));
    // If the system refuses, the thread keeps its CPUs, and these are returned.
    let _ = sched_setaffinity(None, &all);
    allowed()
}

/// Formats CPUs as ranges, such as `0-3, 6`.
pub(super) fn format_ranges(cpus: &[usize]) -> String {
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

    /// Reads the CPUs of this thread from `/proc`: field `Cpus_allowed_list` of its `status`.
    fn read_allowed_list() -> String {
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap().trim().to_owned()
    }

    #[test]
    fn a_thread_and_those_that_it_starts_are_limited_to_the_cpus() {
        let last = *allowed().last().unwrap();
        std::thread::spawn(move || {
            limit_to(&[last]).unwrap();
            assert_eq!(read_allowed_list(), last.to_string());
            assert_eq!(std::thread::spawn(read_allowed_list).join().unwrap(), last.to_string());
        })
        .join()
        .unwrap();
    }

    #[test]
    fn cpus_that_do_not_exist_are_refused_and_the_caller_keeps_its_own() {
        let before = allowed();
        let settings = |cpus: Vec<usize>| {
            ProcessorsConfiguration::from([(
                "phase",
                ServiceProcessors { cpus: Some(cpus), ..ServiceProcessors::default() },
            )])
        };
        // One missing CPU is enough, even if the others exist.
        for cpus in [vec![CpuSet::MAX_CPU - 1], vec![before[0], CpuSet::MAX_CPU - 1]] {
            let (service, error) = check(&settings(cpus.clone())).unwrap_err();
            let text = error.to_string();
            assert!(
                service == "phase" && text.contains(&format!("key cpus is {cpus:?}, but this process may use CPUs")),
                "{text}"
            );
        }
        check(&settings(before.clone())).unwrap();
        assert_eq!(allowed(), before);
    }

    #[test]
    fn cpus_are_formatted_as_ranges() {
        assert_eq!(format_ranges(&[0, 1, 2, 3, 6, 8, 9]), "0-3, 6, 8-9");
        assert_eq!(format_ranges(&[5]), "5");
    }
}
