//! Computes intersections of rays with a scene, and visibility between two points.
//!
//! The method is sphere tracing. A ray advances by the value of the distance field, so it skips no surface. A minimum
//! step carries it across the surface, and the crossing is then refined. Hits are accurate to [`TOLERANCE_MM`] along
//! the ray. Only a sliver thinner than [`MIN_STEP_MM`] along the ray can be missed.

use super::ray::Ray;
use super::scene::{Scene, Surface};
use super::solid::{PointMm, Solid};

/// Length of the interval along the ray at which the refinement ends, millimetres.
const TOLERANCE_MM: f64 = 1e-6;
/// Maximum number of steps of the refinement. It starts from micrometres and gains a factor of ten or more per step.
const MAX_REFINEMENTS: usize = 40;
/// Minimum step along the ray, millimetres.
const MIN_STEP_MM: f64 = 4e-3;
/// The same for shadow rays, which start at a surface, where free distances are short. A crest this thin is lower than a
/// ten-thousandth of a millimetre.
const MIN_SHADOW_STEP_MM: f64 = 0.05;
/// Factor by which a trial step exceeds the free distance.
const STRETCH: f64 = 1.7;
/// Height above the surface at which shadow rays start, millimetres: well above the tolerance of hits, well below the
/// resolution of a camera.
const LIFT_MM: f64 = 1e-3;
/// Step of the differences for a normal, millimetres.
const NORMAL_SPAN_MM: f64 = 1e-4;

/// An intersection of a ray with the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point in the frame of the object, millimetres.
    pub point: PointMm,
    /// Outward normal of the surface, length 1.
    pub normal: PointMm,
    /// The part of the scene that was hit.
    pub surface: Surface,
}

/// Returns the first intersection of a ray with the scene.
pub(super) fn first_hit(scene: &Scene, ray: &Ray) -> Option<Hit> {
    let board = scene.board.and_then(|board| Some((board.distance(ray)?, board.normal)));
    let mut nearest = board.map(|(distance, normal)| Hit { point: ray.at(distance), normal, surface: Surface::Board });
    let mut limit = board.map_or(f64::INFINITY, |(distance, _)| distance);
    for (solid, surface) in solids(scene) {
        if let Some(distance) = march(solid, ray, limit, MIN_STEP_MM) {
            let point = ray.at(distance);
            nearest = Some(Hit { point, normal: normal(solid, &point), surface });
            limit = distance;
        }
    }
    nearest
}

/// Iterates over the solids of a scene, without its board.
fn solids(scene: &Scene) -> impl Iterator<Item = (&dyn Solid, Surface)> {
    let hand = scene.hand.as_deref().map(|hand| (hand as &dyn Solid, Surface::Hand));
    std::iter::once((scene.solid.as_ref(), Surface::Object)).chain(hand)
}

/// Whether light from `target` (a centre of projection) reaches a point of a surface.
pub(super) fn is_free(scene: &Scene, hit: &Hit, target: &PointMm) -> bool {
    let origin = hit.point + hit.normal * LIFT_MM;
    let to_target = target - origin;
    if to_target.dot(&hit.normal) <= 0.0 || scene.board.is_some_and(|board| board.hides(&origin, target)) {
        return false;
    }
    let length = to_target.norm();
    let ray = Ray { origin, direction: to_target / length };
    solids(scene).all(|(solid, _)| march(solid, &ray, length, MIN_SHADOW_STEP_MM).is_none())
}

/// Returns the distance along the ray at which it enters the solid, if that is before `limit`.
///
/// Steps are stretched. A stretched step is accepted only if the balls of free space at both its ends meet (Keinert et
/// al. 2014, "Enhanced sphere tracing"), so nothing is skipped.
fn march(solid: &dyn Solid, ray: &Ray, limit: f64, min_step_mm: f64) -> Option<f64> {
    // outside = entry into the box
    // while outside is before the end:
    //     next = stretched step; if the balls of free space do not meet, an unstretched one of at least min_step_mm
    //     if next is inside: refine the crossing between outside and next
    let (near, far) = clip(solid.bounds_mm(), ray)?;
    let (mut outside, end) = (near.max(0.0), far.min(limit));
    let mut free = solid.distance_mm(&ray.at(outside));
    if free < 0.0 {
        return (outside <= end).then_some(outside);
    }
    while outside <= end {
        let mut next = outside + STRETCH * free;
        let mut there = solid.distance_mm(&ray.at(next));
        if there < 0.0 || free + there < next - outside || free < min_step_mm {
            next = outside + free.max(min_step_mm);
            there = solid.distance_mm(&ray.at(next));
        }
        if there < 0.0 {
            let hit = crossing(solid, ray, (outside, free), (next, there));
            return (hit <= end).then_some(hit);
        }
        (outside, free) = (next, there);
    }
    None
}

