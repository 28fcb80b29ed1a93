//! What the projector shows, and when.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// [`PatternEvent::kind`] of phase-shifted sinusoidal fringes.
pub const PATTERN_FRINGES: u32 = 1;

/// One pattern of a sequence, published by the projector driver when its exposure starts or shortly before or after.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PatternEvent.1")]
pub struct PatternEvent {
    /// Start of the driver; a restarted driver has a new one.
    pub session: u64,
    /// Number of the pattern since the start, without gaps.
    pub sequence: u64,
    /// Start of the exposure that this pattern lights.
    pub exposure_start_ns: u64,
    /// Duration for which it is shown, nanoseconds.
    pub duration_ns: u64,
    /// Fringe period, projector pixels.
    pub period_px: f64,
    /// Step of the phase shift, from 0.
    pub step: u32,
    /// Steps of the cycle.
    pub steps: u32,
    /// [`PATTERN_FRINGES`]; others are passed over.
    pub kind: u32,
    /// Zero.
    pub reserved: u32,
}
