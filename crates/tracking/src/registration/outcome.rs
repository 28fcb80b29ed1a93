//! What a registration is asked for, and what it says.

use fringeflow::geometry::Pose;

use super::PoseCovariance;

/// What makes a registration trustworthy, and how far it searches. Distances are shares of the distance from the camera,
/// so that scanners of any size are served alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegistrationSettings {
    /// How far apart points may stand that are paired at first; 0.016 is 5 mm at 0.3 m.
    pub reach_share: f64,
    /// Points of the moved surface that the last and finest level looks at.
    pub points: usize,
    /// Fewest pairs of points.
    pub min_associated: usize,
    /// Least share of the points looked at that has a partner.
    pub min_share: f64,
    /// Largest root mean square of the residuals.
    pub max_rms_share: f64,
    /// Least eigenvalue of the normalized information, see [`Lost::Degenerate`].
    pub min_eigenvalue: f64,
}

impl Default for RegistrationSettings {
    fn default() -> Self {
        Self {
            reach_share: 0.016,
            points: 8_000,
            min_associated: 150,
            min_share: 0.25,
            max_rms_share: 5e-4,
            min_eigenvalue: 3e-4,
        }
    }
}

/// A pose that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Takes points of the moved surface to where they stand in the reference.
    pub reference_from_moved: Pose,
    /// Covariance of the pose, frame of the reference.
    pub covariance: PoseCovariance,
    /// Pairs of points that the pose rests on.
    pub associated: usize,
    /// Their share of the points looked at.
    pub share: f64,
    /// Root mean square of the distances to the planes, metres.
    pub rms_m: f64,
    /// How many times larger the residuals are than the noise of their points alone would make them.
    pub excess: f64,
    /// Least eigenvalue of the normalized information, see [`Lost::Degenerate`].
    pub least_eigenvalue: f64,
}

impl Registration {
    /// The registration, where the surface determines all of its pose.
    ///
    /// # Errors
    /// [`Lost::Degenerate`].
    pub fn determined(self, settings: &RegistrationSettings) -> Result<Self, Lost> {
        let eigenvalue = self.least_eigenvalue;
        if eigenvalue < settings.min_eigenvalue { Err(Lost::Degenerate { eigenvalue }) } else { Ok(self) }
    }
}

/// Why no pose was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// The surfaces have too little in common.
    #[error("{associated} of {tried} points have a partner")]
    TooFewInCommon {
        /// Points with a partner.
        associated: usize,
        /// Points looked at.
        tried: usize,
    },
    /// The surfaces do not lie on each other.
    #[error("the surfaces are {rms_m:e} m apart (rms), allowed are {limit_m:e} m")]
    ResidualTooLarge {
        /// Root mean square of the residuals, metres.
        rms_m: f64,
        /// What is allowed, metres.
        limit_m: f64,
    },
    /// A motion leaves the distances nearly as they are: along a plane, about an axis of symmetry.
    #[error("a motion is not determined by the surface: least eigenvalue {eigenvalue:e}")]
    Degenerate {
        /// Least eigenvalue of `Σ w J Jᵀ / Σ w`, J the change of a residual by a shift, and by a turn about the centre
        /// that moves the points as far on average; 1/3 at best.
        eigenvalue: f64,
    },
    /// The last steps were still large.
    #[error("the pose still moves by {step_sd:.1} standard deviations")]
    NotConverged {
        /// Last step, standard deviations of the pose.
        step_sd: f64,
    },
}

impl Lost {
    /// Name of the reason in reports and JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::TooFewInCommon { .. } => "too_few_in_common",
            Self::ResidualTooLarge { .. } => "residual_too_large",
            Self::Degenerate { .. } => "degenerate",
            Self::NotConverged { .. } => "not_converged",
        }
    }
}
