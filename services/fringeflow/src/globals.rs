//! Options of every command; the services of an instance are started with the same.

use fringeflow_runtime::log::{self, LogFormat};
use fringeflow_runtime::processors::use_threads;
use fringeflow_simd::Level;

use crate::failure::Failure;

/// Options of every command.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Globals {
    /// Number of worker threads; all cores by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// Highest instruction set of the kernels: portable, avx2 or avx512; by default the best of this machine. Results do not
    /// depend on it.
    #[arg(long, global = true, value_name = "LEVEL", value_parser = level)]
    simd: Option<Level>,
    /// Format of log lines; by default that of the environment variable FRINGEFLOW_LOG_FORMAT, else text.
    #[arg(long, global = true, value_name = "text|json")]
    log_format: Option<LogFormat>,
}

/// The instruction set of a name, if this machine has it.
fn level(name: &str) -> Result<Level, String> {
    let available = Level::ALL.into_iter().filter(|level| level.is_available());
    let names: Vec<&str> = available.clone().map(Level::name).collect();
    available
        .into_iter()
        .find(|level| level.name() == name)
        .ok_or_else(|| format!("this machine has {}", names.join(", ")))
}

impl Globals {
    /// Sets what kernels run on in this process: the number of worker threads, and the instruction set.
    pub(crate) fn set_up_kernels(&self) -> Result<(), Failure> {
        if let Some(level) = self.simd {
            level.limit_to();
        }
        let Some(threads) = self.threads else { return Ok(()) };
        if threads == 0 {
            return Err(Failure::Usage("--threads 0: at least one thread is needed".to_owned()));
        }
        use_threads(threads).map_err(|e| Failure::Usage(format!("--threads {threads}: {e}")))
    }

    /// Starts logging in this process, which calls itself so.
    pub(crate) fn start_log(&self, process: &'static str) {
        log::start(process, self.log_format);
    }

    /// As a service is given them.
    pub(crate) fn to_command_line(self) -> Vec<String> {
        let threads = self.threads.map(|n| ["--threads".to_owned(), n.to_string()]);
        let log_format = self.log_format.map(|format| ["--log-format".to_owned(), format.name().to_owned()]);
        let simd = self.simd.map(|level| ["--simd".to_owned(), level.name().to_owned()]);
        threads.into_iter().chain(simd).chain(log_format).flatten().collect()
    }
}
