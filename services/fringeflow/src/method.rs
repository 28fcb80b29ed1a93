//! The methods by which images become a cloud.

use fringeflow::cloud::Cloud;
use fringeflow_lab::evaluation::{cgc, egc};

use crate::failure::Failure;
use crate::input::Input;
use crate::proposed::{Proposed, ProposedArgs};

/// How correspondences are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Method {
    /// The proposed method: phase images alone.
    Pa,
    /// Full Gray code with epipolar lines.
    Egc,
    /// Full Gray code in two fringe directions.
    Cgc,
}

/// A cloud and, for the proposed method, what it was made of.
pub(crate) struct Made {
    pub(crate) cloud: Cloud,
    pub(crate) proposed: Option<Proposed>,
}

impl Made {
    /// Middle of its images, counted in those of the input; `None` for what Gray code found, at its own moment.
    pub(crate) fn image(&self) -> Option<f64> {
        self.proposed.as_ref().map(|proposed| proposed.image)
    }
}

impl Method {
    /// Makes the cloud of an input; `proposed` matters to the proposed method alone.
    pub(crate) fn run(self, input: &Input, proposed: &ProposedArgs) -> Result<Made, Failure> {
        let reference = |cloud: Cloud| Made { cloud, proposed: None };
        match self {
            Self::Pa => {
                let proposed = proposed.reconstruct(input)?;
                Ok(Made { cloud: proposed.reconstruction.cloud.clone(), proposed: Some(proposed) })
            }
            Self::Egc => Ok(reference(egc(input.folder()?)?)),
            Self::Cgc => Ok(reference(cgc(input.folder()?)?)),
        }
    }
}
