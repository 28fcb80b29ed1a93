//! Lengths, angles and coverage of a rig.

use std::f64::consts::TAU;

use serde::Serialize;

use fringeflow::calibration::likely_mistake;
use fringeflow::geometry::{Pixel, Point3, Vector3};

use super::segment::{self, Segment};
use super::{Assumptions, Device, RigReportError, RigSetup};

/// Number of cells along each axis of the volume. Their centres are tested.
const CELLS: usize = 16;

/// Lengths, angles and resolution at the centre of the volume.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Layout {
    /// Distance of C1 and C2, metres.
    pub base_cam1_cam2_m: f64,
    /// Distance of C1 and P, metres.
    pub base_cam1_projector_m: f64,
    /// Distance of C2 and P, metres.
    pub base_cam2_projector_m: f64,
    /// Place r of the projector along the base: 0 at C1, 1 at C2.
    pub projector_place_on_base: f64,
    /// Distance of the projector from the line through C1 and C2, metres.
    pub projector_off_base_m: f64,
    /// Angle at the centre of the volume between C1 and C2, rad.
    pub angle_cam1_cam2_rad: f64,
    /// Angle at the centre of the volume between C1 and P, rad.
    pub angle_cam1_projector_rad: f64,
    /// Angle at the centre of the volume between C2 and P, rad.
    pub angle_cam2_projector_rad: f64,
    /// Distance from C1 to the centre of the volume, metres.
    pub working_distance_m: f64,
    /// Extent of the volume along its depth axis, metres.
    pub volume_depth_m: f64,
    /// Width of a pixel of C1 projected to the centre of the volume, metres.
    pub pixel_footprint_m: f64,
    /// Depth (z of C1) that moves a point by one pixel in C2, metres.
    pub depth_per_pixel_m: f64,
    /// Depth (z of C1) that moves a point by one rad of the fringes, metres. It converts δ to the difference between
    /// the depth from both cameras and the depth from C1 and P. Infinite if the fringes do not depend on depth.
    pub depth_per_rad_m: f64,
    /// Period of the fringes, projector pixels.
    pub period_px: f64,
    /// Period of the fringes at the centre of the volume, perpendicular to the axis of the projector, metres.
    pub period_m: f64,
    /// Standard deviation of a wrapped phase caused by camera noise, rad.
    pub phase_sd_rad: f64,
}

/// Measurable parts of image and volume, as shares from 0 to 1.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Coverage {
    /// Share of the image of C1: pixels with a segment in the volume.
    pub image_with_segment: f64,
    /// Share of the image of C1: pixels whose segment has a lit middle that C2 sees.
    pub image_measurable: f64,
    /// Share of the volume that C1 sees.
    pub volume_seen_by_cam1: f64,
    /// Share of the volume that C2 sees.
    pub volume_seen_by_cam2: f64,
    /// Share of the volume that P lights.
    pub volume_lit: f64,
    /// Share of the volume that both cameras see and P lights.
    pub volume_measurable: f64,
}

/// Lengths and angles of a rig.
pub(super) fn layout(setup: &RigSetup, assumptions: &Assumptions) -> Layout {
    let rig = &setup.rig;
    let (cam2, projector, centre) = (rig.centre_of_cam2(), rig.centre_of_projector(), setup.centre_cam1());
    let r = rig.projector_place_on_base();
    let angle = |a: &Point3, b: &Point3| (a - centre).angle(&(b - centre));
    let depth_at_projector = (rig.projector_from_cam1 * centre).z;
    Layout {
        base_cam1_cam2_m: cam2.coords.norm(),
        base_cam1_projector_m: projector.coords.norm(),
        base_cam2_projector_m: (projector - cam2).norm(),
        projector_place_on_base: r,
        projector_off_base_m: (projector.coords - cam2.coords * r).norm(),
        angle_cam1_cam2_rad: angle(&Point3::origin(), &cam2),
        angle_cam1_projector_rad: angle(&Point3::origin(), &projector),
        angle_cam2_projector_rad: angle(&cam2, &projector),
        working_distance_m: centre.coords.norm(),
        volume_depth_m: setup.depth_m(),
        pixel_footprint_m: centre.z / rig.cam1.focal_px()[0],
        depth_per_pixel_m: depth_per_pixel_m(setup, &centre),
        depth_per_rad_m: depth_per_rad_m(setup, &centre),
        period_px: setup.pattern.period_px,
        period_m: setup.pattern.period_px * depth_at_projector / rig.projector.focal_px()[0],
        phase_sd_rad: assumptions.phase_sd_rad(),
    }
}

