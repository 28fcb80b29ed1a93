//! The knobs that rule the expected false candidates, and the series of their values.

use fringeflow::simulation::{Object, RigOptions, SimulationOptions};
use serde::Serialize;

use crate::commands::evaluate::measurement::options;

/// Phase shifts of every measurement.
const STEPS: usize = 4;

/// What is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Knob {
    /// Depth of the measurement volume.
    Depth,
    /// Standard deviation of δ that the calibration error causes.
    Sd,
    /// Fringe period.
    Period,
}

/// A place in one of the series: what the rig is like there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) knob: Knob,
    depth_mm: f64,
    sd_rad: f64,
    period_px: f64,
}

/// Depths that lead to an efc of about 0.1, 0.2, 0.5, 1 and 2 with the period beside them, millimetres.
const DEPTHS_MM: [f64; 5] = [25.0, 40.0, 90.0, 168.0, 285.0];
const DEPTH_SERIES_PERIOD_PX: f64 = 24.0;
/// Errors that lead there with the depth and period beside them, rad.
const SDS_RAD: [f64; 5] = [0.01, 0.02, 0.05, 0.1, 0.2];
const SD_SERIES: (f64, f64) = (50.0, 16.0);
/// Periods that lead there with the depth beside them, projector pixels.
const PERIODS_PX: [f64; 5] = [128.0, 64.0, 32.0, 16.0, 8.0];
const PERIOD_SERIES_DEPTH_MM: f64 = 118.0;
/// Error of the series that turn something else.
const SD_RAD: f64 = RigOptions::usual(0.0).sd_rad;

/// All places, series by series.
pub(super) fn places() -> Vec<Place> {
    let depth = |depth_mm| Place { knob: Knob::Depth, depth_mm, sd_rad: SD_RAD, period_px: DEPTH_SERIES_PERIOD_PX };
    let sd = |sd_rad| Place { knob: Knob::Sd, depth_mm: SD_SERIES.0, sd_rad, period_px: SD_SERIES.1 };
    let period = |period_px| Place { knob: Knob::Period, depth_mm: PERIOD_SERIES_DEPTH_MM, sd_rad: SD_RAD, period_px };
    DEPTHS_MM.map(depth).into_iter().chain(SDS_RAD.map(sd)).chain(PERIODS_PX.map(period)).collect()
}

impl Knob {
    pub(super) const ALL: [Self; 3] = [Self::Depth, Self::Sd, Self::Period];

    /// Name in the table.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Sd => "sd",
            Self::Period => "period",
        }
    }

    /// What it is, with its unit.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Depth => "depth of the volume, mm",
            Self::Sd => "calibration error, rad",
            Self::Period => "fringe period, px",
        }
    }
}

impl Place {
    /// The value of the knob that is turned.
    pub(super) fn value(&self) -> f64 {
        match self.knob {
            Knob::Depth => self.depth_mm,
            Knob::Sd => self.sd_rad,
            Knob::Period => self.period_px,
        }
    }

    /// The scene with an object; `None` where the volume is shallower than it.
    pub(super) fn options(&self, object: Object) -> Option<SimulationOptions> {
        let usual = options(object, STEPS);
        let depth_m = self.depth_mm * 1e-3;
        let rig = RigOptions { depth_m, sd_rad: self.sd_rad, period_px: self.period_px, ..usual.rig };
        (depth_m >= object.usual_depth_m()).then_some(SimulationOptions { rig, ..usual })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use fringeflow::simulation::VirtualRig;

    use super::*;

    #[test]
    fn every_series_goes_from_few_false_candidates_to_two_a_pixel() {
        for knob in Knob::ALL {
            let places = places().into_iter().filter(|place| place.knob == knob);
            let efc = places.map(|place| {
                let rig = VirtualRig::new(&place.options(Object::Elephant).unwrap().rig).unwrap();
                3.0 * rig.deviation.delta_rms * (rig.mean_periods() - 1.0) / PI
            });
            for (efc, wanted) in efc.zip([0.1, 0.2, 0.5, 1.0, 2.0]) {
                assert!((efc / wanted - 1.0).abs() < 0.25, "{knob:?}: efc {efc}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn no_volume_is_shallower_than_its_object() {
        let measured = places().into_iter().filter(|place| place.options(Object::Nose).is_some()).count();
        assert_eq!(measured, places().len() - 2);
    }
}
