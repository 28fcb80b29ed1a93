//! What the stream knows of a window before its images are looked at: how the scanner moves, roughly what it sees, and by
//! how much the calibration errs.
//!
//! In: the last tracked poses and the last cloud. Out: a [`Prior`], small enough for a message, and of it the [`Flow`](crate::phase::Flow) of what
//! each camera sees while the images of a window are taken. The scanner moves rigidly past a rigid thing; 16 ms later what it
//! sees is nearly the same (Tao et al. 2018, "High-speed real-time 3D shape measurement based on adaptive depth constraint").
//!
//! A prior may be wrong: the scanner shakes, the thing moves, another one stands there. Who takes one finds out by the images.
//! Cost: 1 ms a window of 1.3 million pixels.

mod flows;
mod motion;
mod relief;
mod times;

use crate::correspondence::KnownDrift;

pub use motion::RigidMotion;
pub use relief::{CELL_PX, Relief};
pub use times::{Moment, WindowTimes};

/// What is known beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// How the scanner moves.
    pub motion: RigidMotion,
    /// What camera 1 saw at the time of the last cloud.
    pub relief: Relief,
    /// The drift of the calibration that this cloud showed, if it showed one.
    pub drift: Option<KnownDrift>,
}
