//! Solids as signed distance functions, and their primitives.
//!
//! Lengths are in millimetres in the frame of the object: x right, y up, z towards the sensor, the board at z = 0. The
//! value of each function here changes by at most the distance that its argument moves (Lipschitz constant 1), so a ray
//! may always advance by the value. Values are exact at the surface and a lower bound of the distance elsewhere.

/// Millimetres in a metre.
pub(super) const MM_PER_M: f64 = 1e3;

/// A point or direction in the frame of an object, millimetres.
pub type PointMm = nalgebra::Vector3<f64>;

/// A solid that rays can be traced against.
pub trait Solid: Send + Sync {
    /// Lower bound of the distance to the surface, negative inside, zero on it.
    fn distance_mm(&self, point: &PointMm) -> f64;

    /// Corners (min, max) of a box that encloses the solid.
    fn bounds_mm(&self) -> (PointMm, PointMm);

    /// Material of the surface nearest to a point.
    fn material(&self, _point: &PointMm) -> Material {
        Material::PLASTER
    }
}

/// Reflection of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Albedo relative to plaster.
    pub brightness: f64,
    /// Specular reflection, relative to the light scattered by a white surface facing the projector; 0 for a matt
    /// surface. From about 1 on, highlights saturate the camera.
    pub gloss: f64,
}

impl Material {
    /// Bright and matt.
    pub const PLASTER: Self = Self { brightness: 1.0, gloss: 0.0 };
    /// Matt, with an albedo of about 0.1.
    pub const DARK: Self = Self { brightness: 0.125, gloss: 0.0 };
    /// Grey, with highlights that saturate the camera.
    pub const GLOSSY: Self = Self { brightness: 0.45, gloss: 3.0 };
}

/// Ball around `centre`.
#[inline]
pub(super) fn sphere(p: &PointMm, centre: PointMm, radius: f64) -> f64 {
    (p - centre).norm() - radius
}

/// Ellipsoid with axes along x, y and z.
#[inline]
pub(super) fn ellipsoid(p: &PointMm, centre: PointMm, radii: PointMm) -> f64 {
    let stretch = radii.map(|r| 1.0 / r);
    ((p - centre).component_mul(&stretch).norm() - 1.0) * radii.min()
}

/// Box with rounded edges. `half` is half its size, rounding included.
#[inline]
pub(super) fn rounded_box(p: &PointMm, centre: PointMm, half: PointMm, rounding: f64) -> f64 {
    let q = (p - centre).abs() - half.add_scalar(-rounding);
    q.sup(&PointMm::zeros()).norm() + q.max().min(0.0) - rounding
}

/// Cylinder parallel to z from `low` to `high` with rounded edges. `centre` is the (x, y) of its axis.
#[inline]
pub(super) fn cylinder(p: &PointMm, centre: [f64; 2], radius: f64, [low, high]: [f64; 2], rounding: f64) -> f64 {
    let across = length(p.x - centre[0], p.y - centre[1]) - radius + rounding;
    let along = (p.z - 0.5 * (low + high)).abs() - 0.5 * (high - low) + rounding;
    length(across.max(0.0), along.max(0.0)) + across.max(along).min(0.0) - rounding
}

/// Round bar between two points. Its radius changes linearly.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundCone {
    start: PointMm,
    axis: PointMm,
    inverse_length_squared: f64,
    radius: f64,
    growth: f64,
    /// Corrects the slope of the field along a bar whose radius changes.
    slope_correction: f64,
}

impl RoundCone {
    /// Creates the bar between two points with their radii.
    #[inline]
    pub(super) fn new((a, radius_a): (PointMm, f64), (b, radius_b): (PointMm, f64)) -> Self {
        let axis = b - a;
        let inverse_length_squared = 1.0 / axis.norm_squared();
        let growth = radius_b - radius_a;
        let slope_correction = 1.0 / (1.0 + growth * growth * inverse_length_squared).sqrt();
        Self { start: a, axis, inverse_length_squared, radius: radius_a, growth, slope_correction }
    }

    #[inline]
    pub(super) fn distance(&self, p: &PointMm) -> f64 {
        let offset = p - self.start;
        let share = (offset.dot(&self.axis) * self.inverse_length_squared).clamp(0.0, 1.0);
        ((offset - self.axis * share).norm() - self.radius - self.growth * share) * self.slope_correction
    }

    /// Square of the distance from the axis of the bar. With it, many bars of equal radius need only one square root.
    #[inline]
    pub(super) fn axis_distance_squared(&self, p: &PointMm) -> f64 {
        let offset = p - self.start;
        let share = (offset.dot(&self.axis) * self.inverse_length_squared).clamp(0.0, 1.0);
        (offset - self.axis * share).norm_squared()
    }
}

/// [`RoundCone`] for a single use.
#[inline]
pub(super) fn round_cone(p: &PointMm, a: (PointMm, f64), b: (PointMm, f64)) -> f64 {
    RoundCone::new(a, b).distance(p)
}

/// Length of a vector in a plane. `hypot` also guards against overflow, which would take most of the time here.
#[inline]
pub(super) fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Union of two solids with a fillet of about `fillet`.
#[inline]
pub(super) fn smooth_union(a: f64, b: f64, fillet: f64) -> f64 {
    let overlap = (fillet - (a - b).abs()).max(0.0) / fillet;
    a.min(b) - overlap * overlap * fillet * 0.25
}

/// The body without the tool, with the edge rounded by about `fillet`.
#[inline]
pub(super) fn smooth_cut(body: f64, tool: f64, fillet: f64) -> f64 {
    -smooth_union(-body, tool, fillet)
}

/// The body without the tool.
#[inline]
pub(super) fn cut(body: f64, tool: f64) -> f64 {
    body.max(-tool)
}

/// Rotates a point about the z axis, which rotates a solid the other way.
pub(super) fn rotated_about_z(p: &PointMm, angle_rad: f64) -> PointMm {
    let (sin, cos) = angle_rad.sin_cos();
    PointMm::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)
}

/// Folds the plane into one of `count` equal sectors, the one around the x axis. A cut in it is then a cut in all
/// sectors.
pub(super) fn sector(p: &PointMm, count: f64) -> PointMm {
    let width = std::f64::consts::TAU / count;
    let angle = p.y.atan2(p.x);
    rotated_about_z(p, -(angle / width).round() * width)
}
