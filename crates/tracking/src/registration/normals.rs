//! Computes the normals of a surface from its pixel grid.
//!
//! The inverse depth of a plane is linear in the ray: `n·X = d` with `X = z·(ρ, η, 1)` is `1/z = (n/d)·(ρ, η, 1)`. So
//! `n/d` is a linear least-squares fit to the inverse depths around a pixel, whose noise is nearly uniform. Pixels that
//! may belong to another surface are excluded: first those behind a depth step that would need a slope steeper than
//! [`MAX_SLOPE`], then those that do not fit the first plane. The cost is about 0.1 µs per point, with 32 pixels at
//! once. Single precision resolves inverse depths a thousand times finer than cameras measure them.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level, filled};

use super::surface::OrganizedSurface;

/// Pixels to each side of the centre that a plane is fitted to.
const REACH_PX: usize = 3;
/// Number of pixels in that square.
const COUNT: usize = (2 * REACH_PX + 1) * (2 * REACH_PX + 1);
/// Tangent of the largest angle between the ray and a normal, 80°.
const MAX_SLOPE: f32 = 5.67;
/// Minimum number of points for a plane, of 49.
const MIN_POINTS: f32 = 12.0;
/// Maximum residual of the second fit, in standard deviations of noise and bend together.
const MAX_DEVIATION: f32 = 3.0;
/// Bend of the surface that is treated as noise, per distance from the pixel.
const MAX_BEND: f32 = 0.05;
/// Minimum determinant of the centred moments, relative to that of equal moments. Below it, the points lie on a line.
const MIN_SPREAD: f32 = 0.02;
/// Rows per band. Bands run in parallel.
const BAND_ROWS: usize = 32;

/// A pixel of the square, relative to its centre.
#[derive(Clone, Copy)]
struct Offset {
    column: isize,
    row: isize,
    /// Index in [`OFFSETS`] of the pixel one step nearer to the centre.
    inner: usize,
}

/// The pixels of the square: the centre first, then ring by ring outwards.
const OFFSETS: [Offset; COUNT] = offsets();

