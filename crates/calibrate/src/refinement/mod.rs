//! A better calibration from scans of anything (self-calibration from δ).
//!
//! In: a rig with the covariance of its error, and points of scans: where both cameras see them and the projector's column
//! that their phase tells. Out: the rig that is most probable after that. The column at which the triangulated point should
//! be lit differs from the measured one by δ; all parameters share the explanation according to their covariance, so that
//! those that δ does not see stay as they are, and are named. So do the epipolar lines. Cost: some milliseconds for a thousand points.

mod columns;
mod projector;
#[cfg(test)]
mod tests;

use fringeflow::geometry::{Camera, Pixel, Pose, Rig, triangulate};
use nalgebra::{DMatrix, DVector};

use crate::adjustment::{Device, Layout, PROJECTOR, State, loss, weight};
use crate::lens::{INTRINSIC_NAMES, INTRINSICS, Lens};
use crate::median::median;
use crate::quality::prediction::scan_sensitivity;
use crate::shape::BoardShape;

pub use columns::{ScanColumns, common_points};
pub use projector::projector_from_columns;

/// A point of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanPoint {
    /// Its pixel in C1.
    pub cam1_px: Pixel,
    /// Its image point in C2.
    pub cam2_px: Pixel,
    /// Column of the projector that its absolute phase tells, pixels.
    pub column_px: f64,
}

/// How well the columns fit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ColumnFit {
    /// Median of expected minus measured column, pixels of the projector.
    pub median_px: f64,
    /// Their standard deviation about it, from the median of its magnitude, pixels.
    pub sd_px: f64,
}

/// A rig after a refinement.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The rig.
    pub rig: Rig,
    /// Covariance of its parameters.
    pub covariance: DMatrix<f64>,
    /// The fit of the columns before and after.
    pub fits: [ColumnFit; 2],
    /// Points that took part, and points that fit no rig near the first one.
    pub used: [usize; 2],
    /// Parameters of which the scans tell nothing: their standard deviation is almost what it was.
    pub held: Vec<String>,
}

/// Fewest points of a refinement.
const FEWEST_POINTS: usize = 50;
/// Rounds, each with the noise that the last one left.
const ROUNDS: usize = 4;
/// Most steps of a round, and most halvings of a step.
const MAX_STEPS: usize = 30;
const MAX_HALVINGS: usize = 12;
/// Relative decrease of the cost below which a round has converged.
const CONVERGED: f64 = 1e-6;
/// Standard deviation of normal numbers over the median of their magnitudes.
const SD_PER_MEDIAN: f64 = 1.4826;
/// Standard deviation of the distance of a correspondence from its epipolar line, pixels: that of a usual calibration.
const EPIPOLAR_SD_PX: f64 = 0.1;
/// Least standard deviation of a column, pixels.
const LEAST_SD_PX: f64 = 1e-3;
/// A parameter is held if its standard deviation stays above this share.
const HELD_SHARE: f64 = 0.9;

/// Standard deviations of the error of a calibration whose covariance is not known: focal lengths (relative), principal
/// point (pixels), k1, k2, p1, p2, k3, turns (rad), shifts (metres). C1 gives the frame, so that its errors are those of
/// the others too.
const USUAL_SDS: ([f64; INTRINSICS], f64, f64) = ([3e-3, 3e-3, 3.0, 3.0, 0.02, 0.1, 1e-3, 1e-3, 0.3], 3e-3, 5e-4);

/// Factor of these standard deviations for cameras. They give the scale and hold it better than a projector, which is warm and
/// was measured through them; else δ, which tells little of the scale, would move them.
const CAMERAS: f64 = 0.1;
/// Factors of these standard deviations for a projector that was found by [`projector_from_columns`]: of focal lengths,
/// principal point and pose; and of its distortion, which no columns tell at the ends of its image.
const NEW_PROJECTOR: [f64; 2] = [30.0, 3.0];

/// The covariance of a calibration of which nothing is known but that it is a usual one.
#[must_use]
pub fn usual_covariance(rig: &Rig) -> DMatrix<f64> {
    scaled_covariance(rig, [1.0; 2])
}

/// The covariance of a rig whose cameras have a known one (that of their lenses, then of the pose of C2) and whose projector
/// was found by [`projector_from_columns`].
#[must_use]
pub fn new_projector_covariance(rig: &Rig, cameras: Option<&DMatrix<f64>>) -> DMatrix<f64> {
    let mut covariance = scaled_covariance(rig, NEW_PROJECTOR);
    let Some(cameras) = cameras else { return covariance };
    let layout = Layout::of(&state_of(rig));
    // Where the parameters of the cameras stand in the rig: those of the projector come in between.
    let place = |k: usize| if k < layout.lens(PROJECTOR) { k } else { k + INTRINSICS };
    for i in 0..cameras.nrows() {
        for j in 0..cameras.ncols() {
            covariance[(place(i), place(j))] = cameras[(i, j)];
        }
    }
    covariance
}

