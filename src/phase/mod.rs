//! Wrapped phase, modulation and validity from N phase-shifted images.

mod gray_code;
mod map;

pub use gray_code::{AbsolutePhase, GrayCodeError, Threshold, decode_gray_code};
pub use map::PhaseMap;
