//! What the configuration gives a service of the machine: taken by the service itself when it starts, so that one that is
//! started again has it too.
//!
//! CPUs are for the configuration to get right: those that do not exist refuse the start. Priority and locked memory are for
//! the system to grant: where it does not, the service says so and goes on, and `fringeflow status` tells it.

mod affinity;
mod memory;
mod realtime;
mod standing;

use fringeflow_config::{MemoryLock, ProcessorsConfiguration, ServiceProcessors};

pub use affinity::{AffinityError, check};
pub use standing::Standing;

/// Lets this process compute with so many threads, this one among them: what others give to the pool waits for one of them.
///
/// # Errors
/// The threads were started before.
pub fn use_threads(threads: usize) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global()
}

/// Takes what a service is given, for this thread and those that it starts from now on; what came of it, `None` where
/// nothing is said of the service.
///
/// # Errors
/// CPUs that this process may not use.
pub(crate) fn take(
    given: &ProcessorsConfiguration,
    service: &'static str,
) -> Result<Option<Standing>, (&'static str, AffinityError)> {
    let Some(ServiceProcessors { cpus, threads, realtime_priority, lock_memory }) = given.get(service) else {
        return Ok(None);
    };
    let mut standing = Standing::default();
    if let Some(cpus) = cpus {
        affinity::limit_to(cpus).map_err(|error| (service, error))?;
        standing.granted.push(format!("CPUs {}", affinity::ranges(cpus)));
    }
    if let Some(threads) = *threads {
        let built = use_threads(threads);
        let refused = |_| format!("threads = {threads}: --threads on the command line overrides it");
        standing.note(built.map(|()| format!("{threads} threads")).map_err(refused));
    }
    if let Some(priority) = *realtime_priority {
        standing.note(realtime::enter(priority).map(|()| format!("real-time priority {priority}")));
    }
    match lock_memory {
        MemoryLock::Off => {}
        MemoryLock::Used => standing.note(memory::lock(memory::Extent::Used).map(|()| "used memory locked".to_owned())),
        MemoryLock::All => standing.note(memory::lock(memory::Extent::All).map(|()| "all memory locked".to_owned())),
    }
    Ok(Some(standing))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ServiceKind;
    use fringeflow_config::SERVICES;

    #[test]
    fn the_configuration_knows_every_service() {
        assert_eq!(SERVICES, ServiceKind::ALL.map(ServiceKind::name));
    }

    #[test]
    fn a_service_of_which_nothing_is_said_takes_nothing() {
        assert_eq!(take(&ProcessorsConfiguration::new(), "phase").unwrap(), None);
    }
}
