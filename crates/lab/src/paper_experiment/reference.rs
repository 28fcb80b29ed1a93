//! The scenes of the experiment and their two references.

use std::path::Path;

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::SegmentTable;
use fringeflow_dataset::{Dataset, Truth};

use super::trial::{Trial, TrialError};
use crate::evaluation::{egc, gray_reference_data};
use crate::simulation::{Object, Simulation, SimulationError, SimulationOptions};

/// An object before the cameras; its rays are traced.
#[derive(Clone)]
pub struct TracedObject {
    object: Object,
    simulation: Simulation,
}

impl TracedObject {
    /// Traces the rays of a scene.
    ///
    /// # Errors
    /// An option is out of range.
    pub fn new(options: SimulationOptions) -> Result<Self, SimulationError> {
        Ok(Self { object: options.object, simulation: Simulation::new(options)? })
    }

    /// The object.
    #[must_use]
    pub fn object(&self) -> Object {
        self.object
    }

    /// Takes the images with the calibration error and the noise of a seed, writes them to `folder`, which must not
    /// exist, and computes both references:
    ///
    /// - the exact truth, at the pixels where EGC agrees with it;
    /// - RD: the correspondences that EGC finds in all images, in the volume, whose own back-projection residual is
    ///   small. The paper's reference data are such a result.
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn trial(&self, seed: u64, folder: &Path) -> Result<Trial, TrialError> {
        self.simulation.with_seed(seed)?.write(folder, || {})?;
        let dataset = Dataset::open(folder, None)?;
        let Some(Truth::Rendered(truth)) = dataset.truth()? else { return Err(TrialError::NoTruth) };
        let Some(volume) = dataset.setup.volume else { return Err(TrialError::NoVolume) };
        let table = SegmentTable::build(&dataset.setup.rig, &volume, &dataset.setup.sequence.pattern)?;
        let gray: Cloud = gray_reference_data(egc(&dataset, None)?, &volume);
        Ok(Trial { object: self.object, seed, dataset, truth, gray, table })
    }
}
