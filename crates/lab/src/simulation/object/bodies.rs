//! Simple bodies in any pose, as one solid: what the objects of many parts are made of.
//!
//! In: bodies with their shapes, poses and materials. Out: the solid of all of them. A ball around each body tells
//! whether it can be nearer than the nearest one so far, so most bodies cost one square root.

use nalgebra::UnitQuaternion;

use crate::simulation::solid::{Material, PointMm, Solid, cut, cylinder, ellipsoid, length, rounded_box, sphere};

/// The shape of a body, around the origin of its own frame. Lengths are in millimetres.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// A ball of this radius.
    Ball(f64),
    /// An ellipsoid with these half axes.
    Egg([f64; 3]),
    /// A block: half its size, and the radius of its edges.
    Block([f64; 3], f64),
    /// A rod along z: its radius and half its length.
    Rod(f64, f64),
    /// A pipe along z: its outer and inner radius and half its length.
    Pipe([f64; 2], f64),
    /// A ring about z: the radius of its middle line and that of its tube.
    Ring(f64, f64),
}

impl Shape {
    fn distance(self, p: &PointMm) -> f64 {
        match self {
            Self::Ball(radius) => sphere(p, PointMm::zeros(), radius),
            Self::Egg(radii) => ellipsoid(p, PointMm::zeros(), radii.into()),
            Self::Block(half, rounding) => rounded_box(p, PointMm::zeros(), half.into(), rounding),
            Self::Rod(radius, half) => cylinder(p, [0.0; 2], radius, [-half, half], 0.1),
            Self::Pipe([outer, inner], half) => {
                let hole = length(p.x, p.y) - inner;
                cut(cylinder(p, [0.0; 2], outer, [-half, half], 0.1), hole)
            }
            Self::Ring(radius, tube) => length(length(p.x, p.y) - radius, p.z) - tube,
        }
    }

    /// Radius of the ball around the origin that encloses the shape.
    pub(super) fn reach(self) -> f64 {
        match self {
            Self::Ball(radius) => radius,
            Self::Egg(radii) => radii.into_iter().fold(0.0, f64::max),
            Self::Block(half, _) => PointMm::from(half).norm(),
            Self::Rod(radius, half) | Self::Pipe([radius, _], half) => length(radius, half),
            Self::Ring(radius, tube) => radius + tube,
        }
    }
}

/// A shape in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    shape: Shape,
    centre: PointMm,
    body_from_object: UnitQuaternion<f64>,
    material: Material,
}

impl Body {
    /// A plaster body around `centre`, upright.
    pub(super) fn new(shape: Shape, centre: [f64; 3]) -> Self {
        let (centre, body_from_object) = (centre.into(), UnitQuaternion::identity());
        Self { shape, centre, body_from_object, material: Material::PLASTER }
    }

    /// This body, turned by angles about x, y and z, rad.
    pub(super) fn turned(self, [x, y, z]: [f64; 3]) -> Self {
        Self { body_from_object: UnitQuaternion::from_euler_angles(x, y, z).inverse(), ..self }
    }

    pub(super) fn of_material(self, material: Material) -> Self {
        Self { material, ..self }
    }

    fn distance(&self, point: &PointMm) -> f64 {
        // The field of an ellipsoid is far below the distance in places where the ball knows better.
        self.shape.distance(&(self.body_from_object * (point - self.centre))).max(self.least_distance(point))
    }

    /// A lower bound of the distance that costs little.
    fn least_distance(&self, point: &PointMm) -> f64 {
        (point - self.centre).norm() - self.shape.reach()
    }
}

/// Several bodies as one solid.
pub(super) struct Bodies {
    bodies: Vec<Body>,
    bounds: (PointMm, PointMm),
}

impl Bodies {
    /// Joins bodies within a box.
    pub(super) fn new(bodies: Vec<Body>, bounds: ([f64; 3], [f64; 3])) -> Self {
        Self { bodies, bounds: (bounds.0.into(), bounds.1.into()) }
    }

    /// Joins bodies whose box is that around their balls.
    pub(super) fn apart(bodies: Vec<Body>) -> Self {
        let corner = |sign: f64, start: f64, choose: fn(f64, f64) -> f64| {
            bodies.iter().fold(PointMm::repeat(start), |corner, body| {
                corner.zip_map(&body.centre.add_scalar(sign * body.shape.reach()), choose)
            })
        };
        let bounds = (corner(-1.0, f64::INFINITY, f64::min), corner(1.0, f64::NEG_INFINITY, f64::max));
        Self { bodies, bounds }
    }

    /// Number of bodies.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.bodies.len()
    }

    fn nearest(&self, point: &PointMm) -> Option<(f64, &Body)> {
        self.bodies.iter().fold(None, |nearest: Option<(f64, &Body)>, body| {
            let limit = nearest.map_or(f64::INFINITY, |(distance, _)| distance);
            if body.least_distance(point) >= limit {
                return nearest;
            }
            let distance = body.distance(point);
            if distance < limit { Some((distance, body)) } else { nearest }
        })
    }
}

impl Solid for Bodies {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        self.nearest(point).map_or(f64::INFINITY, |(distance, _)| distance)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        self.bounds
    }

    fn material(&self, point: &PointMm) -> Material {
        self.nearest(point).map_or(Material::PLASTER, |(_, body)| body.material)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipping_far_bodies_changes_no_distance() {
        let shapes = [
            Shape::Ball(4.0),
            Shape::Egg([3.0, 5.0, 2.0]),
            Shape::Block([2.0, 4.0, 1.0], 0.3),
            Shape::Rod(1.0, 6.0),
            Shape::Pipe([4.0, 3.0], 5.0),
            Shape::Ring(6.0, 1.5),
        ];
        let place = |i: usize| [11.0 * i as f64 - 30.0, 5.0 * (i % 3) as f64, 8.0];
        let bodies: Vec<Body> = shapes
            .into_iter()
            .enumerate()
            .map(|(i, shape)| Body::new(shape, place(i)).turned([0.3 * i as f64, 0.5, -0.2]))
            .collect();
        let all = Bodies::apart(bodies.clone());
        let (min, max) = all.bounds_mm();
        for i in 0..20_000 {
            let share = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|a: f64| (a * f64::from(i)).fract() * 1.4 - 0.2);
            let p = min + (max - min).component_mul(&PointMm::from(share));
            let least = bodies.iter().map(|body| body.distance(&p)).fold(f64::INFINITY, f64::min);
            assert_eq!(all.distance_mm(&p), least);
            let is_inside = (0..3).all(|axis| p[axis] >= min[axis] && p[axis] <= max[axis]);
            assert!(is_inside || least > 0.0, "{p}");
        }
    }
}
