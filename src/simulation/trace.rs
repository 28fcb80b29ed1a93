//! Where a ray first meets a scene, and whether anything stands between two places.
//!
//! Sphere tracing: a ray walks on by the value of the distance field, which never skips a surface, with a least step
//! that carries it across; the crossing is then bisected. Hits are true to [`TOLERANCE_MM`] along the ray; only a
//! sliver thinner than [`MIN_STEP_MM`] along the ray could be missed.

use super::scene::{Board, Scene, Surface};
use super::solid::{PointMm, Solid};

/// Bisection ends at this interval along the ray, millimetres.
const TOLERANCE_MM: f64 = 1e-6;
/// Least step along the ray, millimetres.
const MIN_STEP_MM: f64 = 4e-3;
/// Shadow rays start this far above their surface, millimetres: well above the tolerance of hits, well below anything
/// that a camera resolves.
const LIFT_MM: f64 = 1e-3;
/// Half the span of the differences that a normal is taken from, millimetres.
const NORMAL_SPAN_MM: f64 = 1e-4;

/// A ray in the frame of the object; the direction has length 1, the parameter is millimetres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: PointMm,
    pub(super) direction: PointMm,
}

/// A place where a ray meets the scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) point: PointMm,
    pub(super) normal: PointMm,
    pub(super) surface: Surface,
}

impl Ray {
    pub(super) fn at(&self, distance: f64) -> PointMm {
        self.origin + self.direction * distance
    }
}

/// The first place where a ray meets the scene.
pub(super) fn first_hit(scene: &Scene, ray: &Ray) -> Option<Hit> {
    let solid = scene.solid.as_ref();
    let board = board_distance(scene.board, ray);
    let object = march(solid, ray, board.unwrap_or(f64::INFINITY));
    if let Some(distance) = object {
        let point = ray.at(distance);
        return Some(Hit { point, normal: normal(solid, &point), surface: Surface::Object });
    }
    board.map(|distance| Hit { point: ray.at(distance), normal: PointMm::z(), surface: Surface::Board })
}

/// Whether light gets from a place of a surface to `target` (a centre of projection).
pub(super) fn is_free(scene: &Scene, hit: &Hit, target: &PointMm) -> bool {
    let origin = hit.point + hit.normal * LIFT_MM;
    let way = target - origin;
    if way.dot(&hit.normal) <= 0.0 || (scene.board != Board::None && target.z <= 0.0) {
        return false;
    }
    let length = way.norm();
    march(scene.solid.as_ref(), &Ray { origin, direction: way / length }, length).is_none()
}

fn board_distance(board: Board, ray: &Ray) -> Option<f64> {
    let distance = -ray.origin.z / ray.direction.z;
    (board != Board::None && ray.direction.z < 0.0 && distance > 0.0).then_some(distance)
}

/// Distance along the ray at which it enters the body before `limit`.
fn march(solid: &dyn Solid, ray: &Ray, limit: f64) -> Option<f64> {
    let (near, far) = clip(solid.bounds_mm(), ray)?;
    let (mut outside, end) = (near.max(0.0), far.min(limit));
    let mut distance = outside;
    while distance <= end {
        let free = solid.distance_mm(&ray.at(distance));
        if free < 0.0 {
            return Some(bisect(solid, ray, outside, distance));
        }
        outside = distance;
        distance += free.max(MIN_STEP_MM);
    }
    None
}

fn bisect(solid: &dyn Solid, ray: &Ray, mut outside: f64, mut inside: f64) -> f64 {
    while inside - outside > TOLERANCE_MM {
        let middle = 0.5 * (outside + inside);
        if solid.distance_mm(&ray.at(middle)) < 0.0 { inside = middle } else { outside = middle }
    }
    outside
}

/// Part of a ray inside a box.
fn clip((min, max): (PointMm, PointMm), ray: &Ray) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..3 {
        // A ray parallel to a side gets infinities of the right signs; on the side itself NaN, which min and max drop.
        let (a, b) = ((min[i] - ray.origin[i]) / ray.direction[i], (max[i] - ray.origin[i]) / ray.direction[i]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near < far).then_some((near, far))
}

/// Outward normal from differences of the field.
fn normal(solid: &dyn Solid, point: &PointMm) -> PointMm {
    let slope = |axis: PointMm| {
        solid.distance_mm(&(point + axis * NORMAL_SPAN_MM)) - solid.distance_mm(&(point - axis * NORMAL_SPAN_MM))
    };
    let gradient = PointMm::new(slope(PointMm::x()), slope(PointMm::y()), slope(PointMm::z()));
    gradient.try_normalize(0.0).unwrap_or_else(PointMm::z)
}
