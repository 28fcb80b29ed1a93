//! Requests to stop a service: by a signal, or because the supervisor has ended.

use std::io::{Read, stdin};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2};

/// A request to stop, shared by all clones. Reading it is cheap.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Creates a request that SIGINT and SIGTERM set. SIGUSR1 and SIGUSR2, which end a process by default, only
    /// interrupt its waits.
    ///
    /// # Errors
    /// The system refuses a signal handler.
    pub fn from_signals() -> std::io::Result<Self> {
        let stop = Self::default();
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&stop.0))?;
        }
        for signal in [SIGUSR1, SIGUSR2] {
            signal_hook::flag::register(signal, Arc::default())?;
        }
        Ok(stop)
    }

    /// Requests the stop at the end of standard input too. The supervisor holds the other end of the pipe, and closes
    /// it to stop the service, or by dying.
    pub fn watch_stdin(&self) {
        let stop = self.clone();
        std::thread::spawn(move || {
            let mut ignored = [0; 64];
            while matches!(stdin().read(&mut ignored), Ok(1..)) {}
            stop.request();
        });
    }

    /// Requests the stop.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the stop was requested.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
