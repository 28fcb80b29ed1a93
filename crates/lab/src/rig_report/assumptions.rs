//! Assumptions on camera noise and calibration, before anything is measured.

use serde::Serialize;

use super::RigReportError;

/// Quality of the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationQuality {
    /// Contribution of the calibration to the standard deviation of δ, rad, at the period of the report.
    SdRad(f64),
    /// Standard deviation of each coordinate of a projected point, in each of the three images, pixels.
    ErrorPx(f64),
}

/// Assumed noise, modulation, phase shifts and calibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Assumptions {
    /// Number of phase shifts, N.
    pub steps: usize,
    /// Standard deviation of the camera noise σ, grey levels.
    pub noise_grey: f64,
    /// Modulation B, grey levels.
    pub modulation_grey: f64,
    /// Quality of the calibration.
    pub calibration: CalibrationQuality,
}

impl Default for Assumptions {
    /// Four phase shifts, an ordinary 8-bit camera in good light, and the calibration error that gives the sd of the
    /// paper, 0.041 rad, on a rig of similar proportions.
    fn default() -> Self {
        Self { steps: 4, noise_grey: 1.5, modulation_grey: 80.0, calibration: CalibrationQuality::ErrorPx(0.065) }
    }
}

impl Assumptions {
    /// Standard deviation of a wrapped phase caused by camera noise, `√(2/N)·σ/B`, rad.
    #[must_use]
    pub fn phase_sd_rad(&self) -> f64 {
        (2.0 / self.steps as f64).sqrt() * self.noise_grey / self.modulation_grey
    }

    /// Returns the assumptions for a period `factor` times as long. A calibration error in pixels stays the same.
    pub(super) fn with_period_scaled(mut self, factor: f64) -> Self {
        if let CalibrationQuality::SdRad(sd_rad) = &mut self.calibration {
            *sd_rad /= factor;
        }
        self
    }

    pub(super) fn check(&self) -> Result<(), RigReportError> {
        let (name, error) = match self.calibration {
            CalibrationQuality::SdRad(sd_rad) => ("the share of the calibration in sd, rad,", sd_rad),
            CalibrationQuality::ErrorPx(sd_px) => ("the calibration error, px,", sd_px),
        };
        let ranges = [
            ("the number of steps", self.steps as f64, 3.0, 1000.0, "at least 3 and at most 1000"),
            ("the noise, grey levels,", self.noise_grey, 0.0, 1e6, "0 or more, and finite"),
            ("the modulation, grey levels,", self.modulation_grey, 1e-3, 1e6, "above 0 and finite"),
            (name, error, 0.0, 1e3, "0 or more, and at most 1000"),
        ];
        for (name, value, min, max, range) in ranges {
            if !(min..=max).contains(&value) {
                return Err(RigReportError::OutOfRange { name, value, range });
            }
        }
        Ok(())
    }
}
