//! Settings and results of a registration.

use fringeflow::geometry::Pose;

use super::PoseCovariance;

/// Limits of a registration. Distances are given as shares of the distance from the camera, so that they suit scanners
/// of any size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegistrationSettings {
    /// Largest distance between paired points at the first level. 0.016 is 5 mm at 0.3 m.
    pub reach_share: f64,
    /// Number of points of the moved surface at the last and finest level.
    pub points: usize,
    /// Minimum number of point pairs.
    pub min_associated: usize,
    /// Minimum share of the tried points with a partner. They lie where the surface has points, so most should have one.
    pub min_share: f64,
    /// Maximum root mean square of the residuals.
    pub max_rms_share: f64,
    /// Minimum of the smallest eigenvalue of the normalized information, see [`Lost::Degenerate`].
    pub min_eigenvalue: f64,
}

impl Default for RegistrationSettings {
    fn default() -> Self {
        Self {
            reach_share: 0.016,
            points: 8_000,
            min_associated: 150,
            min_share: 0.5,
            max_rms_share: 5e-4,
            min_eigenvalue: 3e-4,
        }
    }
}

/// A successful registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Pose that maps points of the moved surface into the frame of the reference.
    pub reference_from_moved: Pose,
    /// Covariance of the pose in the frame of the reference.
    pub covariance: PoseCovariance,
    /// Number of point pairs.
    pub associated: usize,
    /// Share of the tried points that have a partner.
    pub share: f64,
    /// Root mean square of the distances to the planes, metres.
    pub rms_m: f64,
    /// Ratio of the residuals to the noise of their points.
    pub excess: f64,
    /// Smallest eigenvalue of the normalized information, see [`Lost::Degenerate`].
    pub least_eigenvalue: f64,
}

impl Registration {
    /// Returns the registration if the surface determines the whole pose.
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
    /// The surfaces overlap too little.
    #[error("only {associated} of {tried} points have a partner")]
    TooFewInCommon {
        /// Points with a partner.
        associated: usize,
        /// Points tried.
        tried: usize,
    },
    /// The surfaces do not coincide.
    #[error("the surfaces are {rms_m:e} m apart (rms), the limit is {limit_m:e} m")]
    ResidualTooLarge {
        /// Root mean square of the residuals, metres.
        rms_m: f64,
        /// The limit, metres.
        limit_m: f64,
    },
    /// A motion hardly changes the distances: a motion along a plane, or about an axis of symmetry.
    #[error("the pose is not determined by the surface: smallest eigenvalue {eigenvalue:e}")]
    Degenerate {
        /// Smallest eigenvalue of `Σ w J Jᵀ / Σ w`, at most 1/3. J is the derivative of a residual with respect to a
        /// translation and to a rotation about the centre that moves the points as far on average.
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
