//! Normals of a surface from the pixel grid it was measured on.
//!
//! The inverse depth of a plane is linear in the ray: `n·X = d` with `X = z·(ρ, η, 1)` is `1/z = (n/d)·(ρ, η, 1)`. So
//! `n/d` is a linear least-squares fit to the inverse depths around a pixel, whose noise is nearly the same everywhere.
//! What may belong to another surface stays out: first whatever lies behind a step that only a steeper plane than
//! [`MAX_SLOPE`] would explain, then what the first fit does not. Costs about 0.3 µs a point.

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::geometry::Vector3;

use super::surface::{OrganizedSurface, SurfacePoint};

/// Pixels to each side that a plane is fitted to.
const REACH_PX: isize = 3;
/// Pixels of a side of the square that this makes.
const SIDE: isize = 2 * REACH_PX + 1;
/// Tangent of the largest angle between the ray and a normal, 80°.
const MAX_SLOPE: f64 = 5.67;
/// Fewest points that a plane is fitted to, of 49.
const MIN_POINTS: usize = 12;
/// Largest residual of the second fit: so many standard deviations, of noise and of bend together.
const MAX_DEVIATION: f64 = 3.0;
/// Bend of a surface that passes for noise, per distance from the pixel.
const MAX_BEND: f64 = 0.05;
/// Least determinant of the moments about their mean, as a share of what they would have if they were even: below, the points
/// stand on a line.
const MIN_SPREAD: f64 = 0.02;

/// A neighbour of a pixel: its ray, its inverse depth (1/m), and the distance from the pixel's ray.
struct Neighbour {
    ray: Vector3,
    inverse_depth: f64,
    distance: f64,
}

/// The normal of every point, towards C1.
pub(super) fn normals(surface: &OrganizedSurface) -> Vec<Option<[f32; 3]>> {
    let scratch = || Vec::with_capacity(49);
    let points = surface.points().par_iter().with_min_len(256);
    points.map_init(scratch, |near, point| normal(surface, point, near)).collect()
}

fn normal(surface: &OrganizedSurface, point: &SurfacePoint, near: &mut Vec<Neighbour>) -> Option<[f32; 3]> {
    find_neighbours(surface, point, near);
    let first = plane(near.iter())?;
    let (inverse_depth, sigma_m) = (1.0 / f64::from(point.position_m[2]), f64::from(point.sigma_m));
    let fits = |n: &&Neighbour| {
        let off_m = (first.dot(&n.ray) - n.inverse_depth).abs() / (inverse_depth * inverse_depth);
        off_m <= MAX_DEVIATION * (sigma_m + MAX_BEND * n.distance / inverse_depth)
    };
    let towards = -plane(near.iter().filter(fits))?.normalize();
    let ray = point.position().coords.normalize();
    let is_steep = -towards.dot(&ray) * MAX_SLOPE.hypot(1.0) < 1.0;
    (!is_steep).then(|| towards.map(|c| c as f32).into())
}

/// Finds the points that are reached from one, pixel by pixel outwards, without a step that only an edge explains; the point
/// itself is the first.
fn find_neighbours(surface: &OrganizedSurface, point: &SurfacePoint, near: &mut Vec<Neighbour>) {
    near.clear();
    let of = |p: &SurfacePoint| (p.position().coords / f64::from(p.position_m[2]), 1.0 / f64::from(p.position_m[2]));
    let (ray, inverse_depth) = of(point);
    near.push(Neighbour { ray, inverse_depth, distance: 0.0 });
    let noise = MAX_DEVIATION * f64::from(point.sigma_m) * inverse_depth * inverse_depth;
    let [u, v] = point.cam1_px.map(|c| c as isize);
    // Ray and inverse depth of what was reached.
    let mut reached = [None; (SIDE * SIDE) as usize];
    let place = |[du, dv]: [isize; 2]| ((dv + REACH_PX) * SIDE + du + REACH_PX) as usize;
    reached[place([0, 0])] = Some((ray, inverse_depth));
    for ring in 1..=REACH_PX {
        for offset in on_ring(ring) {
            // One step towards the middle.
            let inner = offset.map(|c| if c.abs() == ring { c - c.signum() } else { c });
            let Some((inner_ray, inner_at)) = reached[place(inner)] else { continue };
            let Some((other, at)) = surface.at(u + offset[0], v + offset[1]).map(of) else { continue };
            if (at - inner_at).abs() <= MAX_SLOPE * inverse_depth * (other - inner_ray).norm() + noise {
                reached[place(offset)] = Some((other, at));
                near.push(Neighbour { ray: other, inverse_depth: at, distance: (other - ray).norm() });
            }
        }
    }
}

