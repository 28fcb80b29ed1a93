//! Measures an artefact of known size in a cloud, in the manner of VDI/VDE 2634 parts 2 and 3.
//!
//! ```text
//!  points ─► find_plane, find_spheres ─► region ─► fit (least squares, 0.3 % left out) ─► residuals ─► form, noise, cause
//!            (sampled, fixed seed)       (all points that must lie on the surface)
//! ```
//!
//! In: points in the frame of C1, metres, and an [`Artefact`]. Out: [`Measurement`]: the figures of the standard, and
//! apart from each other noise (scatter about smooth patches), form (deviation of low frequency) and trueness
//! (diameter, spacing). Cost: half a second for a cloud of 200,000 points. The same points give the same figures: the
//! search draws its samples from a fixed seed.
//!
//! The region of an artefact is chosen by rays, not by distance: each point that C1 sees in the middle of the artefact
//! belongs to it, right or wrong. So no wrong point is left out because it is wrong.

mod cause;
mod cells;
mod find_plane;
mod find_spheres;
mod fit;
mod measurement;
mod plane;
mod region;
mod repeatability;
mod ripple;
mod sphere;
mod statistics;
mod trend;

#[cfg(test)]
mod tests;

pub use cause::{Cause, causes};
pub use cells::{Cell, merged};
pub use find_plane::find_plane;
pub use find_spheres::find_spheres;
pub use fit::{ALLOWED_SHARE, LeftOut};
pub use measurement::{BallFigures, FlatFigures, Measurement, NotFound, Spacing, SurfaceFigures, measure};
pub use plane::Plane;
pub use repeatability::{Spread, cell_repeatability_m};
pub use ripple::Ripple;
pub use sphere::{Sphere, SphereFit};
pub use trend::Bend;

use fringeflow::geometry::Point3;

/// An artefact of known size. Lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Artefact {
    /// A flat plate that fills most of the view.
    Plane,
    /// Balls in a row: their diameters, and the distances between the centres of neighbours, one fewer.
    Balls {
        /// Certified diameters.
        diameters_m: Vec<f64>,
        /// Certified distances of neighbours.
        spacings_m: Vec<f64>,
    },
}

/// From where the points were measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Views {
    /// All from C1, which is the origin.
    Cam1,
    /// From several places, as those of a model.
    Several,
}

/// The points to measure in.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredPoints<'a> {
    /// Frame of C1 or of a model, metres.
    pub points_m: &'a [Point3],
    /// From where they were measured.
    pub views: Views,
    /// Phase of the projected fringes at each point, rad, and the number of phase steps; `None` if unknown.
    pub fringes: Option<(&'a [f64], usize)>,
}
