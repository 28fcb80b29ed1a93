//! Drift: the smooth field of δ over image and depth that a calibration error causes in true candidates.
//!
//! The paper's sd is mostly drift: noise is a tenth as large, and the drift stays the same from window to window. With
//! the drift subtracted, the threshold shrinks to what noise requires, and with it the expected number of false
//! candidates (paper, Eq. 1).
//!
//! 1. *coordinates*: those of a candidate in which drifts are smooth, and polynomials in them;
//! 2. *modes*: the fields that calibration errors of this rig can cause, strongest first; computed once per rig;
//! 3. *mixture*: the candidates of a sample of pixels, of which at most one per pixel is true;
//! 4. *estimate*: the drift of one pair of images, by expectation maximization from candidates decided by surfaces,
//!    else from all candidates and several starts;
//! 5. *known*: the drift handed on to later windows, whose estimates start from it;
//! 6. *map*: the drift over the pixels of C1, for display.
//!
//! A wrong fringe order that is consistent over a large part of the image looks like a drift too. But only calibration
//! errors of several pixels could cause it, and the prior of the modes rejects those.

mod coordinates;
mod estimate;
mod known;
mod map;
mod mixture;
mod modes;

pub(super) use coordinates::{DepthBlock, DepthPolynomial, DepthRow};
pub use estimate::{Drift, estimate_drift};
pub(super) use estimate::{DriftScratch, MODEL_SD_TURNS};
pub use known::KnownDrift;
pub use map::DriftMap;
pub use modes::DriftModes;
