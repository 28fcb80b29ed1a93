//! Wrapped phase, modulation and validity from N phase-shifted images (paper, section 2.1).
//!
//! In: N images `I_k = A + B·cos(φ + s_k)` of one camera with known phase shifts `s_k`, N from 3 to 16; more than one
//! cycle if the scene moves ([`decode_moving`]). Out: a [`PhaseMap`]. Cost per pixel: N multiply-adds for each of three
//! sums, one square root and one polynomial arctangent.
//!
//! *decode*: scenes at rest; *motion*: moving scenes; *sequence*: lost and exchanged images; *gray code*: absolute
//! phase for the reference methods; *shifts*, *harmonics*, *residuals*: what they share.

mod arctangent;
mod decode;
mod gray_code;
mod harmonics;
mod histogram;
mod map;
mod motion;
mod residuals;
mod sample;
mod sequence;
mod shifts;

pub use decode::{Validity, decode, decode_into};
pub use gray_code::{AbsolutePhase, GrayCode, GrayCodeError, Threshold, decode_gray_code};
pub use map::{Exposure, FitStatistics, Harmonics, Modulation, Motion, PhaseMap};
pub use motion::{
    FLOW_TILE_PX, Flow, MotionFit, MotionFits, MotionScratch, SurfaceMotion, decode_following_into, decode_moving,
    decode_moving_into, usual_extra_images,
};
pub use sequence::{SequenceCheck, SequenceFault, SequenceFaultKind, SequenceScratch};
pub use shifts::{MistakenUnit, PhaseShifts, ShiftError};
