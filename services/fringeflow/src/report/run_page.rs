//! The page that a live run writes when it ends.

use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use fringeflow_base::atomic_file::{WriteError, WriteProblem, write_atomically, write_new};
use fringeflow_config::CameraSource;
use fringeflow_supervisor::{Outcome, Plan, timestamped_path};

use crate::output_folder;

use super::{RunFigures, RunInfo, write_html};

/// Maximum number of pages of runs that start in the same second.
const MAX_SAME_NAMES: u32 = 100;

/// The page of a run that has ended.
pub(crate) struct RunPage<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) outcome: &'a Outcome,
}

impl RunPage<'_> {
    /// Writes the page to `file`, or to a new file in the folder of the recordings, named by the time. Returns its
    /// path. A failure is only logged; it does not affect the run.
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
        let info = RunInfo {
            instance: Some(&plan.configuration.name),
            version: env!("CARGO_PKG_VERSION"),
            origin: outcome.origin.clone(),
            image_size_px: plan.setup.image_size_px,
            virtual_images: plan.configuration.cameras == CameraSource::Virtual,
            steps: plan.setup.steps,
            recording: outcome.recording.as_deref(),
            is_recorded: false,
        };
        RunFigures::new(info, &outcome.balance.0, &outcome.run)
    }

    fn write_named_by_time(&self, figures: &RunFigures<'_>) -> Result<PathBuf, WriteError> {
        let folder = &self.plan.configuration.recorder.folder;
        output_folder::prepare(folder)?;
        let start = UNIX_EPOCH + Duration::from_nanos(self.outcome.origin.started_unix_ns);
        let path = timestamped_path(folder, &self.plan.configuration.name, start, "html");
        let names = (2..MAX_SAME_NAMES).map(|number| path.with_extension(format!("{number}.html")));
        for path in std::iter::once(path.clone()).chain(names) {
            match write_new(&path, |out| write_html(out, figures)) {
                Err(WriteError { problem: WriteProblem::Exists, .. }) => {}
                written => return written.map(|()| path),
            }
        }
        Err(WriteError { path, problem: WriteProblem::Exists })
    }
}
