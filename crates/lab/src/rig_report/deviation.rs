//! Predicts the standard deviation of δ at the true point, from camera noise and calibration error.
//!
//! Phase errors e1 in C1 and e2 in C2 move the candidate along the segment until φ2 compensates e1 − e2. The phase in
//! the projector moves with it, by the amplification `A = (dΦ_P along the ray of C1) / (dφ2 along the segment)`. So `δ
//! = A·(e1 − e2) − e1` and `sd² = ((1 − A)² + A²)·sd(φ)²`. A equals the place r of the projector on the base, apart
//! from perspective and tilt. Calibration errors are propagated by moving image points slightly.

use std::f64::consts::{SQRT_2, TAU};

use serde::Serialize;

use fringeflow::geometry::{Pixel, Point3, triangulate};

use super::segment::Segment;
use super::surface::Surface;
use super::{Assumptions, CalibrationQuality, RigSetup};

/// Relative change of depth for computing slopes.
const DEPTH_STEP: f64 = 1e-4;
/// Minimum phase slope in C2 that determines a point, periods per relative depth.
const MIN_SLOPE: f64 = 1e-6;

/// Predicted standard deviation of δ, root mean square over the image.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Deviation {
    /// Standard deviation of a wrapped phase caused by camera noise, rad.
    pub phase_sd_rad: f64,
    /// Mean amplification A of a phase error in C2. It is close to the place of the projector on the base.
    pub amplification: f64,
    /// Contribution of camera noise to the standard deviation of δ, rad.
    pub noise_sd_rad: f64,
    /// Contribution of the calibration, rad.
    pub calibration_sd_rad: f64,
    /// Standard deviation of δ, rad.
    pub sd_rad: f64,
    /// Threshold for |δ|, 3·sd, rad.
    pub threshold_rad: f64,
    /// Standard deviation of the depth caused by camera noise, metres.
    pub depth_sd_m: f64,
}

/// Contribution of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelDeviation {
    amplification: f64,
    calibration_sd_rad: f64,
    depth_sd_m: f64,
}

/// Returns the deviation at the middle of a segment, or `None` if C2 does not see that point, P does not light it, or
/// the phase in C2 is constant.
pub(super) fn at(setup: &RigSetup, assumptions: &Assumptions, segment: &Segment) -> Option<PixelDeviation> {
    let point = segment.at_share(0.5);
    if !setup.cam2_sees(&point) {
        return None;
    }
    setup.lit_phase_turns(&point)?;
    let (along_ray, along_segment) = slopes(setup, &point)?;
    Some(PixelDeviation {
        amplification: along_ray / along_segment,
        calibration_sd_rad: calibration_sd_rad(setup, assumptions, &point)?,
        depth_sd_m: SQRT_2 * assumptions.phase_sd_rad() / TAU * point.z / along_segment.abs(),
    })
}

/// Returns the change of phase in periods per relative change of depth: in the projector for points on the ray of C1,
/// and as seen by C2 on the flat surface through `point`.
fn slopes(setup: &RigSetup, point: &Point3) -> Option<(f64, f64)> {
    let surface = Surface::facing(setup, *point);
    let eye = setup.rig.centre_of_cam2();
    let [near, far] = [-DEPTH_STEP, DEPTH_STEP].map(|change| point * (1.0 + change));
    let along_ray = setup.phase_turns(&far)? - setup.phase_turns(&near)?;
    let seen = |point: &Point3| setup.phase_turns(&surface.intersection(&eye, point)?);
    let along_segment = seen(&far)? - seen(&near)?;
    let slopes = (along_ray / (2.0 * DEPTH_STEP), along_segment / (2.0 * DEPTH_STEP));
    (slopes.1.abs() > MIN_SLOPE).then_some(slopes)
}

fn calibration_sd_rad(setup: &RigSetup, assumptions: &Assumptions, point: &Point3) -> Option<f64> {
    let error_px = match assumptions.calibration {
        CalibrationQuality::SdRad(sd_rad) => return Some(sd_rad),
        CalibrationQuality::ErrorPx(error_px) => error_px,
    };
    let in_cam1 = setup.rig.cam1.project(point)?;
    let in_cam2 = setup.rig.project_cam2(point)?;
    let mut square = setup.pattern.period_px.powi(-2);
    for half in [Vector2Px::new(0.5, 0.0), Vector2Px::new(0.0, 0.5)] {
        let by_cam1 =
            back_projected(setup, &(in_cam1 + half), &in_cam2)? - back_projected(setup, &(in_cam1 - half), &in_cam2)?;
        let by_cam2 =
            back_projected(setup, &in_cam1, &(in_cam2 + half))? - back_projected(setup, &in_cam1, &(in_cam2 - half))?;
        square += by_cam1 * by_cam1 + by_cam2 * by_cam2;
    }
    Some(TAU * error_px * square.sqrt())
}

type Vector2Px = nalgebra::Vector2<f64>;

/// Back-projection phase of a correspondence, periods.
fn back_projected(setup: &RigSetup, in_cam1: &Pixel, in_cam2: &Pixel) -> Option<f64> {
    setup.phase_turns(&triangulate(&setup.rig, in_cam1, in_cam2)?.point_cam1)
}

/// Computes the root mean squares of the contributions.
pub(super) fn summary(assumptions: &Assumptions, all: &[PixelDeviation]) -> Option<Deviation> {
    let mean = |of: fn(&PixelDeviation) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let phase_sd_rad = assumptions.phase_sd_rad();
    let noise_gain = mean(|p| p.amplification.powi(2) + (1.0 - p.amplification).powi(2)).sqrt();
    let noise_sd_rad = noise_gain * phase_sd_rad;
    let calibration_sd_rad = mean(|p| p.calibration_sd_rad.powi(2)).sqrt();
    let sd_rad = noise_sd_rad.hypot(calibration_sd_rad);
    (!all.is_empty()).then(|| Deviation {
        phase_sd_rad,
        amplification: mean(|p| p.amplification),
        noise_sd_rad,
        calibration_sd_rad,
        sd_rad,
        threshold_rad: 3.0 * sd_rad,
        depth_sd_m: mean(|p| p.depth_sd_m.powi(2)).sqrt(),
    })
}
