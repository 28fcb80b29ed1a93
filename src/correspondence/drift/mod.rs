//! Drift: what a calibration that is no longer exact does to δ of true candidates.
//!
//! The paper's sd is mostly not noise. A calibration error makes δ of true candidates a smooth field over image and depth,
//! the same from window to window; noise on top of it is a tenth as large. With the field subtracted, the threshold
//! shrinks to what noise asks for, and with it the expected number of false candidates (paper, Eq. 1).
//!
//! 1. *place*: coordinates of a candidate in which such fields are smooth, and polynomials in them;
//! 2. *modes*: the fields that errors of this rig's calibration can cause at all, in order of their strength: once a rig;
//! 3. *mixture*: candidates of a sample of pixels, of which one each is true, or none;
//! 4. *estimate*: the field of one pair of images, by expectation maximization from candidates that surfaces decided, else from
//!    all candidates and several starts;
//! 5. *known*: the same handed on to later windows, whose estimates begin with it;
//! 6. *map*: the field over the pixels of C1, for people.
//!
//! A wrong fringe order that is consistent over a large part of the image looks like a field too, but a field that only
//! calibration errors of several pixels could cause: the prior of the modes refuses it.

mod estimate;
mod known;
mod map;
mod mixture;
mod modes;
mod place;

pub use estimate::{Drift, estimate_drift};
pub(super) use estimate::{DriftScratch, MODEL_SD_TURNS};
pub use known::KnownDrift;
pub use map::DriftMap;
pub use modes::DriftModes;
pub(super) use place::{DepthBlock, DepthPolynomial, DepthRow};
