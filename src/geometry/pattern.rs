//! The fringe pattern: the phase as a function of the projector column (paper, section 2.1). In: a column or a phase.
//! Out: the other. Cost: a division.

use std::f64::consts::TAU;

/// A sinusoidal fringe pattern across the projector's columns.
///
/// Phase against column `u` (pixel centres at integers): `sign·φ = 2π·u/period + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FringePattern {
    /// Period of a fringe, projector pixels.
    pub period_px: f64,
    /// Sense in which the phase grows with the column, +1 or −1.
    pub sign: f64,
    /// Phase at column 0 (times `sign`), rad.
    pub offset_rad: f64,
}

impl FringePattern {
    /// Absolute phase at a projector column, in turns (1 turn = 2π).
    #[must_use]
    pub fn phase_turns(&self, column_px: f64) -> f64 {
        self.sign * (column_px / self.period_px + self.offset_rad / TAU)
    }

    /// The projector column with a given absolute phase in turns.
    #[must_use]
    pub fn column_px(&self, phase_turns: f64) -> f64 {
        (self.sign * phase_turns - self.offset_rad / TAU) * self.period_px
    }
}
