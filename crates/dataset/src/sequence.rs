//! One direction of fringes.

use fringeflow::geometry::FringePattern;
use fringeflow::phase::GrayCode;

/// One direction of fringes: pattern, phase shifts, and the Gray code that makes the phase absolute.
#[derive(Clone, Debug, PartialEq)]
pub struct FringeSequence {
    /// Phase as a function of the projector column (row for the second direction).
    pub pattern: FringePattern,
    /// Phase shift of every phase image, rad.
    pub shifts_rad: Vec<f64>,
    /// Gray code, if there is one.
    pub gray: Option<GrayCode>,
}
