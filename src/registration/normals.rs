//! Normals of a surface from the pixel grid it was measured on.
//!
//! The inverse depth of a plane is linear in the ray: `n·X = d` with `X = z·(ρ, η, 1)` is `1/z = (n/d)·(ρ, η, 1)`. So
//! `n/d` is a linear least-squares fit to the inverse depths around a pixel, whose noise is nearly the same everywhere.
//! What may belong to another surface stays out: first whatever lies behind a step that only a steeper plane than
//! [`MAX_SLOPE`] would explain, then what the first fit does not. Costs about 0.3 µs a point.

use rayon::prelude::*;

use crate::geometry::Vector3;

use super::surface::{OrganizedSurface, SurfacePoint};

/// Pixels to each side that a plane is fitted to.
const REACH_PX: isize = 3;
/// Pixels of the square that this makes.
const COUNT: usize = ((2 * REACH_PX + 1) * (2 * REACH_PX + 1)) as usize;
/// Tangent of the largest angle between the ray and a normal, 80°.
const MAX_SLOPE: f64 = 5.67;
/// Fewest points that a plane is fitted to, of 49.
const MIN_POINTS: f64 = 12.0;
/// Largest residual of the second fit: so many standard deviations, of noise and of bend together.
const MAX_DEVIATION: f64 = 3.0;
/// Bend of a surface that passes for noise, per distance from the pixel.
const MAX_BEND: f64 = 0.05;
/// Least determinant of the moments about their mean, as a share of what they would have if they were even: below, the points
/// stand on a line.
const MIN_SPREAD: f64 = 0.02;

/// What a pixel holds: its ray `(ρ, η, 1)` and the inverse depth there, 1/m.
#[derive(Clone, Copy, Debug)]
struct Place {
    ray: [f64; 2],
    inverse_depth: f64,
}

/// A pixel of the square about another.
#[derive(Clone, Copy)]
struct Offset {
    column: isize,
    row: isize,
    /// Place in [`OFFSETS`] of the pixel that is one step nearer to the middle.
    inner: usize,
}

/// The pixels of the square, the middle first, from the inner ring to the outer.
const OFFSETS: [Offset; COUNT] = offsets();

const fn offsets() -> [Offset; COUNT] {
    let mut offsets = [Offset { column: 0, row: 0, inner: 0 }; COUNT];
    let (mut count, mut ring) = (1, 1);
    while ring <= REACH_PX {
        let mut row = -ring;
        while row <= ring {
            let mut column = -ring;
            while column <= ring {
                if row.abs() == ring || column.abs() == ring {
                    let towards = [nearer(column, ring), nearer(row, ring)];
                    offsets[count] = Offset { column, row, inner: place_of(&offsets, count, towards) };
                    count += 1;
                }
                column += 1;
            }
            row += 1;
        }
        ring += 1;
    }
    offsets
}

const fn nearer(along: isize, ring: isize) -> isize {
    if along.abs() == ring { along - along.signum() } else { along }
}

const fn place_of(offsets: &[Offset; COUNT], count: usize, [column, row]: [isize; 2]) -> usize {
    let mut place = 0;
    while place + 1 < count && (offsets[place].column != column || offsets[place].row != row) {
        place += 1;
    }
    place
}

/// The normals towards C1 of the points at every so many-th column and row.
pub(super) fn normals(surface: &OrganizedSurface, step_px: usize) -> Vec<Option<[f32; 3]>> {
    let [width, height] = surface.size_px();
    let mut grid = vec![None; width * height];
    for point in surface.points() {
        let [x, y, z] = point.position_m.map(f64::from);
        let [u, v] = point.cam1_px.map(usize::from);
        grid[v * width + u] = Some(Place { ray: [x / z, y / z], inverse_depth: 1.0 / z });
    }
    let grid = Grid { width, height, places: grid };
    let is_asked = |point: &SurfacePoint| point.cam1_px.iter().all(|&c| usize::from(c).is_multiple_of(step_px));
    let normal = |point: &SurfacePoint| is_asked(point).then(|| grid.normal(point)).flatten();
    surface.points().par_iter().with_min_len(256).map(normal).collect()
}

/// What all pixels hold, row by row.
struct Grid {
    width: usize,
    height: usize,
    places: Vec<Option<Place>>,
}

impl Grid {
    fn at(&self, column: isize, row: isize) -> Option<Place> {
        let (u, v) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        if u < self.width && v < self.height { self.places[v * self.width + u] } else { None }
    }