const fn offsets() -> [Offset; COUNT] {
    let mut offsets = [Offset { column: 0, row: 0, inner: 0 }; COUNT];
    let (mut count, mut ring) = (1, 1);
    while ring <= REACH_PX as isize {
        let mut row = -ring;
        while row <= ring {
            let mut column = -ring;
            while column <= ring {
                if row.abs() == ring || column.abs() == ring {
                    let towards = [nearer(column, ring), nearer(row, ring)];
                    offsets[count] = Offset { column, row, inner: index_of(&offsets, count, towards) };
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

const fn index_of(offsets: &[Offset; COUNT], count: usize, [column, row]: [isize; 2]) -> usize {
    let mut index = 0;
    while index + 1 < count && (offsets[index].column != column || offsets[index].row != row) {
        index += 1;
    }
    index
}

/// Index of a point of the surface, and its normal.
type WithNormal = (u32, [f32; 3]);

/// Returns the normals towards C1 of the points in every `step_px`-th column and row, if they exist.
pub(super) fn normals(surface: &OrganizedSurface, step_px: usize) -> Vec<Vec<WithNormal>> {
    normals_at(Level::in_use(), surface, step_px)
}

fn normals_at(level: Level, surface: &OrganizedSurface, step_px: usize) -> Vec<Vec<WithNormal>> {
    let [_, height] = surface.size_px();
    let band_normals = |first: usize| {
        let rows = first..(first + BAND_ROWS).min(height);
        let planes = Planes::new(surface, rows.start as isize - REACH_PX as isize, rows.len() + 2 * REACH_PX);
        let mut found = Vec::new();
        for row in rows.clone().filter(|row| row.is_multiple_of(step_px)) {
            let middle = row - rows.start + REACH_PX;
            fringeflow_simd::run(level, Row { surface, planes: &planes, middle, row, step_px, found: &mut found });
        }
        found
    };
    (0..height.div_ceil(BAND_ROWS)).into_par_iter().map(|band| band_normals(band * BAND_ROWS)).collect()
}

/// The points of some rows as arrays of numbers. NaN marks pixels without a point, as outside the image.
struct Planes {
    stride: usize,
    /// ρ and η of the ray `(ρ, η, 1)`.
    rays: [Vec<f32>; 2],
    /// 1/m.
    inverse_depth: Vec<f32>,
    /// Square of the largest deviation that noise explains, 1/m².
    noise: Vec<f32>,
}

impl Planes {
    /// Creates the arrays of `rows` rows, starting at `first_row`, which may lie above the image.
    fn new(surface: &OrganizedSurface, first_row: isize, rows: usize) -> Self {
        let [width, _] = surface.size_px();
        let stride = width.next_multiple_of(LANES) + 2 * REACH_PX;
        let plane = || vec![f32::NAN; stride * rows];
        let mut planes = Self { stride, rays: [plane(), plane()], inverse_depth: plane(), noise: plane() };
        for row in 0..rows {
            let Some(v) = first_row.checked_add_unsigned(row).and_then(|v| usize::try_from(v).ok()) else { continue };
            for (u, point) in surface.row(v).enumerate().filter_map(|(u, point)| Some((u, point?))) {
                let index = row * stride + REACH_PX + u;
                let [x, y, z] = point.position_m;
                let inverse_depth = 1.0 / z;
                planes.rays[0][index] = x * inverse_depth;
                planes.rays[1][index] = y * inverse_depth;
                planes.inverse_depth[index] = inverse_depth;
                planes.noise[index] = (MAX_DEVIATION * point.sigma_m * inverse_depth * inverse_depth).powi(2);
            }
        }
        planes
    }
}

/// Computes the normals of a row.
struct Row<'a> {
    surface: &'a OrganizedSurface,
    planes: &'a Planes,
    /// The row within the planes, and in the image.
    middle: usize,
    row: usize,
    step_px: usize,
    found: &'a mut Vec<WithNormal>,
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, l: L) {
        let [width, _] = self.surface.size_px();
        for first in (0..width).step_by(LANES) {
            let requested = self.requested(first, (width - first).min(LANES));
            if requested == 0 {
                continue;
            }
            let square = Square { planes: self.planes, middle: self.middle * self.planes.stride + REACH_PX + first };
            let ([x, y, z], has_normal) = square.normals(l);
            let mut normals = [[0.0; LANES]; 3];
            l.store_reals(x, &mut normals[0]);
            l.store_reals(y, &mut normals[1]);
            l.store_reals(z, &mut normals[2]);
            self.store(first, l.bits(has_normal) & requested, &normals);
        }
    }
}

impl Row<'_> {
    /// Stores the normals of the pixels whose bit is set. `first` is the column of the first bit.
    fn store(&mut self, first: usize, mut pixels: u32, [x, y, z]: &[[f32; LANES]; 3]) {
        while pixels != 0 {
            let lane = pixels.trailing_zeros() as usize;
            pixels &= pixels - 1;
            if let Some(index) = self.surface.point_index(first + lane, self.row) {
                self.found.push((index, [x[lane], y[lane], z[lane]]));
            }
        }
    }

    /// Returns a bit for each of `count` pixels from column `first` on: whether it has a point and its normal is
    /// requested.
    fn requested(&self, first: usize, count: usize) -> u32 {
        let inverse_depth = &self.planes.inverse_depth[self.middle * self.planes.stride + REACH_PX + first..][..count];
        let is_requested = |(k, value): &(usize, &f32)| (first + k).is_multiple_of(self.step_px) && !value.is_nan();
        inverse_depth.iter().enumerate().filter(is_requested).fold(0, |bits, (k, _)| bits | 1 << k)
    }
}

/// The squares around 32 adjacent pixels.
struct Square<'a> {
    planes: &'a Planes,
    /// Index of the first centre pixel in the planes.
    middle: usize,
}

/// ρ, η and inverse depth of pixels.
type Sample<L> = [<L as Lanes>::Reals; 3];

impl Square<'_> {
    /// Returns the normals towards C1, and a mask of the pixels that have one.
    #[inline(always)]
    fn normals<L: Lanes>(&self, l: L) -> ([L::Reals; 3], L::Mask) {
        // used = pixels with a point
        // used = those connected to the centre without a depth edge
        // plane = fit(used); used = those that fit the plane
        // plane = fit(used); the normal is −(a, b, c) / |(a, b, c)| of 1/z = (a, b, c)·(ρ, η, 1)
        let [x, y, w] = self.at(l, &OFFSETS[0]);
        // `w ≥ w` is false for NaN, which marks a pixel without a point.
        let mut used = [l.is_at_least_real(w, w); COUNT];
        let noise = load(l, &self.planes.noise, self.middle);
        self.keep_connected(l, w, noise, &mut used);
        let (first, has_first) = self.moments(l, &used).plane(l);
        self.keep_fitting(l, &first, w, noise, &mut used);
        let (plane, has_plane) = self.moments(l, &used).plane(l);
        // `n/d`, its length, and the length of the ray.
        let Plane { at_middle, slope: [a, b] } = plane;
        let here = l.add_real(w, at_middle);
        let at_origin = l.sub_real(here, l.add_real(l.times_real(a, x), l.times_real(b, y)));
        let (long, ray) = (length(l, [a, b, at_origin]), length(l, [x, y, l.real(1.0)]));
        let is_flat = l.is_at_least_real(l.times_real(here, l.real(MAX_SLOPE.hypot(1.0))), l.times_real(long, ray));
        let inverse = l.over_real(l.real(-1.0), long);
        let towards = [l.times_real(a, inverse), l.times_real(b, inverse), l.times_real(at_origin, inverse)];
        (towards, l.and(is_flat, l.and(has_first, has_plane)))
    }

    /// Returns the samples of the pixels at an offset.
    #[inline(always)]
    fn at<L: Lanes>(&self, l: L, offset: &Offset) -> Sample<L> {
        let index = self.middle.wrapping_add_signed(offset.row * self.planes.stride as isize + offset.column);
        let Planes { rays: [x, y], inverse_depth, .. } = self.planes;
        [load(l, x, index), load(l, y, index), load(l, inverse_depth, index)]
    }

    /// Returns the difference of the samples at two offsets.
    #[inline(always)]
    fn step<L: Lanes>(&self, l: L, from: &Offset, to: &Offset) -> Sample<L> {
        let ([x, y, w], [from_x, from_y, from_w]) = (self.at(l, to), self.at(l, from));
        [l.sub_real(x, from_x), l.sub_real(y, from_y), l.sub_real(w, from_w)]
    }

    /// Keeps the offsets that are connected to the centre, ring by ring outwards: no step on the way may exceed what
    /// [`MAX_SLOPE`] and noise explain.
    #[inline(always)]
    fn keep_connected<L: Lanes>(&self, l: L, inverse_depth: L::Reals, noise: L::Reals, used: &mut [L::Mask; COUNT]) {
        let slope = square(l, l.times_real(l.real(MAX_SLOPE), inverse_depth));
        for (i, offset) in OFFSETS.iter().enumerate().skip(1) {
            let [x, y, w] = self.step(l, &OFFSETS[offset.inner], offset);
            let distance = l.add_real(square(l, x), square(l, y));
            let limit = l.add_real(l.times_real(slope, distance), noise);
            used[i] = l.and(used[offset.inner], l.is_at_least_real(limit, square(l, w)));
        }
    }

    /// Keeps the offsets whose inverse depth fits a plane within noise and bend.
    #[inline(always)]
    fn keep_fitting<L: Lanes>(
        &self,
        l: L,
        plane: &Plane<L>,
        inverse_depth: L::Reals,
        noise: L::Reals,
        used: &mut [L::Mask; COUNT],
    ) {
        let bend = square(l, l.times_real(l.real(MAX_DEVIATION * MAX_BEND), inverse_depth));
        let [a, b] = plane.slope;
        for (offset, used) in OFFSETS.iter().zip(used) {
            let [x, y, w] = self.step(l, &OFFSETS[0], offset);
            let expected = l.add_real(plane.at_middle, l.add_real(l.times_real(a, x), l.times_real(b, y)));
            let distance = l.add_real(square(l, x), square(l, y));
            let limit = l.add_real(noise, l.times_real(bend, distance));
            *used = l.and(*used, l.is_at_least_real(limit, square(l, l.sub_real(expected, w))));
        }
    }

    /// Sums the differences from the centre over the used offsets.
    #[inline(always)]
    fn moments<L: Lanes>(&self, l: L, used: &[L::Mask; COUNT]) -> Moments<L> {
        let (zero, one) = (l.real(0.0), l.real(1.0));
        let mut sums = [zero; 9];
        for (offset, &used) in OFFSETS.iter().zip(used) {
            let [x, y, w] = self.step(l, &OFFSETS[0], offset);
            let [x, y, w] = [x, y, w].map(|value| l.select_real(used, value, zero));
            let squares = [square(l, x), l.times_real(x, y), square(l, y)];
            let terms = [
                l.select_real(used, one, zero),
                x,
                y,
                w,
                squares[0],
                squares[1],
                squares[2],
                l.times_real(x, w),
                l.times_real(y, w),
            ];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum = l.add_real(*sum, term);
            }
        }
        Moments(sums)
    }
}