/// Finds the sign change of the field between a point outside and a point inside, each with its value (regula falsi in
/// the Illinois form, Dowell and Jarratt 1971).
fn crossing(solid: &dyn Solid, ray: &Ray, outside: (f64, f64), inside: (f64, f64)) -> f64 {
    let ((mut a, mut at_a), (mut b, mut at_b)) = (outside, inside);
    for _ in 0..MAX_REFINEMENTS {
        if b - a <= TOLERANCE_MM {
            break;
        }
        let c = (a * at_b - b * at_a) / (at_b - at_a);
        let at_c = solid.distance_mm(&ray.at(c));
        if at_c.abs() <= TOLERANCE_MM / 10.0 {
            return c;
        }
        // An end that stays twice gets half the weight, so that both ends converge.
        if at_c < 0.0 { (b, at_b, at_a) = (c, at_c, at_a / 2.0) } else { (a, at_a, at_b) = (c, at_c, at_b / 2.0) }
    }
    a
}

/// Returns the interval of a ray inside a box.
fn clip((min, max): (PointMm, PointMm), ray: &Ray) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..3 {
        // For a ray parallel to a side, the quotients are infinities of the right signs. If the ray lies in the side
        // itself, they are NaN, which min and max ignore.
        let (a, b) = ((min[i] - ray.origin[i]) / ray.direction[i], (max[i] - ray.origin[i]) / ray.direction[i]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near < far).then_some((near, far))
}

/// Returns the outward normal, from differences of the field.
fn normal(solid: &dyn Solid, point: &PointMm) -> PointMm {
    // Four corners of a tetrahedron are as accurate as six points along the axes.
    let corners = [[1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, 1.0, 1.0]].map(PointMm::from);
    let gradient: PointMm = corners.iter().map(|c| c * solid.distance_mm(&(point + c * NORMAL_SPAN_MM))).sum();
    gradient.try_normalize(0.0).unwrap_or_else(PointMm::z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::solid::{ellipsoid, sphere};

    /// A ball, with its exact field or a field far below it.
    struct Ball {
        low: bool,
    }

    impl Solid for Ball {
        fn distance_mm(&self, p: &PointMm) -> f64 {
            let centre = PointMm::new(1.0, -2.0, 12.0);
            let exact = sphere(p, centre, 10.0);
            if self.low { 0.3 * ellipsoid(p, centre, PointMm::repeat(10.0)) } else { exact }
        }

        fn bounds_mm(&self) -> (PointMm, PointMm) {
            (PointMm::new(-10.0, -13.0, 1.0), PointMm::new(12.0, 9.0, 23.0))
        }
    }

    #[test]
    fn hits_are_accurate_to_a_fraction_of_a_micrometre() {
        for low in [false, true] {
            let ball = Ball { low };
            for i in 0..2000 {
                let target = PointMm::new(f64::from(i % 50) * 0.5 - 11.5, f64::from(i / 50) * 0.6 - 14.0, 12.0);
                let origin = PointMm::new(40.0, 20.0, 300.0);
                let ray = Ray { origin, direction: (target - origin).normalize() };
                let to_centre = PointMm::new(1.0, -2.0, 12.0) - origin;
                let along = to_centre.dot(&ray.direction);
                let inside = 100.0 - (to_centre.norm_squared() - along * along);
                let found = march(&ball, &ray, f64::INFINITY, MIN_STEP_MM);
                // Rays through less than a sliver may miss.
                if inside > 1e-3 {
                    let error = found.unwrap() - (along - inside.sqrt());
                    assert!(error.abs() < 1e-5, "{error} mm off");
                } else if inside < 0.0 {
                    assert!(found.is_none());
                }
            }
        }
    }
}
