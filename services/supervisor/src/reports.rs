//! Collects the reports of the services, and writes the trace.

use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{PendingFile, WriteError};
use fringeflow_message::StageReport;
use fringeflow_telemetry::{Exposures, RunReport, TraceWriter, WORST_WINDOWS};

/// The reports of a run.
#[derive(Debug)]
pub(crate) struct Reports {
    pub(crate) run: RunReport,
    trace: Option<Trace>,
}

/// A trace that is being written.
#[derive(Debug)]
struct Trace {
    path: PathBuf,
    writer: TraceWriter<PendingFile>,
}

impl Default for Reports {
    fn default() -> Self {
        Self { run: RunReport::new(Exposures::Live, WORST_WINDOWS), trace: None }
    }
}

impl Reports {
    /// Creates an empty collection. If a file for a trace is given, reports are also written to it.
    pub(crate) fn new(trace: Option<&Path>) -> Self {
        let trace = trace.and_then(|path| Trace::create(path).inspect_err(warn_no_trace).ok());
        Self { trace, ..Self::default() }
    }

    /// Adds the report of a stage.
    pub(crate) fn add(&mut self, report: &StageReport) {
        self.run.add(report);
        let Some(trace) = &mut self.trace else { return };
        if let Err(error) = trace.writer.add(report) {
            warn_no_trace(&PendingFile::error(&trace.path, error));
            // The run goes on without a trace. Dropping the pending file removes it.
            self.trace = None;
        }
    }

    /// Returns the reports, and the path of the trace if it could be written.
    pub(crate) fn finish(self) -> (RunReport, Option<PathBuf>) {
        let trace = self.trace.and_then(|trace| trace.finish().inspect_err(warn_no_trace).ok());
        (self.run, trace)
    }
}

impl Trace {
    fn create(path: &Path) -> Result<Self, WriteError> {
        let writer = TraceWriter::new(PendingFile::begin(path)?).map_err(|e| PendingFile::error(path, e))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    fn finish(self) -> Result<PathBuf, WriteError> {
        let file = self.writer.finish().map_err(|e| PendingFile::error(&self.path, e))?;
        file.finish()?;
        Ok(self.path)
    }
}

fn warn_no_trace(error: &WriteError) {
    tracing::warn!("no trace: {error}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::Stage;

    fn report() -> StageReport {
        StageReport { stage: Stage::Phase as u32, of_item: 1, ..StageReport::default() }
    }

    #[test]
    fn reports_are_collected_without_the_trace_if_it_cannot_be_written() {
        let mut reports = Reports::new(Some(Path::new("/nowhere/trace.json")));
        reports.add(&report());
        let (run, trace) = reports.finish();
        assert_eq!((run.tally().stages().count(), trace), (1, None));
    }

    #[test]
    fn the_trace_file_appears_only_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.json");
        let mut reports = Reports::new(Some(&path));
        reports.add(&report());
        assert!(!path.exists());
        assert_eq!(reports.finish().1, Some(path.clone()));
        assert!(std::fs::read_to_string(&path).unwrap().trim_end().ends_with("]}"));
        drop(Reports::new(Some(&folder.path().join("other.json"))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
