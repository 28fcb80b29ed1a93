//! Patterns of the projector: what each image shows, sets of images, and their files.
//!
//! ```text
//! FringeCycle ──► PatternSet ──write──► patterns.toml and PNG files
//!                   │   ▲────read────── patterns.toml
//!                   └─image(i)─► grey levels as the projector is sent them
//! ```
//!
//! Projector pixels have their centres at integers; column 0 is the left one and row 0 the upper one of the upright
//! image. Brightness is light, from 0 to 1. Grey levels are those of 8 bits.
//!
//! ```
//! use fringeflow_patterns::{FringeCycle, Pattern, PatternSet};
//!
//! let set = PatternSet::calibration([64, 48], &FringeCycle::even(8, 16.0)).unwrap();
//! assert_eq!(set.images.first(), Some(&Pattern::White));
//! assert_eq!(PatternSet::from_toml(&set.to_toml()).unwrap(), set);
//! ```

#![forbid(unsafe_code)]

mod chart;
mod dither;
mod error;
mod output;
mod packing;
mod pattern;
mod response;
mod set;
mod toml_file;
mod write;

pub use error::{PatternError, PatternProblem};
pub use output::{Depth, Flip, Orientation, Output, Rotation};
pub use pattern::{Direction, Pattern, even_shifts_rad, gray_bits, usual_fringes};
pub use response::{Response, ResponseError};
pub use set::{FringeCycle, NotACycle, PATTERNS_FILE, PatternImage, PatternSet};
