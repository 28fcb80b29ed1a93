//! Which further poses of the board would make a calibration better.
//!
//! Every candidate pose is seen in thought: what both cameras and the projector would measure of it is added to the
//! information about the rig, and the expected error of measurements is computed again. The pose with the smallest error
//! is proposed, then the best one beside it, and so on. No rule says what a good set of poses looks like.

use fringeflow::geometry::{Point3, Pose, Vector3};
use nalgebra::{DMatrix, Translation3, UnitQuaternion, Vector2};

use super::prediction::{ExpectedError, Probes};
use crate::adjustment::{Adjusted, Layout, Problem, State};
use crate::pose_words::PoseWords;

/// Tilts of candidates, degrees.
const TILT_DEG: f64 = 30.0;
/// Where in the image the middle of the board is, as a share of its width and height.
const PLACES: [f64; 3] = [0.25, 0.5, 0.75];
/// A pose is not proposed if it lowers the expected error by less than this share.
const WORTHWHILE: f64 = 0.05;
/// Most poses that are proposed.
const MOST: usize = 4;

/// A further pose that helps.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedPose {
    /// Pose of the board in the frame of C1.
    pub cam1_from_board: Pose,
    /// What it is in words.
    pub words: PoseWords,
    /// Expected errors with this pose and those before it.
    pub expected: ExpectedError,
}

/// Proposes poses in the order in which they help. Empty if none is worthwhile.
#[must_use]
pub fn proposed(problem: &Problem, adjusted: &Adjusted, probes: &Probes, period_px: f64) -> Vec<ProposedPose> {
    let rig = Layout::of(&adjusted.state).rig();
    let mut covariance = adjusted.covariance.view((0, 0), (rig, rig)).into_owned();
    let candidates: Vec<(PoseWords, Pose, DMatrix<f64>)> = candidates(problem, adjusted)
        .into_iter()
        .filter_map(|(words, pose)| Some((words, pose, information(problem, adjusted, &pose)?)))
        .collect();
    let mut proposed = Vec::new();
    while proposed.len() < MOST {
        let Some(now) = probes.rms(&covariance) else { break };
        let Some(known) = covariance.clone().cholesky().map(|c| c.inverse()) else { break };
        let with = candidates.iter().filter_map(|(words, pose, more)| {
            let covariance = (&known + more).cholesky()?.inverse();
            let expected = probes.rms(&covariance)?;
            Some((badness(&expected, period_px), *words, *pose, expected, covariance))
        });
        let Some(best) = with.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if best.0 > badness(&now, period_px) * (1.0 - WORTHWHILE) {
            break;
        }
        covariance = best.4;
        proposed.push(ProposedPose { cam1_from_board: best.2, words: best.1, expected: best.3 });
    }
    proposed
}

/// What matters to a scan: δ, which decides fringe orders, and depth. A tenth of a millimetre counts as much as a tenth
/// of a radian.
fn badness(expected: &ExpectedError, period_px: f64) -> f64 {
    expected.depth_mm.hypot(expected.delta_rad(period_px))
}

/// Poses in which C1 sees the board at several places, distances and tilts.
fn candidates(problem: &Problem, adjusted: &Adjusted) -> Vec<(PoseWords, Pose)> {
    let state = &adjusted.state;
    let mut depths_m: Vec<f64> = state.boards.iter().map(|board| board.translation.z).collect();
    depths_m.sort_by(f64::total_cmp);
    let (Some(&near_m), Some(&far_m)) = (depths_m.first(), depths_m.last()) else { return Vec::new() };
    let middle_m = depths_m[depths_m.len() / 2];
    // Nearer and farther than anything yet by a twentieth, so that a set at one distance gets others.
    let distances_m = [near_m.min(0.95 * middle_m), middle_m, far_m.max(1.05 * middle_m)];
    let camera = state.devices[0].lens.camera(problem.sizes_px[0]);
    let mut candidates = Vec::new();
    for (row, v) in PLACES.into_iter().enumerate() {
        for (column, u) in PLACES.into_iter().enumerate() {
            for (distance, depth_m) in distances_m.into_iter().enumerate() {
                for tilt in PoseWords::TILTS {
                    let [width, height] = problem.sizes_px[0].map(|side| side as f64);
                    let Some(ray) = camera.ray(&nalgebra::Point2::new(u * width, v * height)) else { continue };
                    let [about_x, about_y] = tilt.map(|turn| f64::from(turn) * TILT_DEG.to_radians());
                    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(about_x, about_y, 0.0));
                    let pose = Pose::from_parts(Translation3::from(ray * depth_m), turn);
                    let place = [column, row, distance].map(|k| k as i8 - 1);
                    candidates.push((PoseWords { place, tilt }, pose));
                }
            }
        }
    }
    candidates
}

/// Information about the rig that a pose adds, after its own six parameters are eliminated; `None` if the board is not
/// seen by all devices.
fn information(problem: &Problem, adjusted: &Adjusted, pose: &Pose) -> Option<DMatrix<f64>> {
    let state = State { boards: vec![*pose], ..adjusted.state.clone() };
    let layout = Layout::of(&state);
    let rig = layout.rig();
    let mut full = DMatrix::<f64>::zeros(layout.len(), layout.len());
    for device in 0..state.devices.len() {
        let sd_px = noise_px(problem, adjusted, device);
        let camera = state.devices[device].lens.camera(problem.sizes_px[device]);
        let mut seen = 0;
        for position_m in &problem.features_m {
            let Some(columns) = columns(&state, device, *position_m, &camera) else { continue };
            seen += 1;
            for (i, (at, column)) in columns.iter().enumerate() {
                for (other, other_column) in &columns[..=i] {
                    let value = column.dot(other_column) / (sd_px * sd_px);
                    full[(*at, *other)] += value;
                    if at != other {
                        full[(*other, *at)] += value;
                    }
                }
            }
        }
        // A board of which one device sees little is no help.
        if 2 * seen < problem.features_m.len() {
            return None;
        }
    }
    let pose_at = layout.board(0);
    let own = full.view((pose_at, pose_at), (6, 6)).into_owned().try_inverse()?;
    let across = full.view((0, pose_at), (rig, 6)).into_owned();
    Some(full.view((0, 0), (rig, rig)) - &across * own * across.transpose())
}

/// Derivatives of the image of a board point, if the device sees it.
fn columns(
    state: &State,
    device: usize,
    position_m: Vector2<f64>,
    camera: &fringeflow::geometry::Camera,
) -> Option<Vec<(usize, Vector2<f64>)>> {
    let from_first = &state.devices[device].from_first;
    let point = from_first * Point3::from(state.point(0, position_m));
    let pixel = camera.project(&point)?;
    if !camera.sees(&pixel) {
        return None;
    }
    crate::adjustment::derivatives_of_pixel(state, device, position_m, pixel)
}

/// Standard deviation of a coordinate that a device measures, pixels. That of the projector is measured through a camera.
fn noise_px(problem: &Problem, adjusted: &Adjusted, device: usize) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for measurement in problem.measurements.iter().filter(|m| m.measures(device)) {
        let sd_px = measurement.relative_sd() * adjusted.groups[measurement.group].noise;
        squares += sd_px.norm_squared() / 2.0;
        count += 1.0;
    }
    f64::sqrt(squares / f64::max(count, 1.0))
}
