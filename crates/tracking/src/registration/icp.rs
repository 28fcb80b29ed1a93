//! ICP iteration: pair, step, pair again. It starts with few points and a long reach, and ends with many points and a
//! short reach.

use nalgebra::{Translation3, UnitQuaternion, Vector6};

use fringeflow::geometry::{Camera, Point3, Pose, Vector3};

use super::association::{Association, Pair, Parametrization};
use super::covariance::PoseCovariance;
use super::equations::{Equations, scale};
use super::outcome::{Lost, Registration, RegistrationSettings};
use super::smooth_error::gradient_covariance;
use super::surface::OrganizedSurface;
use super::thinning::{ReferencePoint, SampledPoints};

/// Levels from coarse to fine.
const LEVELS: [Level; 3] = [
    Level { points: 0.12, reach: 1.0, steps: 15 },
    Level { points: 0.35, reach: 0.3, steps: 8 },
    Level { points: 1.0, reach: 0.1, steps: 12 },
];
/// A level ends when a step is below this number of standard deviations.
const CONVERGED_SD: f64 = 0.05;
/// If the last step is larger, the registration fails. Pairs change from step to step, so the pose may oscillate a
/// little.
const MAX_LAST_STEP_SD: f64 = 1.0;

/// One level: shares of the points and of the reach, and the maximum number of steps.
struct Level {
    points: f64,
    reach: f64,
    steps: usize,
}

/// Result of the iterations of a level.
struct LevelResult {
    reference_from_moved: Pose,
    parametrization: Parametrization,
    pairs: usize,
    equations: Equations,
    scale: f64,
    last_step_sd: f64,
    /// The pairs of the last step.
    paired: Vec<Vec<Pair>>,
}

/// Registers a moved surface, as camera 1 sees it, to points of a reference, starting at a rough pose. The surface needs
/// no normals.
///
/// # Errors
/// [`Lost`], with its reason.
pub fn register(
    camera: &Camera,
    reference: &SampledPoints,
    moved: &OrganizedSurface,
    start: &Pose,
    settings: &RegistrationSettings,
) -> Result<Registration, Lost> {
    register_loosely(camera, reference, moved, start, settings)?.determined(settings)
}

/// As [`register`], but also succeeds if a motion maps the surface nearly onto itself. The pose is then meaningless
/// along that motion, and its covariance shows this.
///
/// # Errors
/// [`Lost`]. [`Lost::Degenerate`] occurs only for a surface without any relief.
pub fn register_loosely(
    camera: &Camera,
    reference: &SampledPoints,
    moved: &OrganizedSurface,
    start: &Pose,
    settings: &RegistrationSettings,
) -> Result<Registration, Lost> {
    // for each level, coarse to fine:
    //     tiles = a sample of the points of the reference
    //     repeat: pair by projection, solve the robust normal equations, move; until the step is small
    // judge the last level: overlap, residual, convergence, covariance
    let distance_m = moved.centre().coords.norm();
    let mut pose = *start;
    let mut last_level = None;
    for level in &LEVELS {
        let tiles = reference.tiles((settings.points as f64 * level.points) as usize);
        let tried: usize = tiles.iter().map(Vec::len).sum();
        let reach_m = settings.reach_share * level.reach * distance_m;
        let parametrization = parametrization_for(&tiles);
        let association = Association { camera, moved, reach_m, parametrization };
        let found = iterate(&association, &tiles, pose, level.steps)?;
        let too_few = found.pairs < settings.min_associated || (found.pairs as f64) < settings.min_share * tried as f64;
        // A surface far from its final pose has fewer partners, so only the last level must have enough.
        if too_few && level.points == 1.0 {
            return Err(Lost::TooFewInCommon { associated: found.pairs, tried });
        }
        pose = found.reference_from_moved;
        last_level = Some((found, tried));
    }
    let (found, tried) = last_level.ok_or(Lost::TooFewInCommon { associated: 0, tried: 0 })?;
    judge(&found, tried, distance_m, settings)
}

