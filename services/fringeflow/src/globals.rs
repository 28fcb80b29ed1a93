//! Options of every command; the services of an instance are started with the same.

use fringeflow_runtime::log::{self, LogFormat};

use crate::failure::Failure;

/// Options of every command.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Globals {
    /// Number of worker threads; all cores by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// Format of log lines; by default that of the environment variable FRINGEFLOW_LOG_FORMAT, else text.
    #[arg(long, global = true, value_name = "text|json")]
    log_format: Option<LogFormat>,
}

impl Globals {
    /// Sets the number of worker threads of this process.
    pub(crate) fn set_threads(&self) -> Result<(), Failure> {
        let Some(threads) = self.threads else { return Ok(()) };
        if threads == 0 {
            return Err(Failure::Usage("--threads 0: at least one thread is needed".to_owned()));
        }
        let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        built.map_err(|e| Failure::Usage(format!("--threads {threads}: {e}")))
    }

    /// Starts logging in this process, which calls itself so.
    pub(crate) fn start_log(&self, process: &'static str) {
        log::start(process, self.log_format);
    }

    /// As a service is given them.
    pub(crate) fn to_command_line(self) -> Vec<String> {
        let threads = self.threads.map(|n| ["--threads".to_owned(), n.to_string()]);
        let log_format = self.log_format.map(|format| ["--log-format".to_owned(), format.name().to_owned()]);
        threads.into_iter().chain(log_format).flatten().collect()
    }
}
