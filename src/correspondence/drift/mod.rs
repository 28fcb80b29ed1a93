//! Drift: the smooth field of δ over image and depth that a calibration error causes in true candidates.
//!
//! The paper's sd is mostly drift: noise is a tenth as large, and the drift stays the same from window to window. With
//! the drift subtracted, the threshold shrinks to what noise requires, and with it the expected number of false
//! candidates (paper, Eq. 1).
//!
//! 1. *coordinates*: those of a candidate in which drifts are smooth, and polynomials in them;
//! 2. *modes*: the fields that calibration errors of this rig can cause, strongest first; computed once per rig;
//! 3. *known*: the drift handed on to later windows;
//! 4. *map*: the drift over the pixels of C1, for display.
//!
//! [`super::moments`] estimates it.

mod coordinates;
mod known;
mod map;
mod modes;

use std::f64::consts::TAU;

use self::coordinates::{DriftCoordinates, Polynomial, TERMS};
use super::delta_statistics::DeltaStatistics;
use super::segment_table::SegmentTable;
use super::wanted::WantedBlocks;

pub(super) use coordinates::{DepthBlock, DepthPolynomial, DepthRow, RowPolynomial};
pub use known::KnownDrift;
pub use map::DriftMap;
pub use modes::DriftModes;
pub(super) use modes::FieldTerms;

/// sd of δ that neither the drift nor Φ of the table can follow, rad: Φ of the table is off by up to 0.002 turns, and
/// lenses have more kinds of errors than there are modes.
const MODEL_SD_RAD: f64 = 0.0075;
/// Share of pixels that agree with it from which on a drift tells of the calibration.
const MOST_PIXELS: f64 = 0.5;

/// The field of δ that the calibration error of a rig causes, estimated from one pair of images.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    places: DriftCoordinates,
    field: Polynomial,
    /// Its coefficients of the modes.
    coefficients: FieldTerms,
    /// Mean of the field over the sampled volume, rad.
    pub mean_rad: f64,
    /// sd of δ of true candidates about the field, rad: noise.
    pub residual_sd_rad: f64,
    /// Root mean square of the field about its mean over the sampled volume, rad.
    pub rms_rad: f64,
    /// Calibration error that explains it: root of the sum of squares over the modes, pixels.
    pub error_px: f64,
    /// Share of pixels with a true candidate among theirs.
    pub share: f64,
}

impl Default for Drift {
    /// No drift, and every pixel agrees.
    fn default() -> Self {
        let places = DriftCoordinates::from_numbers([1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        Self {
            places,
            field: [0.0; TERMS],
            coefficients: [0.0; _],
            mean_rad: 0.0,
            residual_sd_rad: 0.0,
            rms_rad: 0.0,
            error_px: 0.0,
            share: 1.0,
        }
    }
}

impl Drift {
    /// A constant mean, rad, with an sd about it.
    pub(super) fn level(mean_rad: f64, sd_rad: f64) -> Self {
        let mut field = [0.0; TERMS];
        field[0] = mean_rad / TAU;
        let mut coefficients = [0.0; _];
        coefficients[0] = field[0];
        Self { field, coefficients, mean_rad, residual_sd_rad: sd_rad, ..Self::default() }
    }

    fn new(modes: &DriftModes, coefficients: FieldTerms, sd_rad: f64) -> Self {
        let mut field = [0.0; TERMS];
        field[0] = coefficients[0];
        let (mut squares, mut errors) = (0.0, 0.0);
        for ((mode, rms), c) in modes.fields.iter().zip(&modes.rms_turns).zip(&coefficients[1..]) {
            field.iter_mut().zip(mode).for_each(|(f, m)| *f += c * m);
            squares += (c * rms).powi(2);
            errors += c * c;
        }
        Self {
            places: modes.places,
            field,
            mean_rad: coefficients[0] * TAU,
            coefficients,
            residual_sd_rad: sd_rad.hypot(MODEL_SD_RAD),
            rms_rad: squares.sqrt() * TAU,
            error_px: errors.sqrt(),
            share: 1.0,
        }
    }

    /// The field of a mean, turns, and coefficients of the modes, pixels, with an sd of δ about it.
    pub(super) fn from_coefficients(table: &SegmentTable, coefficients: FieldTerms, sd_rad: f64) -> Self {
        match table.drift_modes() {
            Some(modes) => Self::new(modes, coefficients, sd_rad),
            None => Self::level(coefficients[0] * TAU, sd_rad),
        }
    }

    /// Its mean, turns, and its coefficients of the modes, pixels.
    pub(super) fn coefficients(&self) -> &FieldTerms {
        &self.coefficients
    }

    /// The part that is handed on to later windows.
    #[must_use]
    pub fn to_known(&self) -> KnownDrift {
        KnownDrift { coefficients: self.coefficients.map(|c| c as f32), sd_rad: self.residual_sd_rad as f32 }
    }

    /// A drift that an earlier window found. `None` if the rig has no modes.
    pub(super) fn from_known(known: &KnownDrift, table: &SegmentTable) -> Option<Self> {
        let modes = table.drift_modes()?;
        Some(Self::new(modes, known.coefficients.map(f64::from), f64::from(known.sd_rad)))
    }

    /// The same field, with the sd of δ about it, rad, and the share of pixels that were seen to agree with it.
    pub(super) fn seen(self, residual_sd_rad: f64, share: f64) -> Self {
        Self { residual_sd_rad, share, ..self }
    }

    /// Statistics of δ less the drift: no mean, and the sd of noise.
    #[must_use]
    pub fn residual_statistics(&self, delta: &DeltaStatistics) -> DeltaStatistics {
        DeltaStatistics { mean_rad: 0.0, sd_rad: self.residual_sd_rad, ..*delta }
    }

    /// Whether most pixels have a candidate that agrees with the drift. Otherwise it says more about the scene than
    /// about the calibration.
    #[must_use]
    pub fn explains_most_pixels(&self) -> bool {
        self.share >= MOST_PIXELS
    }

    /// Computes δ of true candidates along the segments of a row of C1, turns.
    pub(super) fn along_row(&self, v: usize, width: usize, out: &mut DepthRow) {
        self.places.along_segments(&self.field, v, width, None, out);
    }

    /// The same for the wanted pixels.
    pub(super) fn along_row_where(&self, v: usize, width: usize, wanted: &WantedBlocks, out: &mut DepthRow) {
        self.places.along_segments(&self.field, v, width, Some(wanted.blocks()), out);
    }

    /// The same for a few pixels of a row, turns.
    pub(super) fn in_row(&self, v: usize) -> RowPolynomial {
        self.places.in_row(&self.field, v)
    }
}
