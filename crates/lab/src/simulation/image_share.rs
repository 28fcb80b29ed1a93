//! Scales an object so that it fills a given share of the image of C1.
//!
//! In: an object, its position, and the share. Out: the factor by which it is scaled about its foot on the board.

use fringeflow::geometry::Pixel;
use fringeflow_dataset::CameraId;

use super::scene::Surface;
use super::trace::first_hit;
use super::view::Eye;
use super::{Board, Object, Scene, SimulationError, VirtualRig, check_range};

/// Smallest and largest share, percent.
const MIN_PERCENT: f64 = 0.1;
const MAX_PERCENT: f64 = 60.0;
/// Stride of the tested pixels in a row, and of the rows.
const STRIDE_PX: usize = 3;
/// Maximum number of steps of the search, and its relative tolerance.
const MAX_STEPS: usize = 12;
const TOLERANCE: f64 = 0.01;

/// Finds the factor with which an object fills `percent` of the image of C1, without boards and hands.
pub(super) fn factor(
    rig: &VirtualRig,
    object: Object,
    shift_mm: [f64; 3],
    percent: f64,
) -> Result<f64, SimulationError> {
    check_range("the share of the image", percent, MIN_PERCENT, MAX_PERCENT, "%")?;
    let (mut factor, mut found) = (1.0, 0.0);
    for _ in 0..MAX_STEPS {
        let scene = Scene::from_shifted_object(object, shift_mm, Board::None, &rig.exact_volume).scaled(object, factor);
        found = percent_of_image(rig, &scene);
        if (found / percent - 1.0).abs() <= TOLERANCE {
            return Ok(factor);
        }
        // An object that is not seen at all may be too small, or outside the image.
        factor *= (percent / found.max(MIN_PERCENT / 10.0)).sqrt().clamp(0.3, 3.0);
    }
    Err(SimulationError::Share { object: object.name(), percent, found_percent: found })
}

/// Returns the share of the image of C1 that the object fills, percent.
fn percent_of_image(rig: &VirtualRig, scene: &Scene) -> f64 {
    let eye = Eye::new(&rig.exact, scene, CameraId::Cam1);
    let (width, height) = (rig.exact.cam1.width_px(), rig.exact.cam1.height_px());
    let pixels = || (0..height).step_by(STRIDE_PX).flat_map(|v| (0..width).step_by(STRIDE_PX).map(move |u| (u, v)));
    let is_object = |&(u, v): &(usize, usize)| {
        let ray = eye.ray(&Pixel::new(u as f64, v as f64));
        ray.and_then(|ray| first_hit(scene, &ray)).is_some_and(|hit| hit.surface == Surface::Object)
    };
    100.0 * pixels().filter(is_object).count() as f64 / pixels().count() as f64
}
