//! Patterns of the projector.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// [`PatternEvent::kind`] of phase-shifted sinusoidal fringes.
pub const PATTERN_FRINGES: u32 = 1;

/// One pattern of a sequence. The projector driver publishes it at about the start of its exposure.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PatternEvent.1")]
pub struct PatternEvent {
    /// Identifies the start of the driver. A restarted driver has a new session.
    pub session: u64,
    /// Number of the pattern in the session, without gaps.
    pub sequence: u64,
    /// Start of the exposure with this pattern.
    pub exposure_start_ns: u64,
    /// Duration of the pattern, nanoseconds.
    pub duration_ns: u64,
    /// Fringe period, projector pixels.
    pub period_px: f64,
    /// Step of the phase shift, from 0.
    pub step: u32,
    /// Number of steps of the cycle.
    pub steps: u32,
    /// [`PATTERN_FRINGES`]; other kinds are ignored.
    pub kind: u32,
    /// Zero.
    pub reserved: u32,
}
