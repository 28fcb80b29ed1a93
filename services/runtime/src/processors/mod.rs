//! CPUs, threads, priority and locked memory of a service. The service applies them itself when it starts, so they hold
//! after a restart too.
//!
//! CPUs that this process may not use are an error in the configuration, and the service does not start. Priority and
//! locked memory need rights. If the system refuses them, the service runs without them and logs that;
//! `fringeflow status` shows it too.

mod affinity;
mod memory;
mod realtime;
mod resource_grants;

use fringeflow_config::{MemoryLock, ProcessorsConfiguration, ServiceProcessors};

pub use affinity::{AffinityError, check};
pub use resource_grants::ResourceGrants;

/// Sets the number of threads that this process computes with; the calling thread is one of them. Tasks that other
/// threads give to the thread pool wait for one of these threads.
///
/// # Errors
/// The thread pool was already started.
pub fn use_threads(threads: usize) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global()
}

/// Applies the settings of a service to this thread and the threads that it starts later. Returns the granted and
/// refused resources, or `None` if the service has no settings.
///
/// # Errors
/// The settings name CPUs that this process may not use.
pub(crate) fn apply(
    settings: &ProcessorsConfiguration,
    service: &'static str,
) -> Result<Option<ResourceGrants>, (&'static str, AffinityError)> {
    let Some(ServiceProcessors { cpus, threads, realtime_priority, lock_memory }) = settings.get(service) else {
        return Ok(None);
    };
    let mut grants = ResourceGrants::default();
    if let Some(cpus) = cpus {
        affinity::limit_to(cpus).map_err(|error| (service, error))?;
        grants.granted.push(format!("CPUs {}", affinity::format_ranges(cpus)));
    }
    if let Some(threads) = *threads {
        let built = use_threads(threads);
        let refused = |_| format!("threads = {threads}: --threads on the command line overrides it");
        grants.add(built.map(|()| format!("{threads} threads")).map_err(refused));
    }
    if let Some(priority) = *realtime_priority {
        grants.add(realtime::set_priority(priority).map(|()| format!("real-time priority {priority}")));
    }
    match lock_memory {
        MemoryLock::Off => {}
        MemoryLock::Used => grants.add(memory::lock(memory::Extent::Used).map(|()| "used memory locked".to_owned())),
        MemoryLock::All => grants.add(memory::lock(memory::Extent::All).map(|()| "all memory locked".to_owned())),
    }
    Ok(Some(grants))
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
    fn a_service_without_settings_has_no_grants() {
        assert_eq!(apply(&ProcessorsConfiguration::new(), "phase").unwrap(), None);
    }
}
