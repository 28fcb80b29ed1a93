//! Reports what the method can be expected to achieve with a rig, before anything is built or measured.
//!
//! In: a calibrated [`Rig`](fringeflow::geometry::Rig), a measurement volume and a fringe pattern ([`RigSetup`]), and
//! [`Assumptions`] on noise and calibration. Out: a [`RigReport`] with lengths and angles, coverage, the number n of
//! fringe periods on a segment, sd of δ and efc (paper, Eq. 1), the wrong fringe orders that survive the
//! back-projection test on flat surfaces, and the effect of changes of the rig on all of these.
//!
//! Nothing is approximated: all figures come from intersecting rays of the calibrated cameras with planes in the
//! volume, over a grid of pixels of C1. A report costs about a second. The surface of the object is assumed: n and sd
//! use a plane perpendicular to the mean viewing direction; the surviving orders also use tilted planes.

mod advice;
mod assumptions;
mod comb;
mod deviation;
mod error;
mod evaluate;
mod layout;
mod segment;
mod setup;
mod surface;
#[cfg(test)]
mod tests;

use serde::Serialize;

pub use advice::{Advice, Change};
pub use assumptions::{Assumptions, CalibrationQuality};
pub use comb::{Comb, Tooth};
pub use deviation::Deviation;
pub use error::{Device, RigReportError};
pub use evaluate::{Evaluation, Figures, PixelMap};
pub use layout::{Coverage, Layout};
pub use segment::Periods;
pub use setup::RigSetup;

/// The whole report.
#[derive(Clone, Debug, Serialize)]
pub struct RigReport {
    /// Lengths, angles and resolution.
    pub layout: Layout,
    /// Measurable parts of image and volume.
    pub coverage: Coverage,
    /// Assumptions on noise and calibration.
    pub assumptions: Assumptions,
    /// Periods, sd, efc and surviving orders.
    pub evaluation: Evaluation,
    /// Figures of the unchanged rig on the coarser grid of the advice, for comparison.
    pub advice_base: Figures,
    /// Effects of changes of the rig.
    pub advice: Vec<Advice>,
}

/// Evaluates a rig at every `grid_step_px`-th pixel of C1.
///
/// # Errors
/// [`RigReportError`]: impossible assumptions, or a volume that C1, C2 or the projector does not see.
pub fn report(setup: &RigSetup, assumptions: &Assumptions, grid_step_px: usize) -> Result<RigReport, RigReportError> {
    assumptions.check()?;
    setup.check()?;
    let coverage = layout::coverage(setup, grid_step_px)?;
    let evaluation = evaluate::evaluate(setup, assumptions, grid_step_px)?;
    let (advice_base, advice) = advice::advise(setup, assumptions)?;
    Ok(RigReport {
        layout: layout::layout(setup, assumptions),
        coverage,
        assumptions: *assumptions,
        evaluation,
        advice_base,
        advice,
    })
}
