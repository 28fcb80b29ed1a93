//! Log lines: one line per event, to standard error, as text or as JSON.
//!
//! The levels: `error`: a person has to act. `warn`: something was lost, or a fault was handled. `info`: starts and
//! ends. `debug`: details for finding a fault. `trace`: each item of each stage. `FRINGEFLOW_LOG` sets the level, as in
//! `FRINGEFLOW_LOG=debug`. An event that repeats within ten seconds is left out, and its next line states how often.
//! Events of level `trace` are never left out.
//!
//! When a span ends, a line tells how long it was busy and idle. A line within a span has the fields of the span.

mod event_content;
mod format;
mod formatter;
mod output;
mod repeats;
mod span_fields;

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::FmtSpan;

use formatter::LineFormatter;
use output::Output;
use span_fields::SpanFields;

pub use format::LogFormat;
pub use output::{Redirection, forward_line, redirect};

/// Environment variable that sets the level.
const LEVEL_VARIABLE: &str = "FRINGEFLOW_LOG";
/// Environment variable that sets the format if the command line does not.
const FORMAT_VARIABLE: &str = "FRINGEFLOW_LOG_FORMAT";

/// Starts the log of this process, whose name appears in JSON lines. The default format is that of the environment. An
/// invalid level counts as `info`.
pub fn start(process: &'static str, format: Option<LogFormat>) {
    let asked = std::env::var(FORMAT_VARIABLE).ok();
    let known = asked.as_deref().and_then(|name| LogFormat::from_str(name, true).ok());
    let format = format.or(known).unwrap_or_default();
    let filter =
        EnvFilter::try_from_env(LEVEL_VARIABLE).unwrap_or_else(|_| EnvFilter::new("info,iceoryx2=error,foxglove=warn"));
    let subscriber = tracing_subscriber::fmt().with_env_filter(filter).with_writer(|| Output);
    let subscriber = subscriber.fmt_fields(SpanFields).with_span_events(FmtSpan::CLOSE);
    // A log that cannot be written must not end the process, as reporting that on standard error would.
    let subscriber = subscriber.log_internal_errors(false).event_format(LineFormatter::new(format, process));
    // Only the first call in a process takes effect.
    let is_first = subscriber.try_init().is_ok();
    if let Some(asked) = asked.filter(|_| is_first && known.is_none()) {
        tracing::warn!("{FORMAT_VARIABLE}={asked} is not a log format; use text or json");
    }
}
