//! Limits shared by the method, messages and configurations.

/// Minimum number of phase shifts needed to determine offset, modulation and phase.
pub const MIN_STEPS: usize = 3;
/// Maximum number of phase shifts of a sequence.
pub const MAX_STEPS: usize = 16;
/// Maximum number of images of a window: a cycle of the longest sequence, and the extra images for motion compensation.
pub const MAX_IMAGES: usize = 24;
