//! Measures a scene of the virtual scanner: simulates its dataset in a temporary folder, reconstructs it with the
//! proposed method, and compares the cloud with the truth.

use std::time::{Duration, Instant};

use fringeflow_lab::evaluation::Scores;
use fringeflow_lab::simulation::{Simulation, SimulationOptions, SimulationSummary};

use crate::failure::Failure;
use crate::input::Input;
use crate::output_folder;
use crate::proposed::ProposedArgs;
use crate::statistics::Statistics;
use crate::truth;

/// A simulated dataset in a temporary folder, which is removed on drop.
pub(super) struct SimulatedDataset {
    pub(super) summary: SimulationSummary,
    input: Input,
    _folder: tempfile::TempDir,
}

/// Result of the proposed method on a dataset.
pub(super) struct Measurement {
    pub(super) scores: Scores,
    pub(super) statistics: Statistics,
    /// Duration of the reconstruction, including the segment table and the reading of the images.
    pub(super) duration: Duration,
}

impl SimulatedDataset {
    /// Simulates the images of a scene, and finds the Gray-code reference in them.
    pub(super) fn new(options: SimulationOptions) -> Result<Self, Failure> {
        let folder = output_folder::temporary()?;
        let simulation = Simulation::new(options)?;
        let target = folder.path().join(options.object.name());
        simulation.write(&target, || {})?;
        Ok(Self { summary: simulation.summary(), input: Input::open(&target, None)?, _folder: folder })
    }

    /// Reconstructs the dataset and compares the cloud with the truth.
    pub(super) fn measure(&self, proposed: &ProposedArgs) -> Result<Measurement, Failure> {
        let start = Instant::now();
        let output = proposed.reconstruct(&self.input)?;
        let duration = start.elapsed();
        let missing = || Failure::Usage(format!("{}: the simulated dataset has no truth", self.input.path().display()));
        let evaluation = truth::evaluate(&self.input, &output.reconstruction.cloud, Some(output.middle_image))?
            .ok_or_else(missing)?;
        Ok(Measurement { scores: evaluation.scores, statistics: Statistics::new(&output), duration })
    }

    /// Text of a failure without the path of the temporary folder, which will not exist any more.
    pub(super) fn failure_text(&self, failure: &Failure) -> String {
        let (text, folder) = (failure.to_string(), format!("{}: ", self.input.path().display()));
        text.strip_prefix(&folder).unwrap_or(&text).to_owned()
    }
}
