//! Wrapped phase, modulation and validity from N phase-shifted images.

mod map;

pub use map::PhaseMap;
