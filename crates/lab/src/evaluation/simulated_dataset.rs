//! Writes simulated datasets with the reference data of the paper (section 3).

use std::path::Path;

use fringeflow_dataset::{DatasetWriter, RenderedTruth};

use crate::simulation::{Simulation, SimulationError};

use super::{EvaluationError, GrayReferenceError, egc, limit_to_gray_code};

/// Why a simulated dataset could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SimulatedDatasetError {
    /// The images cannot be simulated, or the folder cannot be written.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The Gray-code reference cannot measure the images.
    #[error("cannot compute the reference data of the simulated images: {0}")]
    Gray(#[from] GrayReferenceError),
    /// The Gray-code reference does not fit the truth.
    #[error("cannot compute the reference data of the simulated images: {0}")]
    Reference(#[from] EvaluationError),
}

impl Simulation {
    /// Takes all images and writes the dataset folder. Calls `on_image` after each image of both cameras.
    ///
    /// With Gray code, the references are the points that EGC finds in these images and that the truth confirms (paper,
    /// section 3). For a moving object, EGC measures images of the object at rest in the middle of its phase images,
    /// where the truth holds.
    ///
    /// # Errors
    /// The folder exists and is not empty, it cannot be written, or the Gray-code reference fails.
    pub fn write(&self, folder: &Path, on_image: impl FnMut()) -> Result<(), SimulatedDatasetError> {
        let writer = self.write_images(folder, on_image)?;
        let truth = self.reference_data(&writer, folder)?;
        writer.truth(&truth).and_then(|()| writer.finish()).map_err(SimulationError::from)?;
        Ok(())
    }

    /// Returns the truth with the reference data of the paper, for the images in `writer`.
    fn reference_data(&self, writer: &DatasetWriter, folder: &Path) -> Result<RenderedTruth, SimulatedDatasetError> {
        if !self.has_gray_code() {
            return Ok(self.truth().clone());
        }
        // The images at rest are in a temporary folder, which is removed when its writer is dropped.
        let resting = self.at_rest().map(|resting| resting.write_images(folder, || ())).transpose()?;
        let dataset = resting.as_ref().unwrap_or(writer).unfinished().map_err(SimulationError::from)?;
        let [cam1, _] = self.views();
        Ok(limit_to_gray_code(self.truth().clone(), &egc(&dataset, None)?, [cam1.width, cam1.height])?)
    }
}
