//! Mean and standard deviation of δ, and what follows from them: the threshold of the back-projection test and the
//! expected number of false candidates (paper, sections 2.1 and 2.3).

use std::f64::consts::TAU;

use fringeflow_base::false_candidates::{THRESHOLD_SD, expected_false_candidates, expected_unique_percent};

use super::candidates::DeltaGate;
use super::neighbourhood::TURN;

/// Least accepted sd, turns (0.003 rad): rounding alone makes more.
pub(super) const MIN_SD_TURNS: f64 = 0.0005;
/// sd of δ beyond which images or calibration are wrong, rad.
const SUSPICIOUS_SD_RAD: f64 = 0.15;
/// Tolerated difference of δ between neighbours, in sd of that difference.
const TOLERANCE_NOISE_SD: f64 = 6.0;
/// Least tolerated difference, in sd: the smooth part of δ changes too.
const MIN_TOLERANCE_SD: f64 = 0.5;
/// Mean and standard deviation of δ over the true candidates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeltaStatistics {
    /// Mean of δ, rad: zero for a perfect calibration.
    pub mean_rad: f64,
    /// Standard deviation of δ about its mean, rad: the paper's sd.
    pub sd_rad: f64,
    /// Standard deviation of δ from one pixel to the next on one surface (÷ √2), rad: the part of sd that is noise.
    pub noise_sd_rad: f64,
    /// Mean number n of fringe periods on a segment, over the valid pixels.
    pub mean_periods: f64,
    /// Reference correspondences from which mean and sd were measured.
    pub references: usize,
}

impl DeltaStatistics {
    /// Threshold thr = 3·sd, rad; never more than half a turn.
    #[must_use]
    pub fn threshold_rad(&self) -> f64 {
        (THRESHOLD_SD * self.sd_rad).min(0.5 * TAU)
    }

    /// The back-projection test with this threshold.
    #[must_use]
    pub fn gate(&self) -> DeltaGate {
        DeltaGate { mean_turns: (self.mean_rad / TAU) as f32, threshold_turns: (self.threshold_rad() / TAU) as f32 }
    }

    /// Tolerated difference of δ between neighbours on one surface, turns · 65536.
    pub(super) fn tolerance(&self) -> i32 {
        let noise_rad = TOLERANCE_NOISE_SD * 2.0_f64.sqrt() * self.noise_sd_rad;
        let turns = (noise_rad.max(MIN_TOLERANCE_SD * self.sd_rad) / TAU).min(0.5) as f32;
        (turns * TURN as f32) as i32
    }

    /// Whether δ scatters more than three times as widely as on calibrated rigs, the paper's and ours. Then images and
    /// calibration may not belong together, or the calibration is out of date.
    #[must_use]
    pub fn is_suspicious(&self) -> bool {
        self.sd_rad > SUSPICIOUS_SD_RAD
    }

    /// Expected number of additional false candidates per true one, efc (paper, Eq. 1).
    #[must_use]
    pub fn expected_false_candidates(&self) -> f64 {
        expected_false_candidates(self.sd_rad, self.mean_periods)
    }

    /// Expected percentage of unique correspondences, puc (paper, 2.2.1).
    #[must_use]
    pub fn expected_unique_percent(&self) -> f64 {
        expected_unique_percent(self.expected_false_candidates())
    }
}

/// Count and sums of δ, turns · 65536.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DeltaSums {
    count: u32,
    sum: i64,
    squares: u64,
}

impl DeltaSums {
    /// From the number of δ, their sum and the sum of their squares.
    pub(super) fn new(count: u32, sum: i64, squares: u64) -> Self {
        Self { count, sum, squares }
    }

    /// Of one δ.
    pub(super) fn of(delta: i16) -> Self {
        Self::new(1, i64::from(delta), u64::from(delta.unsigned_abs()).pow(2))
    }

    pub(super) fn merged(self, other: Self) -> Self {
        Self::new(self.count + other.count, self.sum + other.sum, self.squares + other.squares)
    }

    /// Mean and standard deviation, rad.
    pub(super) fn mean_and_sd_rad(&self) -> (f64, f64) {
        let count = f64::from(self.count.max(1));
        let mean = self.sum as f64 / count;
        let variance = (self.squares as f64 / count - mean * mean).max((MIN_SD_TURNS * 65536.0).powi(2));
        (mean * TAU / 65536.0, variance.sqrt() * TAU / 65536.0)
    }
}

/// Mean and standard deviation of δ given in turns · 65536, rad.
pub(super) fn mean_and_sd_rad(deltas: &[i16]) -> (f64, f64) {
    deltas.iter().map(|&delta| DeltaSums::of(delta)).fold(DeltaSums::default(), DeltaSums::merged).mean_and_sd_rad()
}
