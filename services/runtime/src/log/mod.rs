//! Log lines: one line an event, to standard error, as text or as JSON.
//!
//! Levels are meant for readers. `error`: a person has to do something. `warn`: something was lost, or was survived that
//! should not happen. `info`: what begins and ends. `debug`: what helps to find a fault. `trace`: each item of each stage.
//! `FRINGEFLOW_LOG` chooses, as in `FRINGEFLOW_LOG=debug`. A message that comes again within ten seconds is counted instead, and
//! the next line with it states the number. Only `trace` writes all.

mod line;
mod lines;
mod output;
mod repeats;

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;

use lines::Lines;
use output::Output;

pub use output::{Diversion, divert, pass_on};

/// Environment variable that sets the level, as in `FRINGEFLOW_LOG=debug`.
const LEVEL: &str = "FRINGEFLOW_LOG";
/// Environment variable that sets the format where the command line does not.
const FORMAT: &str = "FRINGEFLOW_LOG_FORMAT";

/// How log lines are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Lines for people: time, level, message, fields.
    #[default]
    Text,
    /// Lines for programs: one JSON object each, with time, level, process, message, fields, and repeated, the number of lines
    /// left out before.
    Json,
}

impl LogFormat {
    /// Its name on the command line and in the environment.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Json => "json",
        }
    }
}

/// Starts logging in a process that calls itself so; without a format, that of the environment is used. A level that cannot
/// be read counts as `info`.
pub fn start(process: &'static str, format: Option<LogFormat>) {
    let asked = std::env::var(FORMAT).ok();
    let known = asked.as_deref().and_then(|name| LogFormat::from_str(name, true).ok());
    let format = format.or(known).unwrap_or_default();
    let filter = EnvFilter::try_from_env(LEVEL).unwrap_or_else(|_| EnvFilter::new("info,iceoryx2=error,foxglove=warn"));
    let subscriber = tracing_subscriber::fmt().with_env_filter(filter).with_writer(|| Output);
    // A log that cannot be written must not end the process, as telling so on standard error would.
    let subscriber = subscriber.log_internal_errors(false).event_format(Lines::new(format, process));
    // Only the first start in a process counts.
    let is_first = subscriber.try_init().is_ok();
    if let Some(asked) = asked.filter(|_| is_first && known.is_none()) {
        tracing::warn!("{FORMAT}={asked} is not a format; use text or json");
    }
}
