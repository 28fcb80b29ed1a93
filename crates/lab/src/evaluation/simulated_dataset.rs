//! Writes simulated datasets with the reference data of the paper (section 3).

use std::path::Path;

use fringeflow::cloud::Cloud;
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
    /// where the truth holds. Returns the cloud that EGC finds.
    ///
    /// # Errors
    /// The folder exists and is not empty, it cannot be written, or the Gray-code reference fails.
    pub fn write(&self, folder: &Path, on_image: impl FnMut()) -> Result<Option<Cloud>, SimulatedDatasetError> {
        let writer = self.write_images(folder, on_image)?;
        let gray = self.gray_cloud(&writer, folder)?;
        let truth = self.reference_data(gray.as_ref())?;
        writer.truth(&truth).and_then(|()| writer.finish()).map_err(SimulationError::from)?;
        Ok(gray)
    }

    /// Returns the cloud that EGC finds in the images in `writer`; `None` without Gray code.
    fn gray_cloud(&self, writer: &DatasetWriter, folder: &Path) -> Result<Option<Cloud>, SimulatedDatasetError> {
        if !self.has_gray_code() {
            return Ok(None);
        }
        // The images at rest are in a temporary folder, which is removed when its writer is dropped.
        let resting = self.at_rest().map(|resting| resting.write_images(folder, || ())).transpose()?;
        let dataset = resting.as_ref().unwrap_or(writer).unfinished().map_err(SimulationError::from)?;
        Ok(Some(egc(&dataset, None)?))
    }

    /// Returns the truth with the reference data of the paper, from the cloud that EGC finds.
    fn reference_data(&self, gray: Option<&Cloud>) -> Result<RenderedTruth, SimulatedDatasetError> {
        let truth = self.truth().clone();
        let [cam1, _] = self.views();
        Ok(match gray {
            Some(gray) => limit_to_gray_code(truth, gray, [cam1.width, cam1.height])?,
            None => truth,
        })
    }
}
