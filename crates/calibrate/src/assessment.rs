//! A calibration with all that is to be said of it.

use crate::adjustment::{Measured, PROJECTOR};
use crate::findings::{Finding, Severity, in_calibration, in_images};
use crate::observed::Observed;
use crate::quality::coverage::Coverage;
use crate::quality::poses::{ProposedPose, proposed};
use crate::quality::prediction::{ExpectedError, Probes};
use crate::rig::{CalibratedRig, NoCalibration, calibrate};

/// What came of the images of a board.
#[derive(Debug)]
pub struct Assessment {
    /// The calibration, or why there is none.
    pub calibrated: Result<CalibratedRig, NoCalibration>,
    /// What is wrong, the worst first.
    pub findings: Vec<Finding>,
    /// The rest of what is known of a calibration; `None` without one.
    pub quality: Option<Quality>,
}

/// How good a calibration is.
#[derive(Debug)]
pub struct Quality {
    /// Which parts of each device's image were covered.
    pub coverage: Vec<Coverage>,
    /// Points of the measurement volume; empty without a projector.
    pub probes: Probes,
    /// Expected errors over these points; `None` without a projector.
    pub expected: Option<ExpectedError>,
    /// Poses that would help.
    pub proposed: Vec<ProposedPose>,
}

impl Assessment {
    /// Calibrates the rig and judges the result.
    #[must_use]
    pub fn of(observed: &Observed) -> Self {
        let mut findings = in_images(observed);
        let calibrated = calibrate(&observed.views);
        let quality = calibrated.as_ref().ok().map(|calibrated| Quality::of(observed, calibrated));
        match (&calibrated, &quality) {
            (Ok(calibrated), Some(quality)) => {
                findings.extend(in_calibration(observed, calibrated, quality.expected));
            }
            (Err(why), _) => {
                // What is wrong with the images explains it better.
                findings.push(Finding { severity: Severity::Refusal, cause: "no calibration", text: why.to_string() });
            }
            _ => {}
        }
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Self { calibrated, findings, quality }
    }

    /// The findings that refuse the calibration.
    pub fn refusals(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| finding.severity == Severity::Refusal)
    }
}

impl Quality {
    fn of(observed: &Observed, calibrated: &CalibratedRig) -> Self {
        let (problem, adjusted) = (&calibrated.problem, &calibrated.adjusted);
        let coverage = (0..problem.sizes_px.len()).map(|device| {
            let points = problem.measurements.iter().filter(|m| m.measures(device)).map(|m| match &m.measured {
                Measured::Pixel(pixel, _) => *pixel,
                Measured::Phase(patch) => patch.at(&patch.centre).0.into(),
            });
            Coverage::of(points, problem.sizes_px[device])
        });
        let coverage = coverage.collect();
        if problem.sizes_px.len() <= PROJECTOR {
            return Self { coverage, probes: Probes::default(), expected: None, proposed: Vec::new() };
        }
        let probes = Probes::between_poses(&adjusted.state, &problem.sizes_px);
        let proposed = match observed.period_px {
            Some(period_px) => proposed(problem, adjusted, &probes, period_px),
            None => Vec::new(),
        };
        Self { coverage, expected: probes.rms(&adjusted.covariance), probes, proposed }
    }
}
