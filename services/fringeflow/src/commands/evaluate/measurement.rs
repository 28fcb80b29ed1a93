//! Measuring a scene of the virtual scanner: its dataset in a temporary folder, and what the proposed method makes of it.

use std::time::{Duration, Instant};

use fringeflow_lab::evaluation::Scores;
use fringeflow_lab::simulation::{Object, Simulation, SimulationOptions, SimulationSummary};

use crate::failure::Failure;
use crate::input::Input;
use crate::output_folder;
use crate::proposed::ProposedArgs;
use crate::statistics::Statistics;
use crate::truth;

/// A simulated dataset, removed with this.
pub(super) struct Simulated {
    pub(super) summary: SimulationSummary,
    input: Input,
    _folder: tempfile::TempDir,
}

/// What the proposed method makes of a dataset.
pub(super) struct Measurement {
    pub(super) scores: Scores,
    pub(super) statistics: Statistics,
    /// Time that the reconstruction took, segment table and reading the images included.
    pub(super) duration: Duration,
}

impl Simulated {
    /// Takes the images of a scene, and the reference data that Gray code finds in them.
    pub(super) fn new(options: SimulationOptions) -> Result<Self, Failure> {
        let folder = output_folder::temporary()?;
        let simulation = Simulation::new(options)?;
        let target = folder.path().join(options.object.name());
        simulation.write(&target, || {})?;
        Ok(Self { summary: simulation.summary(), input: Input::open(&target, None)?, _folder: folder })
    }

    /// Reconstructs and judges.
    pub(super) fn measure(&self, proposed: &ProposedArgs) -> Result<Measurement, Failure> {
        let start = Instant::now();
        let made = proposed.reconstruct(&self.input)?;
        let duration = start.elapsed();
        let missing = || Failure::Usage(format!("{}: the simulated dataset has no truth", self.input.path().display()));
        let evaluation =
            truth::evaluate(&self.input, &made.reconstruction.cloud, Some(made.image))?.ok_or_else(missing)?;
        Ok(Measurement { scores: evaluation.scores, statistics: Statistics::of(&made), duration })
    }

    /// Why a measurement failed, without the temporary folder that nobody will find.
    pub(super) fn reason(&self, failure: &Failure) -> String {
        let (text, folder) = (failure.to_string(), format!("{}: ", self.input.path().display()));
        text.strip_prefix(&folder).unwrap_or(&text).to_owned()
    }
}

/// The paper's situation: n about 6, sd 0.041, 7 images of Gray code.
pub(super) fn options(object: Object, steps: usize) -> SimulationOptions {
    SimulationOptions { steps, ..SimulationOptions::usual(object) }
}
