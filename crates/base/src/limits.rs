//! Limits that the method, messages and configurations share.

/// Fewest phase shifts that determine offset, modulation and phase.
pub const MIN_STEPS: usize = 3;
/// Most phase shifts of a sequence.
pub const MAX_STEPS: usize = 16;
/// Most images of a window: a cycle of the longest sequence and the extra images for motion.
pub const MAX_IMAGES: usize = 24;