/// The pixels of a square ring about a pixel.
fn on_ring(ring: isize) -> impl Iterator<Item = [isize; 2]> {
    let square = (-ring..=ring).flat_map(move |dv| (-ring..=ring).map(move |du| [du, dv]));
    square.filter(move |[du, dv]| du.abs().max(dv.abs()) == ring)
}

/// `n/d` of the plane `n·X = d` through some points; `None` for too few, or points on a line.
fn plane<'a>(points: impl Iterator<Item = &'a Neighbour> + Clone) -> Option<Vector3> {
    let count = points.clone().count();
    if count < MIN_POINTS {
        return None;
    }
    let n = count as f64;
    let mean = points.clone().map(|p| Vector3::new(p.ray.x, p.ray.y, p.inverse_depth)).sum::<Vector3>() / n;
    let mut moments: Matrix3<f64> = Matrix3::zeros();
    for p in points {
        let off = Vector3::new(p.ray.x, p.ray.y, p.inverse_depth) - mean;
        moments += off * off.transpose();
    }
    let (xx, xy, yy) = (moments[(0, 0)], moments[(0, 1)], moments[(1, 1)]);
    let determinant = xx * yy - xy * xy;
    let even = (xx + yy) / 2.0;
    if determinant <= MIN_SPREAD * even * even {
        return None;
    }
    let (xw, yw) = (moments[(0, 2)], moments[(1, 2)]);
    let slope = [(yy * xw - xy * yw) / determinant, (xx * yw - xy * xw) / determinant];
    Some(Vector3::new(slope[0], slope[1], mean.z - slope[0] * mean.x - slope[1] * mean.y))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{camera, surface_of};
    use super::*;
    use crate::geometry::Point3;

    fn angle_deg(surface: &OrganizedSurface, pixel: [isize; 2], truth: &Vector3) -> f64 {
        let normal = surface.at(pixel[0], pixel[1]).unwrap().unit_normal().unwrap();
        normal.angle(truth).to_degrees()
    }

    /// Where the ray of a pixel meets the plane `n·X = d`.
    fn on_plane(ray: &Vector3, normal: &Vector3, d: f64) -> Option<Point3> {
        Some(Point3::from(ray * (d / normal.dot(ray))))
    }

    #[test]
    fn a_plane_has_its_normal_everywhere() {
        let truth = Vector3::new(0.3, -0.4, -0.8).normalize();
        let surface = surface_of(&camera(), 0.0, 1, |ray| on_plane(ray, &truth, -0.25));
        assert!(surface.points().iter().all(|p| p.normal.is_some()));
        for pixel in [[0, 0], [40, 30], [79, 63]] {
            assert!(angle_deg(&surface, pixel, &truth) < 0.01);
        }
    }

    #[test]
    fn noise_turns_normals_by_what_it_should() {
        // 0.02 mm over 7 × 7 pixels of 1.3 mm: 0.02 / (1.3 · √(7 · 28)) rad = 0.06°.
        let truth = Vector3::new(0.0, -0.2, -1.0).normalize();
        let surface = surface_of(&camera(), 2e-5, 5, |ray| on_plane(ray, &truth, -0.3));
        let mean_square = surface.points().iter().map(|p| p.unit_normal().unwrap().angle(&truth).powi(2)).sum::<f64>()
            / surface.points().len() as f64;
        let rms_deg = mean_square.sqrt().to_degrees();
        assert!((0.04..0.2).contains(&rms_deg), "{rms_deg}°");
    }

    #[test]
    fn a_step_does_not_bend_the_normals_beside_it() {
        // Two plates face to face with the camera, the right one 15 mm nearer.
        let truth = -Vector3::z();
        let surface =
            surface_of(&camera(), 1e-5, 1, |ray| on_plane(ray, &truth, if ray.x < 0.0 { -0.315 } else { -0.3 }));
        for point in surface.points() {
            if let Some(normal) = point.unit_normal() {
                assert!(normal.angle(&truth).to_degrees() < 1.0, "{point:?}");
            }
        }
        let without = surface.points().iter().filter(|p| p.normal.is_none()).count();
        assert!(without * 50 < surface.points().len(), "{without} points without a normal");
    }

    #[test]
    fn lone_points_and_lines_have_none() {
        let line = |ray: &Vector3| (ray.y.abs() < 0.002).then(|| Point3::from(ray * 0.3));
        let surface = surface_of(&camera(), 0.0, 1, line);
        assert!(!surface.points().is_empty());
        assert!(surface.points().iter().all(|p| p.normal.is_none()));
    }
}