/// The usual covariance, with other standard deviations of the projector.
fn scaled_covariance(rig: &Rig, projector: [f64; 2]) -> DMatrix<f64> {
    let state = state_of(rig);
    let layout = Layout::of(&state);
    let mut sds = DVector::zeros(layout.rig());
    for (d, device) in state.devices.iter().enumerate() {
        let [factor, distortion] = if d == PROJECTOR { projector } else { [CAMERAS; 2] };
        let (lens, turn_rad, shift_m) = USUAL_SDS;
        for (k, sd) in lens.into_iter().enumerate() {
            sds[layout.lens(d) + k] = match k {
                0 | 1 => factor * sd * device.lens.0[k],
                2 | 3 => factor * sd,
                _ => distortion * sd,
            };
        }
        if let Some(at) = layout.arrangement(d) {
            for k in 0..6 {
                sds[at + k] = factor * if k < 3 { turn_rad } else { shift_m };
            }
        }
    }
    DMatrix::from_diagonal(&sds.map(|sd| sd * sd))
}

/// A rig as a state without boards. Terms of the distortion beyond k3 are not part of it.
pub(crate) fn state_of(rig: &Rig) -> State {
    let device = |camera: &Camera, from_first: Pose| {
        let ([fx, fy], [cx, cy], d) = (camera.focal_px(), camera.principal_px(), camera.distortion().to_opencv());
        Device { lens: Lens([fx, fy, cx, cy, d[0], d[1], d[2], d[3], d[4]]), from_first }
    };
    State {
        devices: vec![
            device(&rig.cam1, Pose::identity()),
            device(&rig.cam2, rig.cam2_from_cam1),
            device(&rig.projector, rig.projector_from_cam1),
        ],
        boards: Vec::new(),
        shape: BoardShape::flat(),
    }
}

/// The rig of a state, with the image sizes of another.
fn rig_of(state: &State, sizes: &Rig) -> Rig {
    let camera = |device: usize, like: &Camera| state.devices[device].lens.camera([like.width_px(), like.height_px()]);
    Rig {
        cam1: camera(0, &sizes.cam1),
        cam2: camera(1, &sizes.cam2),
        projector: camera(PROJECTOR, &sizes.projector),
        cam2_from_cam1: state.devices[1].from_first,
        projector_from_cam1: state.devices[PROJECTOR].from_first,
    }
}

/// Whether a rig has only the terms of distortion that a refinement changes.
#[must_use]
pub fn is_refinable(rig: &Rig) -> bool {
    [&rig.cam1, &rig.cam2, &rig.projector].iter().all(|camera| {
        let further = &camera.distortion().to_opencv()[5..];
        further.iter().all(|&k| k == 0.0) && camera.skew_px() == 0.0
    })
}

/// Refines a rig. `prior` is the covariance of its parameters. `None` if too few points fit.
///
/// Gauss-Newton with halved steps on a robust cost; the noise of the columns is found again in each round.
#[must_use]
pub fn refine(rig: &Rig, prior: &DMatrix<f64>, points: &[ScanPoint]) -> Option<Refined> {
    let known = prior.clone().cholesky()?.inverse() + epipolar_information(rig, points);
    let prior = &known.clone().cholesky()?.inverse();
    let scans = Scans { sizes: rig, points, known: &known };
    let mut at = Estimate { state: state_of(rig), moved: DVector::zeros(known.nrows()) };
    let before = scans.residuals(&at.state).fit()?;
    for _ in 0..ROUNDS {
        let sd_px = scans.residuals(&at.state).sd_px()?;
        at = scans.minimize(at, sd_px)?;
    }
    let residuals = scans.residuals(&at.state);
    let sd_px = residuals.sd_px()?;
    let covariance = scans.equations(&at, sd_px).0.cholesky()?.inverse();
    let used = residuals.within(sd_px);
    if used < FEWEST_POINTS {
        return None;
    }
    let held = held(&covariance, prior);
    let fits = [before, residuals.fit()?];
    Some(Refined { rig: rig_of(&at.state, rig), covariance, fits, used: [used, points.len() - used], held })
}

/// What the scans tell of the epipolar lines: that they are as good as before, since correspondences were found along them.
/// δ does not see a shift across them, and would otherwise be explained by one.
fn epipolar_information(rig: &Rig, points: &[ScanPoint]) -> DMatrix<f64> {
    let state = state_of(rig);
    let count = Layout::of(&state).rig();
    let mut information = DMatrix::zeros(count, count);
    for point in points {
        let Some(position) = triangulate(rig, &point.cam1_px, &point.cam2_px).map(|t| t.point_cam1) else { continue };
        let Some([_, across]) = scan_sensitivity(&state, &position.coords) else { continue };
        information.ger(1.0 / (EPIPOLAR_SD_PX * EPIPOLAR_SD_PX), &across, &across, 1.0);
    }
    information
}

/// A state on the way, and how far it is from the first one in the units of its parameters.
struct Estimate {
    state: State,
    moved: DVector<f64>,
}

impl Estimate {
    fn after(&self, step: &DVector<f64>) -> Self {
        Self { state: self.state.moved(step.as_view()), moved: &self.moved + step }
    }
}

