//! Limits that the method, messages and configurations share.

/// Fewest images that determine offset, modulation and phase.
pub const MIN_STEPS: usize = 3;
/// Most images of one sequence.
pub const MAX_STEPS: usize = 16;
/// Most images of one window: a cycle of the longest sequence and those for motion.
pub const MAX_IMAGES: usize = 24;
