//! Global options. The services of an instance are started with the same ones.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use fringeflow_runtime::log::{self, LogFormat};
use fringeflow_runtime::processors::use_threads;
use fringeflow_simd::Level;

use crate::failure::Failure;

/// Options of several subcommands.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Globals {
    /// Number of worker threads of the commands that compute. The default is one per core. The results do not depend
    /// on it.
    #[arg(long, global = true, value_name = "N", help_heading = HEADING)]
    threads: Option<usize>,
    /// Highest instruction set for the kernels. The default is the best of this machine. The results do not depend on
    /// it.
    #[arg(long, global = true, value_name = "LEVEL", value_parser = level(), help_heading = HEADING)]
    simd: Option<Level>,
    /// Format of log lines of run, demo, replay and service. The default is the environment variable FRINGEFLOW_LOG_FORMAT, else text.
    #[arg(long, global = true, value_name = "FORMAT", help_heading = HEADING)]
    log_format: Option<LogFormat>,
}

/// Heading of the global options in the help.
const HEADING: &str = "Global options";
/// Last line of the help of every subcommand.
const NOTE: &str = "Global options: see `fringeflow --help`";

/// Hides the global options in the help of the subcommands, which still accept them.
pub(crate) fn hide_in_subcommands(command: clap::Command) -> clap::Command {
    let globals = command.get_arguments().filter(|argument| argument.is_global_set());
    let hidden: Vec<clap::Arg> = globals.map(|argument| argument.clone().hide(true)).collect();
    // Nested subcommands inherit the hidden options.
    let hide = |subcommand: clap::Command| subcommand.args(&hidden).after_help(NOTE);
    command.mut_subcommands(|subcommand| hide(subcommand).mut_subcommands(|nested| nested.after_help(NOTE)))
}

/// Parses the name of an instruction set; refuses one that this machine lacks.
fn level() -> impl TypedValueParser<Value = Level> {
    PossibleValuesParser::new(Level::ALL.map(Level::name)).try_map(|name| {
        let available = Level::ALL.into_iter().filter(|level| level.is_available());
        let names: Vec<&str> = available.clone().map(Level::name).collect();
        let named = available.into_iter().find(|level| level.name() == name);
        named.ok_or_else(|| format!("this machine has {}", names.join(", ")))
    })
}

impl Globals {
    /// Sets the number of worker threads and the instruction set of the kernels in this process.
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

    /// Starts logging in this process. The log lines carry the name `process`.
    pub(crate) fn start_log(&self, process: &'static str) {
        log::start(process, self.log_format);
    }

    /// The options as arguments for a service.
    pub(crate) fn to_command_line(self) -> Vec<String> {
        let threads = self.threads.map(|n| ["--threads".to_owned(), n.to_string()]);
        let log_format = self.log_format.map(|format| ["--log-format".to_owned(), format.name().to_owned()]);
        let simd = self.simd.map(|level| ["--simd".to_owned(), level.name().to_owned()]);
        threads.into_iter().chain(simd).chain(log_format).flatten().collect()
    }
}
