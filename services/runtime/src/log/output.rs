//! Where log lines go: standard error, or whoever draws on its terminal.

use std::io::{self, Write, stderr};
use std::sync::{PoisonError, RwLock};

/// Takes a line with its end.
type Taker = Box<dyn Fn(&[u8]) -> io::Result<()> + Send + Sync>;

static DIVERTED: RwLock<Option<Taker>> = RwLock::new(None);

/// Lines go elsewhere until it is dropped.
#[derive(Debug)]
#[must_use = "lines go elsewhere until it is dropped"]
pub struct Diversion(());

/// Gives the lines of this process, and those that it passes on, to someone else.
pub fn divert(to: impl Fn(&[u8]) -> io::Result<()> + Send + Sync + 'static) -> Diversion {
    set(Some(Box::new(to)));
    Diversion(())
}

/// Passes a line of another process on, with its end.
pub fn pass_on(line: &[u8]) {
    // Nobody could be told.
    let _ = Output.write_all(line);
}

impl Drop for Diversion {
    fn drop(&mut self) {
        set(None);
    }
}

fn set(taker: Option<Taker>) {
    *DIVERTED.write().unwrap_or_else(PoisonError::into_inner) = taker;
}

/// Writes whole lines.
pub(super) struct Output;

impl Write for Output {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        match &*DIVERTED.read().unwrap_or_else(PoisonError::into_inner) {
            Some(taker) => taker(line)?,
            None => stderr().write_all(line)?,
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
