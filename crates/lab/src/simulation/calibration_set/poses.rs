//! Poses of a board that is held by hand: all over the images of both cameras and the projector, in and around the
//! measurement volume, and tilted by up to 45° about axes in all directions.
//!
//! View k is aimed at a drawn point of the image of C1, C2 or the projector in turn. Every fourth is near a corner of
//! the image, so part of the board lies outside. Every fifth is nearly untilted, every sixth is turned by 90°. A pose
//! that shows too little is drawn again, closer to the middle and less tilted from try to try.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Rotation3, Translation3, UnitQuaternion};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Camera, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3};

use super::super::SimulationError;
use super::surface::{Surface, in_cam1};

/// Tries for a pose.
const TRIES: u32 = 400;
/// Smallest and largest tilt, and that of the nearly untilted views.
const TILT_RAD: [f64; 2] = [0.2, 0.785];
const UPRIGHT_RAD: f64 = 0.12;
/// Largest turn about the normal.
const ROLL_RAD: f64 = 0.25;
/// Share of the distance that the depth varies at least.
const DEPTH_SHARE: f64 = 0.08;
/// Least cosine between the normal of the board and the direction to a device.
const LEAST_COSINE: f64 = 0.4;
/// Least share of the features that each device must see; of a board without markers both cameras must see all.
const LEAST_SHARE: f64 = 0.3;
/// Distance from the border of an image at which a feature counts as seen, pixels.
const BORDER_PX: f64 = 8.0;

/// Draws the poses `cam1_from_board` of all views.
pub(super) fn draw(
    rig: &Rig,
    volume: &MeasurementVolume,
    surface: &Surface<'_>,
    views: usize,
    seed: u64,
) -> Result<Vec<Pose>, SimulationError> {
    let drawn = |view: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(view as u64));
        let mut tries = (0..TRIES).map(|k| {
            let calm = 1.0 - f64::from(k) / f64::from(TRIES);
            pose(rig, volume, view, calm, &mut rng)
        });
        let seen = tries.find_map(|pose| pose.filter(|pose| is_seen(rig, surface, pose)));
        seen.ok_or_else(|| SimulationError::BoardUnseen { board: surface.board().to_string(), view })
    };
    (0..views).map(drawn).collect()
}

/// A device: its lens, and its frame.
fn devices(rig: &Rig) -> [(&Camera, Pose); 3] {
    [(&rig.cam1, Pose::identity()), (&rig.cam2, rig.cam2_from_cam1), (&rig.projector, rig.projector_from_cam1)]
}

/// Draws a pose; `calm` is 1 for all freedom, and 0 for the middle of the image without tilt.
fn pose(rig: &Rig, volume: &MeasurementVolume, view: usize, calm: f64, rng: &mut ChaCha8Rng) -> Option<Pose> {
    let mut between = |from: f64, to: f64| from + (to - from) * rng.random::<f64>();
    let (lens, device_from_cam1) = devices(rig)[view % 3];
    let is_corner = view % 4 == 3;
    let mut place = |size: usize| {
        let off = if is_corner { between(0.25, 0.42).copysign(between(-1.0, 1.0)) } else { between(-0.3, 0.3) };
        (0.5 + calm * off) * size as f64
    };
    let pixel = Pixel::new(place(lens.width_px()), place(lens.height_px()));
    let cam1_from_volume = volume.cam1_from_volume();
    let volume_from_device = cam1_from_volume.inverse() * device_from_cam1.inverse();
    let (origin, ray) = (volume_from_device * Point3::origin(), volume_from_device.rotation * lens.ray(&pixel)?);
    let middle_z = (volume.min().z + volume.max().z) / 2.0;
    let reach = ((volume.max().z - volume.min().z) / 2.0).max(DEPTH_SHARE * (middle_z - origin.z));
    let depth = middle_z + calm * between(-reach, reach);
    let target = origin + ray * ((depth - origin.z) / ray.z);
    let tilt = if view.is_multiple_of(5) { between(0.0, UPRIGHT_RAD) } else { between(TILT_RAD[0], TILT_RAD[1]) };
    let (sin, cos) = between(0.0, TAU).sin_cos();
    let axis = nalgebra::Unit::new_normalize(Vector3::new(cos, sin, 0.0));
    let turn = between(-ROLL_RAD, ROLL_RAD) + if view % 6 == 5 { FRAC_PI_2 } else { 0.0 };
    let rotation =
        Rotation3::from_axis_angle(&axis, calm * tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    let volume_from_board =
        Pose::from_parts(Translation3::from(target.coords), UnitQuaternion::from_rotation_matrix(&rotation));
    Some(cam1_from_volume * volume_from_board)
}

/// Whether cameras and projector see enough of the board.
fn is_seen(rig: &Rig, surface: &Surface<'_>, pose: &Pose) -> bool {
    let features = surface.features();
    let normal = pose * Vector3::new(0.0, 0.0, -1.0);
    let has_markers = !surface.board().markers().is_empty();
    devices(rig).into_iter().enumerate().all(|(device, (lens, device_from_cam1))| {
        let eye = device_from_cam1.inverse() * Point3::origin();
        let is_seen = |feature: &&[f64; 3]| {
            let point = in_cam1(pose, feature);
            let is_facing = (eye - point).normalize().dot(&normal) >= LEAST_COSINE;
            let is_inside = |pixel: Pixel| {
                let inside = |c: f64, size: usize| (BORDER_PX..size as f64 - 1.0 - BORDER_PX).contains(&c);
                inside(pixel.x, lens.width_px()) && inside(pixel.y, lens.height_px())
            };
            is_facing && lens.project(&(device_from_cam1 * point)).is_some_and(is_inside)
        };
        let seen = features.iter().filter(is_seen).count() as f64;
        let least = if has_markers || device == 2 { LEAST_SHARE } else { 1.0 };
        seen >= least * features.len() as f64
    })
}