/// Iterates until the steps are small or their maximum number is reached.
fn iterate(
    association: &Association<'_>,
    tiles: &[Vec<ReferencePoint>],
    start: Pose,
    steps: usize,
) -> Result<LevelResult, Lost> {
    let mut pose = start;
    let mut last_step_sd = f64::INFINITY;
    let mut taken = 0;
    loop {
        let pairs = association.pairs(tiles, &pose);
        let scale = scale(&pairs);
        let equations = Equations::new(&pairs, scale);
        if taken == steps || last_step_sd <= CONVERGED_SD {
            let (parametrization, paired) = (association.parametrization, pairs);
            let pairs = paired.iter().map(Vec::len).sum();
            return Ok(LevelResult {
                reference_from_moved: pose,
                parametrization,
                pairs,
                equations,
                scale,
                last_step_sd,
                paired,
            });
        }
        let step = step(&pairs, &equations)?;
        last_step_sd = equations.step_sd(&step, scale);
        pose = moved_by(&association.parametrization, &step) * pose;
        taken += 1;
    }
}

fn step(pairs: &[Vec<Pair>], equations: &Equations) -> Result<Vector6<f64>, Lost> {
    let associated = pairs.iter().map(Vec::len).sum();
    if associated < 6 {
        return Err(Lost::TooFewInCommon { associated, tried: associated });
    }
    equations.step().ok_or(Lost::Degenerate { eigenvalue: equations.least_eigenvalue() })
}

fn judge(
    found: &LevelResult,
    tried: usize,
    distance_m: f64,
    settings: &RegistrationSettings,
) -> Result<Registration, Lost> {
    let equations = &found.equations;
    let (rms_m, limit_m) = (equations.rms_m(), settings.max_rms_share * distance_m);
    if rms_m > limit_m {
        return Err(Lost::ResidualTooLarge { rms_m, limit_m });
    }
    if found.last_step_sd > MAX_LAST_STEP_SD {
        return Err(Lost::NotConverged { step_sd: found.last_step_sd });
    }
    if !equations.shows_scatter() {
        return Err(Lost::TooFewInCommon { associated: found.pairs, tried });
    }
    let Parametrization { centre, radius_m } = found.parametrization;
    let smooth = gradient_covariance(&found.paired, found.scale);
    let least_eigenvalue = equations.least_eigenvalue();
    let covariance = equations.covariance(&smooth).ok_or(Lost::Degenerate { eigenvalue: least_eigenvalue })?;
    let covariance = covariance + equations.doubt(&covariance, settings.min_eigenvalue, distance_m);
    // The parameters are lengths, but the covariance of a pose has its rotation in rad.
    let in_rad = Vector6::new(1.0, 1.0, 1.0, 1.0 / radius_m, 1.0 / radius_m, 1.0 / radius_m);
    let covariance = nalgebra::Matrix6::from_fn(|i, j| covariance[(i, j)] * in_rad[i] * in_rad[j]);
    Ok(Registration {
        reference_from_moved: found.reference_from_moved,
        covariance: PoseCovariance::about(&centre, &covariance),
        associated: found.pairs,
        share: found.pairs as f64 / tried.max(1) as f64,
        rms_m,
        excess: found.scale,
        least_eigenvalue,
    })
}

/// Returns a parametrization with rotations about the mean of the points, scaled by their root mean square distance
/// from it.
fn parametrization_for(tiles: &[Vec<ReferencePoint>]) -> Parametrization {
    let count = tiles.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let points = || tiles.iter().flatten().map(|p| p.position().coords);
    let centre = points().sum::<Vector3>() / count;
    let square = points().map(|p| (p - centre).norm_squared()).sum::<f64>() / count;
    Parametrization { centre: Point3::from(centre), radius_m: square.sqrt().max(f64::MIN_POSITIVE) }
}

/// Returns the small motion of a step.
fn moved_by(parametrization: &Parametrization, step: &Vector6<f64>) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3) / parametrization.radius_m);
    let shift = Vector3::from(step.fixed_rows::<3>(0));
    let centre = parametrization.centre.coords;
    Pose::from_parts(Translation3::from(centre + shift - turn * centre), turn)
}
