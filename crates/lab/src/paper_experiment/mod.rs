//! The experiment of the paper (section 3), on the virtual scanner.
//!
//! ```text
//! Simulation: one of the seven objects, its rays traced once
//!    └─ with_seed ─► dataset folder: 16 phase images and 7 images of Gray code in two directions
//!                       ├─► EGC with 16 steps ─► RD, the reference data of the paper
//!                       └─► each Way with 16, 8 and 4 steps ─► cloud ─► com, miss, fpc by truth and by RD
//! Trials of all seeds ─► Spread: mean and standard deviation
//! ```
//!
//! All ways read the same files, and the dataset counts the images that each way reads (Table 2). Fewer steps are a part
//! of the 16 images, evenly spaced. Gray code has no white and black image here: as in the paper, seven images are all
//! of it.

mod spread;
mod trial;
mod way;

pub use spread::Spread;
pub use trial::{DeltaFigures, Figures, Measurement, Trial, TrialError};
pub use way::Way;

use crate::simulation::{Object, SimulationOptions};

/// Numbers of phase steps in the paper's Table 2, in its order.
pub const STEPS: [usize; 3] = [16, 8, 4];

/// Options of the scenes of the paper: n about 6, sd 0.041 rad, images of `size_px`.
#[must_use]
pub fn options(object: Object, size_px: [usize; 2]) -> SimulationOptions {
    let usual = SimulationOptions::usual(object);
    let rig = crate::simulation::RigOptions { size_px, ..usual.rig };
    SimulationOptions { rig, steps: STEPS[0], two_directions: true, white_and_black: false, ..usual }
}
