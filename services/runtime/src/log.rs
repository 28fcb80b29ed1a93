//! Log lines of services: one line an event, to standard error.

use std::io::stderr;

use tracing_subscriber::EnvFilter;

/// Environment variable that sets the level, as in `FRINGEFLOW_LOG=debug`.
const LEVEL: &str = "FRINGEFLOW_LOG";

/// Starts logging; a level that cannot be read counts as `info`.
pub fn start() {
    let filter = EnvFilter::try_from_env(LEVEL).unwrap_or_else(|_| EnvFilter::new("info,iceoryx2=error,foxglove=warn"));
    let started = tracing_subscriber::fmt().with_env_filter(filter).with_writer(stderr).with_target(false).try_init();
    // Only the first start in a process counts.
    drop(started);
}
