//! When a service is to end: a signal, or the supervisor gone.

use std::io::{Read, stdin};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2};

/// Tells whether the service is to end; cheap to ask.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Listens to SIGINT and SIGTERM. SIGUSR1 and SIGUSR2, which would end the process, interrupt its waits and no more.
    ///
    /// # Errors
    /// The system refuses a handler.
    pub fn on_signals() -> std::io::Result<Self> {
        let stop = Self::default();
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&stop.0))?;
        }
        for signal in [SIGUSR1, SIGUSR2] {
            signal_hook::flag::register(signal, Arc::default())?;
        }
        Ok(stop)
    }

    /// Listens to the end of standard input too: a supervisor holds the other end of the pipe, and closes it to stop the
    /// service, or by dying.
    pub fn also_when_input_ends(&self) {
        let stop = self.clone();
        std::thread::spawn(move || {
            let mut ignored = [0; 64];
            while matches!(stdin().read(&mut ignored), Ok(1..)) {}
            stop.request();
        });
    }

    /// Asks for the end.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end was asked for.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