#[inline(always)]
fn square<L: Lanes>(l: L, a: L::Reals) -> L::Reals {
    l.times_real(a, a)
}

#[inline(always)]
fn length<L: Lanes>(l: L, [x, y, z]: Sample<L>) -> L::Reals {
    l.root_real(l.add_real(l.add_real(square(l, x), square(l, y)), square(l, z)))
}

#[inline(always)]
fn load<L: Lanes>(l: L, plane: &[f32], index: usize) -> L::Reals {
    l.load_reals(&filled(&plane[index..], f32::NAN))
}

/// Number of samples, sums of x, y, w, and sums of xx, xy, yy, xw, yw.
struct Moments<L: Lanes>([L::Reals; 9]);

/// Inverse depth as a linear function of the difference of the ray from the centre. `at_middle` is the difference of
/// the inverse depth at the centre itself.
struct Plane<L: Lanes> {
    at_middle: L::Reals,
    slope: [L::Reals; 2],
}

impl<L: Lanes> Moments<L> {
    /// Returns the least-squares planes, and a mask where they exist: not for too few samples or samples on a line.
    #[inline(always)]
    fn plane(self, l: L) -> (Plane<L>, L::Mask) {
        let Self([count, x, y, w, xx, xy, yy, xw, yw]) = self;
        let per_sample = l.over_real(l.real(1.0), count);
        let (mean_x, mean_y) = (l.times_real(x, per_sample), l.times_real(y, per_sample));
        let xx = l.sub_real(xx, l.times_real(x, mean_x));
        let xy = l.sub_real(xy, l.times_real(x, mean_y));
        let yy = l.sub_real(yy, l.times_real(y, mean_y));
        let xw = l.sub_real(xw, l.times_real(w, mean_x));
        let yw = l.sub_real(yw, l.times_real(w, mean_y));
        let determinant = l.sub_real(l.times_real(xx, yy), l.times_real(xy, xy));
        let even = square(l, l.times_real(l.real(0.5), l.add_real(xx, yy)));
        let is_enough = l.is_at_least_real(count, l.real(MIN_POINTS));
        let is_spread = l.is_greater_real(determinant, l.times_real(l.real(MIN_SPREAD), even));
        let a = l.over_real(l.sub_real(l.times_real(yy, xw), l.times_real(xy, yw)), determinant);
        let b = l.over_real(l.sub_real(l.times_real(xx, yw), l.times_real(xy, xw)), determinant);
        let sum = l.sub_real(w, l.add_real(l.times_real(a, x), l.times_real(b, y)));
        (Plane { at_middle: l.times_real(sum, per_sample), slope: [a, b] }, l.and(is_enough, is_spread))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::tests::{bowl, camera, camera_of, surface_of};
    use fringeflow::geometry::{Point3, Vector3};

    fn angle_deg(surface: &OrganizedSurface, pixel: [isize; 2], truth: &Vector3) -> f64 {
        let normal = surface.at(pixel[0], pixel[1]).unwrap().unit_normal().unwrap();
        normal.angle(truth).to_degrees()
    }

    /// Intersection of the ray of a pixel with the plane `n·X = d`.
    fn on_plane(ray: &Vector3, normal: &Vector3, d: f64) -> Option<Point3> {
        Some(Point3::from(ray * (d / normal.dot(ray))))
    }

    #[test]
    fn a_plane_has_the_same_normal_everywhere() {
        let truth = Vector3::new(0.3, -0.4, -0.8).normalize();
        let surface = surface_of(&camera(), 0.0, 1, |ray| on_plane(ray, &truth, -0.25));
        assert!(surface.points().iter().all(|p| p.normal.is_some()));
        for pixel in [[0, 0], [40, 30], [79, 63]] {
            assert!(angle_deg(&surface, pixel, &truth) < 0.01);
        }
    }

    #[test]
    fn noise_tilts_normals_by_the_expected_angle() {
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
        // Two plates parallel to the image, the right one 15 mm nearer.
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
    fn single_points_and_lines_have_no_normal() {
        let line = |ray: &Vector3| (ray.y.abs() < 0.002).then(|| Point3::from(ray * 0.3));
        let surface = surface_of(&camera(), 0.0, 1, line);
        assert!(!surface.points().is_empty());
        assert!(surface.points().iter().all(|p| p.normal.is_none()));
    }

    #[test]
    fn every_level_has_the_same_bits() {
        // A width that is not a multiple of the lanes, and missing points.
        let surface = surface_of(&camera_of([77, 53]), 2e-5, 3, |ray| bowl(ray).filter(|p| (p.x * 1e5).sin() < 0.6));
        for step_px in [1, 3] {
            let expected = normals_at(Level::Portable, &surface, step_px);
            assert!(expected.iter().map(Vec::len).sum::<usize>() > 100);
            assert!(Level::ALL.into_iter().all(|level| normals_at(level, &surface, step_px) == expected));
        }
    }
}