    fn normal(&self, point: &SurfacePoint) -> Option<[f32; 3]> {
        let [u, v] = point.cam1_px.map(|c| c as isize);
        let middle = self.at(u, v)?;
        let sigma = f64::from(point.sigma_m) * middle.inverse_depth * middle.inverse_depth;
        let near = self.reached(u, v, &middle, sigma);
        let first = Moments::of(near.iter().flatten(), &middle).plane()?;
        let fits = |place: &&Place| {
            let off = first.value(&middle, place) - place.inverse_depth;
            let bend = MAX_BEND * middle.inverse_depth;
            off * off
                <= MAX_DEVIATION * MAX_DEVIATION * (sigma * sigma + bend * bend * distance_squared(place, &middle))
        };
        let plane = Moments::of(near.iter().flatten().filter(fits), &middle).plane()?;
        let towards = -plane.normal(&middle).normalize();
        let is_steep = -towards.dot(&point.position().coords.normalize()) * MAX_SLOPE.hypot(1.0) < 1.0;
        (!is_steep).then(|| towards.map(|c| c as f32).into())
    }

    /// What is reached from a pixel, ring by ring outwards, without a step that only an edge explains. `sigma` is the
    /// standard deviation of its inverse depth.
    fn reached(&self, u: isize, v: isize, middle: &Place, sigma: f64) -> [Option<Place>; COUNT] {
        let mut reached = [None; COUNT];
        reached[0] = Some(*middle);
        let noise = MAX_DEVIATION * MAX_DEVIATION * sigma * sigma;
        let slope = (MAX_SLOPE * middle.inverse_depth).powi(2);
        for (i, offset) in OFFSETS.iter().enumerate().skip(1) {
            let Some(inner) = reached[offset.inner] else { continue };
            let Some(place) = self.at(u + offset.column, v + offset.row) else { continue };
            let step = place.inverse_depth - inner.inverse_depth;
            if step * step <= slope * distance_squared(&place, &inner) + noise {
                reached[i] = Some(place);
            }
        }
        reached
    }
}

fn distance_squared(a: &Place, b: &Place) -> f64 {
    (a.ray[0] - b.ray[0]).powi(2) + (a.ray[1] - b.ray[1]).powi(2)
}

/// Sums over places, as differences from one of them.
#[derive(Default)]
struct Moments {
    count: f64,
    x: f64,
    y: f64,
    w: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xw: f64,
    yw: f64,
}

/// Inverse depth as a linear function of the ray's difference from a middle, where it is `at_middle` above the middle's own.
struct Plane {
    at_middle: f64,
    slope: [f64; 2],
}

impl Moments {
    fn of<'a>(places: impl Iterator<Item = &'a Place>, middle: &Place) -> Self {
        let mut sums = Self::default();
        for place in places {
            let [x, y] = [place.ray[0] - middle.ray[0], place.ray[1] - middle.ray[1]];
            let w = place.inverse_depth - middle.inverse_depth;
            sums.count += 1.0;
            sums.x += x;
            sums.y += y;
            sums.w += w;
            sums.xx += x * x;
            sums.xy += x * y;
            sums.yy += y * y;
            sums.xw += x * w;
            sums.yw += y * w;
        }
        sums
    }

    /// The plane of least squares; `None` for too few places, or places on a line.
    fn plane(&self) -> Option<Plane> {
        let n = self.count;
        if n < MIN_POINTS {
            return None;
        }
        let (xx, xy) = (self.xx - self.x * self.x / n, self.xy - self.x * self.y / n);
        let yy = self.yy - self.y * self.y / n;
        let (xw, yw) = (self.xw - self.x * self.w / n, self.yw - self.y * self.w / n);
        let (determinant, even) = (xx * yy - xy * xy, (xx + yy) / 2.0);
        if determinant <= MIN_SPREAD * even * even {
            return None;
        }
        let slope = [(yy * xw - xy * yw) / determinant, (xx * yw - xy * xw) / determinant];
        Some(Plane { at_middle: (self.w - slope[0] * self.x - slope[1] * self.y) / n, slope })
    }
}

impl Plane {
    /// Inverse depth at the ray of a place.
    fn value(&self, middle: &Place, place: &Place) -> f64 {
        let [x, y] = [place.ray[0] - middle.ray[0], place.ray[1] - middle.ray[1]];
        middle.inverse_depth + self.at_middle + self.slope[0] * x + self.slope[1] * y
    }

    /// `n/d` of the plane `n·X = d`.
    fn normal(&self, middle: &Place) -> Vector3 {
        let [a, b] = self.slope;
        let at_origin = middle.inverse_depth + self.at_middle - a * middle.ray[0] - b * middle.ray[1];
        Vector3::new(a, b, at_origin)
    }
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
