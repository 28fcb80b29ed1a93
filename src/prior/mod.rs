//! Prior knowledge about a window from earlier windows: motion of the scanner, coarse depth of the scene, drift of the
//! calibration.
//!
//! In: the last tracked poses and the last cloud. Out: a [`Prior`], small enough for a message, and from it the
//! [`Flow`](crate::phase::Flow) in each camera during a window. Cost: 1 ms per window of 1.3 million pixels.
//!
//! Scanner and object move rigidly, and 16 ms later the scanner sees nearly the same surface (Tao et al. 2018,
//! "High-speed real-time 3D shape measurement based on adaptive depth constraint"). A prior may still be wrong: the
//! scanner shakes, the object moves, or another object is there. Its users check it against the images. The paper has
//! no such step: it measures windows one by one.

mod flows;
mod motion;
mod relief;
mod times;

use crate::correspondence::KnownDrift;

pub use motion::RigidMotion;
pub use relief::{CELL_PX, Relief};
pub use times::{Moment, WindowTimes};

/// Prior knowledge about a window.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// How the scanner moves.
    pub motion: RigidMotion,
    /// Coarse depth that camera 1 saw in the last cloud.
    pub relief: Relief,
    /// Drift of the calibration in that cloud, if there was any.
    pub drift: Option<KnownDrift>,
}
