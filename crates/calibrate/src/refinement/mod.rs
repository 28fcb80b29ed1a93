//! A better calibration from scans of anything (self-calibration from δ).
//!
//! In: a rig with the covariance of its error, and points of scans: where both cameras see them and the projector's column
//! that their phase tells. Out: the rig that is most probable after that. The column at which the triangulated point should
//! be lit differs from the measured one by δ; all parameters share the explanation according to their covariance, so that
//! those that δ does not see stay as they are, and are named. Cost: some milliseconds for a thousand points.

mod columns;
mod projector;
#[cfg(test)]
mod tests;

use fringeflow::geometry::{Camera, Pixel, Pose, Rig, triangulate};
use nalgebra::{DMatrix, DVector};

use crate::adjustment::{Device, Layout, PROJECTOR, State};
use crate::lens::{INTRINSIC_NAMES, INTRINSICS, Lens};
use crate::quality::prediction::column_sensitivity;
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
    /// Mean of expected minus measured column, pixels of the projector.
    pub mean_px: f64,
    /// Their standard deviation about the mean, pixels.
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
/// Most steps; each makes the error smaller by some orders of magnitude.
const MAX_STEPS: usize = 10;
/// Residuals beyond this multiple of their standard deviation belong to wrong correspondences.
const OUTLIER_SDS: f64 = 4.0;
/// Standard deviation of normal numbers over the median of their magnitudes.
const SD_PER_MEDIAN: f64 = 1.4826;
/// Least standard deviation of a column, pixels.
const LEAST_SD_PX: f64 = 1e-3;
/// A parameter is held if its standard deviation stays above this share.
const HELD_SHARE: f64 = 0.9;

/// Standard deviations of the error of a calibration whose covariance is not known: focal lengths (relative), principal
/// point (pixels), k1, k2, p1, p2, k3, turns (rad), shifts (metres). C1 gives the frame, so that its errors are those of
/// the others too.
const USUAL_SDS: ([f64; INTRINSICS], f64, f64) = ([3e-3, 3e-3, 3.0, 3.0, 0.02, 0.1, 1e-3, 1e-3, 0.3], 3e-3, 5e-4);

/// Factor of these standard deviations for a projector that was found by [`projector_from_columns`].
const NEW_PROJECTOR: f64 = 30.0;

/// The covariance of a calibration of which nothing is known but that it is a usual one.
#[must_use]
pub fn usual_covariance(rig: &Rig) -> DMatrix<f64> {
    scaled_covariance(rig, 1.0)
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
fn scaled_covariance(rig: &Rig, projector: f64) -> DMatrix<f64> {
    let state = state_of(rig);
    let layout = Layout::of(&state);
    let mut sds = DVector::zeros(layout.rig());
    for (d, device) in state.devices.iter().enumerate() {
        let factor = if d == PROJECTOR { projector } else { 1.0 };
        let (lens, turn_rad, shift_m) = USUAL_SDS;
        for (k, sd) in lens.into_iter().enumerate() {
            sds[layout.lens(d) + k] = factor * if k < 2 { sd * device.lens.0[k] } else { sd };
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
#[must_use]
pub fn refine(rig: &Rig, prior: &DMatrix<f64>, points: &[ScanPoint]) -> Option<Refined> {
    let start = state_of(rig);
    let known = prior.clone().cholesky()?.inverse();
    let (mut state, mut moved) = (start, DVector::zeros(known.nrows()));
    let mut fits = Vec::new();
    let mut outcome = None;
    for step in 0..=MAX_STEPS {
        let measured = Residuals::of(&rig_of(&state, rig), &state, points)?;
        fits.push(measured.fit());
        let mut information = known.clone();
        // The rig before stays probable as far as its covariance says.
        let mut gradient = &known * &moved;
        let weight = 1.0 / (measured.sd_px * measured.sd_px);
        for (residual, by_rig) in measured.residuals.iter().zip(&measured.by_rig) {
            information.ger(weight, by_rig, by_rig, 1.0);
            gradient.axpy(weight * residual, by_rig, 1.0);
        }
        let covariance = information.cholesky()?.inverse();
        let change = -(&covariance * gradient);
        let is_last = step == MAX_STEPS;
        outcome = Some((covariance, measured.used()));
        if is_last {
            break;
        }
        state = state.moved(change.as_view());
        moved += change;
    }
    let (covariance, used) = outcome?;
    let refined = rig_of(&state, rig);
    let held = held(&covariance, prior);
    Some(Refined { rig: refined, covariance, fits: [*fits.first()?, *fits.last()?], used, held })
}

/// Residuals of the points that fit, with their derivatives.
struct Residuals {
    residuals: Vec<f64>,
    by_rig: Vec<DVector<f64>>,
    sd_px: f64,
    left_out: usize,
}

impl Residuals {
    fn of(rig: &Rig, state: &State, points: &[ScanPoint]) -> Option<Self> {
        let residual = |point: &ScanPoint| {
            let position = triangulate(rig, &point.cam1_px, &point.cam2_px)?.point_cam1;
            let column_px = rig.project_projector(&position)?.x;
            Some((column_px - point.column_px, column_sensitivity(state, &position.coords)?))
        };
        let all: Vec<(f64, DVector<f64>)> = points.iter().filter_map(residual).collect();
        let median = median(all.iter().map(|(residual, _)| *residual).collect())?;
        let spread = all.iter().map(|(residual, _)| (residual - median).abs()).collect();
        let sd_px = (SD_PER_MEDIAN * self::median(spread)?).max(LEAST_SD_PX);
        let fits = |residual: f64| (residual - median).abs() <= OUTLIER_SDS * sd_px;
        let (residuals, by_rig): (Vec<_>, Vec<_>) = all.into_iter().filter(|(residual, _)| fits(*residual)).unzip();
        let left_out = points.len() - residuals.len();
        (residuals.len() >= FEWEST_POINTS).then_some(Self { residuals, by_rig, sd_px, left_out })
    }

    fn fit(&self) -> ColumnFit {
        let count = self.residuals.len() as f64;
        let mean_px = self.residuals.iter().sum::<f64>() / count;
        let square: f64 = self.residuals.iter().map(|residual| (residual - mean_px).powi(2)).sum();
        ColumnFit { mean_px, sd_px: (square / count).sqrt() }
    }

    fn used(&self) -> [usize; 2] {
        [self.residuals.len(), self.left_out]
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

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
