//! Destination of log lines: standard error, or a redirection, as for a progress display on the same terminal.

use std::io::{self, Write, stderr};
use std::sync::{PoisonError, RwLock};

/// Receives a line with its line end.
type LineSink = Box<dyn Fn(&[u8]) -> io::Result<()> + Send + Sync>;

static REDIRECTED: RwLock<Option<LineSink>> = RwLock::new(None);

/// Redirects log lines until it is dropped.
#[derive(Debug)]
#[must_use = "the redirection ends when this is dropped"]
pub struct Redirection(());

/// Redirects the log lines of this process, and those that it forwards, to `sink`.
pub fn redirect(sink: impl Fn(&[u8]) -> io::Result<()> + Send + Sync + 'static) -> Redirection {
    set_sink(Some(Box::new(sink)));
    Redirection(())
}

/// Writes a log line of another process; the line includes its line end.
pub fn forward_line(line: &[u8]) {
    // The error is ignored: the log is the place to report it.
    let _ = Output.write_all(line);
}

impl Drop for Redirection {
    fn drop(&mut self) {
        set_sink(None);
    }
}

fn set_sink(sink: Option<LineSink>) {
    *REDIRECTED.write().unwrap_or_else(PoisonError::into_inner) = sink;
}

/// Writes whole lines to the present destination.
pub(super) struct Output;

impl Write for Output {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        match &*REDIRECTED.read().unwrap_or_else(PoisonError::into_inner) {
            Some(sink) => sink(line)?,
            None => stderr().write_all(line)?,
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
