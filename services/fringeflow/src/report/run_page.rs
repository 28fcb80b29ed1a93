//! The page that a live run leaves behind.

use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use fringeflow_base::atomic_file::{WriteError, WriteProblem, write_atomically, write_new};
use fringeflow_supervisor::{Outcome, Plan, named_by_time};

use crate::output_folder;

use super::{About, RunFigures, write_html};

/// Most pages that begin in the same second.
const SAME_NAMES: u32 = 100;

/// A run that has ended.
pub(crate) struct RunPage<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) outcome: &'a Outcome,
}

impl RunPage<'_> {
    /// Writes the page to a file, or else under a name of its own into the folder of the recordings; its path. A page that
    /// cannot be written takes nothing from the run: it is told, and that is all.
    pub(crate) fn write(&self, file: Option<&Path>) -> Option<PathBuf> {
        let figures = self.figures();
        let written = match file {
            Some(file) => write_atomically(file, |out| write_html(out, &figures)).map(|()| file.to_owned()),
            None => self.write_named_by_time(&figures),
        };
        written.inspect_err(|error| tracing::warn!("no report on the run: {error}")).ok()
    }

    fn figures(&self) -> RunFigures<'_> {
        let Self { plan, outcome } = self;
        let about = About {
            instance: Some(&plan.configuration.name),
            version: env!("CARGO_PKG_VERSION"),
            origin: outcome.origin.clone(),
            image_size_px: plan.setup.image_size_px,
            steps: plan.setup.steps,
            recording: outcome.recording.as_deref(),
            is_recorded: false,
        };
        RunFigures::of(about, &outcome.balance.0, &outcome.run)
    }

    fn write_named_by_time(&self, figures: &RunFigures<'_>) -> Result<PathBuf, WriteError> {
        let folder = &self.plan.configuration.recorder.folder;
        output_folder::prepare(folder)?;
        let start = UNIX_EPOCH + Duration::from_nanos(self.outcome.origin.started_unix_ns);
        let path = named_by_time(folder, &self.plan.configuration.name, start, "html");
        let names = (2..SAME_NAMES).map(|number| path.with_extension(format!("{number}.html")));
        for path in std::iter::once(path.clone()).chain(names) {
            match write_new(&path, |out| write_html(out, figures)) {
                Err(WriteError { problem: WriteProblem::Exists, .. }) => {}
                written => return written.map(|()| path),
            }
        }
        Err(WriteError { path, problem: WriteProblem::Exists })
    }
}