/// What a refinement is computed from.
struct Scans<'a> {
    /// A rig with the sizes of the images.
    sizes: &'a Rig,
    points: &'a [ScanPoint],
    /// Inverse of the covariance before.
    known: &'a DMatrix<f64>,
}

/// Expected minus measured columns, pixels, of the points that the rig can triangulate.
struct Residuals(Vec<f64>);

impl Scans<'_> {
    fn residuals(&self, state: &State) -> Residuals {
        let rig = rig_of(state, self.sizes);
        let residual = |point: &ScanPoint| {
            let position = triangulate(&rig, &point.cam1_px, &point.cam2_px)?.point_cam1;
            Some(rig.project_projector(&position)?.x - point.column_px)
        };
        Residuals(self.points.iter().filter_map(residual).collect())
    }

    fn cost(&self, at: &Estimate, sd_px: f64) -> f64 {
        let residuals = self.residuals(&at.state).0;
        // What cannot be triangulated any more costs as much as an outlier.
        let lost = (self.points.len() - residuals.len()) as f64 * loss(f64::INFINITY);
        let columns: f64 = residuals.iter().map(|residual| loss(residual / sd_px)).sum();
        0.5 * at.moved.dot(&(self.known * &at.moved)) + columns + lost
    }

    /// Information and gradient of the cost. The rig before stays probable as far as its covariance says.
    fn equations(&self, at: &Estimate, sd_px: f64) -> (DMatrix<f64>, DVector<f64>) {
        let rig = rig_of(&at.state, self.sizes);
        let (mut information, mut gradient) = (self.known.clone(), self.known * &at.moved);
        for point in self.points {
            let Some(position) = triangulate(&rig, &point.cam1_px, &point.cam2_px).map(|t| t.point_cam1) else {
                continue;
            };
            let Some(lit) = rig.project_projector(&position) else { continue };
            let Some([by_rig, _]) = scan_sensitivity(&at.state, &position.coords) else { continue };
            let residual = lit.x - point.column_px;
            let weight = weight(residual.abs() / sd_px) / (sd_px * sd_px);
            information.ger(weight, &by_rig, &by_rig, 1.0);
            gradient.axpy(weight * residual, &by_rig, 1.0);
        }
        (information, gradient)
    }

    /// The estimate of the least cost near another; `None` if the equations have no solution.
    fn minimize(&self, start: Estimate, sd_px: f64) -> Option<Estimate> {
        let (mut cost, mut at) = (self.cost(&start, sd_px), start);
        for _ in 0..MAX_STEPS {
            let (information, gradient) = self.equations(&at, sd_px);
            let mut step = -information.cholesky()?.solve(&gradient);
            let mut found = None;
            for _ in 0..MAX_HALVINGS {
                let next = at.after(&step);
                let lower = self.cost(&next, sd_px);
                if lower < cost {
                    found = Some((next, lower));
                    break;
                }
                step *= 0.5;
            }
            let Some((next, lower)) = found else { break };
            let is_settled = cost - lower <= CONVERGED * cost;
            (at, cost) = (next, lower);
            if is_settled {
                break;
            }
        }
        Some(at)
    }
}

impl Residuals {
    /// Robust standard deviation about the median.
    fn sd_px(&self) -> Option<f64> {
        let middle = median(self.0.clone())?;
        let spread = self.0.iter().map(|residual| (residual - middle).abs()).collect();
        Some((SD_PER_MEDIAN * median(spread)?).max(LEAST_SD_PX))
    }

    fn fit(&self) -> Option<ColumnFit> {
        Some(ColumnFit { median_px: median(self.0.clone())?, sd_px: self.sd_px()? })
    }

    /// Number of residuals with full weight.
    fn within(&self, sd_px: f64) -> usize {
        self.0.iter().filter(|residual| weight(residual.abs() / sd_px) >= 1.0).count()
    }
}

/// Names of the parameters whose standard deviation the scans hardly lowered.
fn held(covariance: &DMatrix<f64>, prior: &DMatrix<f64>) -> Vec<String> {
    let names = parameter_names(3);
    let is_held = |k: &usize| covariance[(*k, *k)].sqrt() > HELD_SHARE * prior[(*k, *k)].sqrt();
    (0..covariance.nrows()).filter(is_held).map(|k| names[k].clone()).collect()
}

/// Names of the parameters of a rig of so many devices, in the order of their covariance: `fx_1` to `k3_p`, then turns and
/// shifts of C2 and projector, `rx_2` to `tz_p`.
pub(crate) fn parameter_names(devices: usize) -> Vec<String> {
    let suffixes = &["1", "2", "p"][..devices];
    let lenses = suffixes.iter().flat_map(|device| INTRINSIC_NAMES.map(|name| format!("{name}_{device}")));
    let pose = ["rx", "ry", "rz", "tx", "ty", "tz"];
    lenses.chain(suffixes[1..].iter().flat_map(|device| pose.map(|name| format!("{name}_{device}")))).collect()
}
