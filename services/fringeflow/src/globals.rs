//! Options of every command; the services of an instance are started with the same.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use fringeflow_runtime::log::{self, LogFormat};
use fringeflow_runtime::processors::use_threads;
use fringeflow_simd::Level;

use crate::failure::Failure;

/// Options of every command.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Globals {
    /// Number of worker threads. By default all cores work. The results are the same.
    #[arg(long, global = true, value_name = "N", help_heading = HEADING)]
    threads: Option<usize>,
    /// Highest instruction set of the kernels. By default the best of this machine is used. The results are the same.
    #[arg(long, global = true, value_name = "LEVEL", value_parser = level(), help_heading = HEADING)]
    simd: Option<Level>,
    /// Format of log lines. By default the environment variable FRINGEFLOW_LOG_FORMAT sets it, else it is text.
    #[arg(long, global = true, value_name = "FORMAT", help_heading = HEADING)]
    log_format: Option<LogFormat>,
}

/// Heading of the global options in the help.
const HEADING: &str = "Global options";
/// The last line in the help of every subcommand.
const NOTE: &str = "Global options: see `fringeflow --help`";

/// Shows the global options in the help of the whole command alone. Subcommands still take them.
pub(crate) fn shown_once(command: clap::Command) -> clap::Command {
    let globals = command.get_arguments().filter(|argument| argument.is_global_set());
    let hidden: Vec<clap::Arg> = globals.map(|argument| argument.clone().hide(true)).collect();
    // Subcommands of subcommands inherit them as they are here.
    let quiet = |subcommand: clap::Command| subcommand.args(&hidden).after_help(NOTE);
    command.mut_subcommands(|subcommand| quiet(subcommand).mut_subcommands(|inner| inner.after_help(NOTE)))
}

/// Takes the name of an instruction set that this machine has.
fn level() -> impl TypedValueParser<Value = Level> {
    PossibleValuesParser::new(Level::ALL.map(Level::name)).try_map(|name| {
        let available = Level::ALL.into_iter().filter(|level| level.is_available());
        let names: Vec<&str> = available.clone().map(Level::name).collect();
        let named = available.into_iter().find(|level| level.name() == name);
        named.ok_or_else(|| format!("this machine has {}", names.join(", ")))
    })
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