/// Depth that moves the image of a point on the ray of C1 by one pixel in C2: `z² / (f·b)` on a rectified rig.
fn depth_per_pixel_m(setup: &RigSetup, point: &Point3) -> f64 {
    let in_cam2 = setup.rig.cam2_from_cam1 * point;
    let moved: Vector3 = setup.rig.cam2_from_cam1.rotation * point.coords / point.z;
    // Derivative of (x/z, y/z) in C2 with respect to the depth in C1.
    let along = |i: usize| (moved[i] - in_cam2[i] / in_cam2.z * moved.z) / in_cam2.z * setup.rig.cam2.focal_px()[i];
    1.0 / along(0).hypot(along(1))
}

/// Depth that moves a point on the ray of C1 by one rad of the fringes.
fn depth_per_rad_m(setup: &RigSetup, point: &Point3) -> f64 {
    /// Change to either side, as a share of the distance.
    const STEP: f64 = 1e-3;
    let turns = |share: f64| {
        let pixel = setup.rig.project_projector(&Point3::from(point.coords * share))?;
        Some(setup.pattern.phase_turns(pixel.x))
    };
    let moved = turns(1.0 + STEP).zip(turns(1.0 - STEP)).map_or(0.0, |(far, near)| (far - near).abs());
    2.0 * STEP * point.z / (TAU * moved)
}

/// Computes the coverage of image and volume.
pub(super) fn coverage(setup: &RigSetup, grid_step_px: usize) -> Result<Coverage, RigReportError> {
    if let Some(mistake) = likely_mistake(&setup.rig, &setup.volume) {
        return Err(RigReportError::Mistake(mistake));
    }
    let [cam1, cam2, projector, all] = seen_shares(setup);
    let centre = setup.centre_cam1();
    for (device, share) in [(Device::Cam1, cam1), (Device::Cam2, cam2), (Device::Projector, projector)] {
        if share == 0.0 {
            return Err(RigReportError::NeverSeen { device, x_m: centre.x, y_m: centre.y, z_m: centre.z });
        }
    }
    if all == 0.0 {
        let [cam1, cam2, projector] = [cam1, cam2, projector].map(|share| 100.0 * share);
        return Err(RigReportError::NoOverlap { cam1, cam2, projector });
    }
    let pixels: Vec<Pixel> = segment::grid(&setup.rig.cam1, grid_step_px).into_iter().flatten().collect();
    let segments: Vec<Segment> = pixels.iter().filter_map(|pixel| Segment::new(setup, pixel)).collect();
    let measurable = segments.iter().map(|s| s.at_share(0.5));
    let measurable = measurable.filter(|p| setup.cam2_sees(p) && setup.lit_phase_turns(p).is_some()).count();
    Ok(Coverage {
        image_with_segment: segments.len() as f64 / pixels.len() as f64,
        image_measurable: measurable as f64 / pixels.len() as f64,
        volume_seen_by_cam1: cam1,
        volume_seen_by_cam2: cam2,
        volume_lit: projector,
        volume_measurable: all,
    })
}

/// Returns the shares of the volume that C1 sees, that C2 sees, that P lights, and all three.
fn seen_shares(setup: &RigSetup) -> [f64; 4] {
    let mut counts = [0u32; 4];
    for i in 0..CELLS.pow(3) {
        let cell = Vector3::new((i % CELLS) as f64, (i / CELLS % CELLS) as f64, (i / CELLS / CELLS) as f64);
        let share = (cell + Vector3::repeat(0.5)) / CELLS as f64;
        let (min, max) = (setup.volume.min(), setup.volume.max());
        let point = setup.volume.cam1_from_volume() * (min + (max - min).component_mul(&share));
        let by_cam1 = setup.rig.cam1.project(&point).is_some_and(|pixel| setup.rig.cam1.sees(&pixel));
        let seen = [by_cam1, setup.cam2_sees(&point), setup.lit_phase_turns(&point).is_some()];
        for (count, seen) in counts.iter_mut().zip([seen[0], seen[1], seen[2], seen.iter().all(|&s| s)]) {
            *count += u32::from(seen);
        }
    }
    counts.map(|count| f64::from(count) / CELLS.pow(3) as f64)
}
