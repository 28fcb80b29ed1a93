//! Methods that reconstruct a cloud from images.

use fringeflow::cloud::Cloud;
use fringeflow_lab::evaluation::{cgc, egc};

use crate::failure::Failure;
use crate::input::Input;
use crate::proposed::{ProposedArgs, ProposedOutput};

/// Method that finds the correspondences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Method {
    /// The proposed method: phase images only.
    Pa,
    /// Full Gray code with epipolar lines.
    Egc,
    /// Full Gray code in two fringe directions.
    Cgc,
}

/// A cloud, and for the proposed method its full result.
pub(crate) struct MethodOutput {
    pub(crate) cloud: Cloud,
    pub(crate) proposed: Option<ProposedOutput>,
}

impl MethodOutput {
    /// Mean number of the images of the cloud, as the input numbers them. `None` for the Gray-code methods, whose
    /// clouds show the object at the time of the truth.
    pub(crate) fn middle_image(&self) -> Option<f64> {
        self.proposed.as_ref().map(|proposed| proposed.middle_image)
    }
}

impl Method {
    /// Reconstructs the cloud of an input. Only the proposed method uses the options `proposed`.
    pub(crate) fn run(self, input: &Input, proposed: &ProposedArgs) -> Result<MethodOutput, Failure> {
        let reference = |cloud: Cloud| MethodOutput { cloud, proposed: None };
        match self {
            Self::Pa => {
                let proposed = proposed.reconstruct(input)?;
                Ok(MethodOutput { cloud: proposed.reconstruction.cloud.clone(), proposed: Some(proposed) })
            }
            Self::Egc => Ok(reference(egc(input.folder()?, None)?)),
            Self::Cgc => Ok(reference(cgc(input.folder()?, None)?)),
        }
    }
}
