//! Solids as signed distance functions, and the primitives they are put together from.
//!
//! Lengths in millimetres, in the frame of the object: x right, y up, z towards the sensor, the board it lies on at
//! z = 0. Every function here changes by at most the distance its argument moves (Lipschitz constant 1), so that a ray
//! may always walk on by the value. Values are exact at the surface and a lower bound of the distance elsewhere.

/// A point or direction in the frame of an object, millimetres.
pub type PointMm = nalgebra::Vector3<f64>;

/// A body that rays can be traced against.
pub trait Solid: Send + Sync {
    /// Lower bound of the distance to the surface, negative inside, zero on it.
    fn distance_mm(&self, point: &PointMm) -> f64;

    /// Corners (least, largest) of a box that encloses the body.
    fn bounds_mm(&self) -> (PointMm, PointMm);
}

/// Ball about `centre`.
pub(super) fn sphere(p: &PointMm, centre: PointMm, radius: f64) -> f64 {
    (p - centre).norm() - radius
}

/// Ellipsoid with axes along x, y and z.
pub(super) fn ellipsoid(p: &PointMm, centre: PointMm, radii: PointMm) -> f64 {
    let inside = (p - centre).component_div(&radii).norm() - 1.0;
    inside * radii.min()
}

/// Box with rounded edges; `half` is half its size, rounding included.
pub(super) fn rounded_box(p: &PointMm, centre: PointMm, half: PointMm, rounding: f64) -> f64 {
    let q = (p - centre).abs() - half.add_scalar(-rounding);
    q.sup(&PointMm::zeros()).norm() + q.max().min(0.0) - rounding
}

/// Cylinder along z from `low` to `high` with rounded edges, about the z axis through `centre` (x, y).
pub(super) fn cylinder(p: &PointMm, centre: [f64; 2], radius: f64, [low, high]: [f64; 2], rounding: f64) -> f64 {
    let across = (p.x - centre[0]).hypot(p.y - centre[1]) - radius + rounding;
    let along = (p.z - 0.5 * (low + high)).abs() - 0.5 * (high - low) + rounding;
    across.max(0.0).hypot(along.max(0.0)) + across.max(along).min(0.0) - rounding
}

/// Round bar from `a` to `b` whose radius changes linearly.
pub(super) fn round_cone(p: &PointMm, a: (PointMm, f64), b: (PointMm, f64)) -> f64 {
    let axis = b.0 - a.0;
    let share = ((p - a.0).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
    let slope = (b.1 - a.1) / axis.norm();
    let outside = (p - a.0 - axis * share).norm() - (a.1 + (b.1 - a.1) * share);
    outside / slope.hypot(1.0)
}

/// Union of two bodies with a fillet of about `fillet`.
pub(super) fn smooth_union(a: f64, b: f64, fillet: f64) -> f64 {
    let overlap = (fillet - (a - b).abs()).max(0.0) / fillet;
    a.min(b) - overlap * overlap * fillet * 0.25
}

/// The first body without the second, the edge rounded by about `fillet`.
pub(super) fn smooth_cut(body: f64, tool: f64, fillet: f64) -> f64 {
    -smooth_union(-body, tool, fillet)
}

/// The first body without the second.
pub(super) fn cut(body: f64, tool: f64) -> f64 {
    body.max(-tool)
}

/// Turns a point about the z axis through the origin, which turns a body the other way.
pub(super) fn turned(p: &PointMm, angle_rad: f64) -> PointMm {
    let (sin, cos) = angle_rad.sin_cos();
    PointMm::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)
}

/// Folds the plane into one of `count` equal sectors, the one about the x axis: what is cut there is cut in all.
pub(super) fn sector(p: &PointMm, count: f64) -> PointMm {
    let width = std::f64::consts::TAU / count;
    let angle = p.y.atan2(p.x);
    turned(p, -(angle / width).round() * width)
}
