//! Draws pictures of the results of each stage, as PNG.
//!
//! | picture | of | shows |
//! |---|---|---|
//! | [`phase_picture`] | wrapped phase | a cyclic colour map, invalid pixels dark grey |
//! | [`modulation_picture`] | modulation | grey, stretched between percentiles |
//! | [`depth_picture`] | cloud | depth per pixel of C1, coloured and hill-shaded |
//! | [`confidence_picture`] | cloud | confidence of every point |
//! | [`drift_picture`] | drift of the calibration | δ that it causes, per pixel of C1, in diverging colours |
//! | [`outcome_picture`] | correspondence | outcome of every pixel, with a legend |
//! | [`judgement_picture`] | comparison with the truth | correct, wrong, stray, tolerated and missed points, with a legend |
//! | [`delta_histogram_picture`] | back-projection test | histogram of δ with the threshold |
//!
//! All functions are pure: they map slices to a [`Picture`] and measure nothing. Quantities get perceptually uniform
//! colour maps. Categories get the palette of Okabe and Ito, which colour-blind people can distinguish.

mod colour;
mod confidence;
mod depth;
mod drift;
mod font;
mod histogram;
mod judgement;
mod legend;
mod outcome;
mod phase;
mod picture;
mod scale;
mod shading;

pub use colour::diverging;
pub use confidence::confidence_picture;
pub use depth::depth_picture;
pub use drift::drift_picture;
pub use histogram::delta_histogram_picture;
pub use judgement::judgement_picture;
pub use outcome::outcome_picture;
pub use phase::{modulation_picture, phase_picture};
pub use picture::Picture;
