//! Computes the normals of a surface from its pixel grid.
//!
//! In: the points of an image of C1. Out: unit normals towards C1, where the surface is smooth and points are near.
//!
//! The inverse depth of a plane is linear in the ray: `n·X = d` with `X = z·(ρ, η, 1)` is `1/z = (n/d)·(ρ, η, 1)`. So
//! `n/d` is a linear least-squares fit to the inverse depths around a pixel, whose noise is nearly uniform. Pixels that
//! may belong to another surface are excluded: first those behind a depth step that would need a slope steeper than
//! [`MAX_SLOPE`], then those that do not fit the first plane. The cost is about 0.08 µs per point, with 32 pixels at
//! once. Single precision resolves inverse depths a thousand times finer than cameras measure them.

mod window;

use std::collections::BTreeMap;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level, filled, store_first};

use super::CloudPoint;

use window::{COUNT, MAX_DEVIATION, OFFSETS, REACH_PX, Window};

/// Tangent of the largest angle between the ray and a normal, 80°.
const MAX_SLOPE: f32 = 5.67;
/// Minimum number of points for a plane, of 49.
const MIN_POINTS: f32 = 12.0;
/// Bend of the surface that is treated as noise, per distance from the pixel.
const MAX_BEND: f32 = 0.05;
/// Minimum determinant of the centred moments, relative to that of equal moments. Below it, the points lie on a line.
const MIN_SPREAD: f32 = 0.02;

/// A pixel: position in the frame of C1, x, y, z, and standard deviation along the ray, metres. Without a point, z is
/// NaN, and the others mean nothing.
pub type MeasuredPixel = [f32; 4];

/// The points of an image of camera 1, row by row.
#[derive(Clone, Debug, Default)]
pub struct PointImage {
    /// Width and height, pixels.
    pub size_px: [usize; 2],
    /// The pixels.
    pub pixels: Vec<MeasuredPixel>,
}

impl PointImage {
    /// Makes an image without points.
    pub fn clear(&mut self, size_px: [usize; 2]) {
        self.size_px = size_px;
        self.pixels.clear();
        self.pixels.resize(size_px[0] * size_px[1], [f32::NAN; 4]);
    }

    /// Puts a point at its pixel, and returns the index of the pixel. Returns `None` for a point outside the image, or not
    /// in front of the camera.
    pub fn put(&mut self, point: &CloudPoint) -> Option<usize> {
        let ([u, v], [width, height]) = (point.cam1_px.map(usize::from), self.size_px);
        let ([x, y, z], sigma) = (point.position_m, point.sigma_m);
        let is_measured = z > 0.0 && sigma.is_finite();
        let index = (u < width && v < height && is_measured).then_some(v * width + u)?;
        self.pixels[index] = [x, y, z, sigma];
        Some(index)
    }
}

/// Computes normals. Its scratch buffers live from cloud to cloud.
#[derive(Clone, Debug, Default)]
pub struct Normals {
    /// One per thread.
    windows: Vec<Window>,
}

impl Normals {
    /// Computes the unit normals towards C1 of all points of an image, into planes of its pixels. The first component is NaN
    /// where there is no normal.
    pub fn compute(&mut self, points: &PointImage, normals: &mut [Vec<f32>; 3]) {
        compute(Level::in_use(), points, &mut self.windows, normals);
    }
}

/// Side of the parts of an image whose normals are computed at a time, pixels.
const TILE_PX: u16 = 256;
/// Pixels around a part that its normals depend on.
const MARGIN_PX: u16 = REACH_PX as u16;

/// Returns the unit normals towards C1 of the points of a cloud, in their order; zeros where there is none.
///
/// Memory is needed for one part of the image alone, wherever in it the points say that they are.
pub(super) fn normals_of(points: &[CloudPoint]) -> Vec<[f32; 3]> {
    let mut found = vec![[0.0; 3]; points.len()];
    let (mut image, mut normals) = (PointImage::default(), Normals::default());
    let side = usize::from(TILE_PX + 2 * MARGIN_PX);
    let mut planes: [Vec<f32>; 3] = std::array::from_fn(|_| vec![f32::NAN; side * side]);
    for (tile, seen) in tiles(points) {
        image.clear([side; 2]);
        // The index of each point of the tile itself in the image, and its number.
        let mut inner = Vec::new();
        for number in seen {
            let point = &points[number];
            let at = [0, 1].map(|axis| u32::from(point.cam1_px[axis]) + u32::from(MARGIN_PX));
            let cam1_px = [0, 1].map(|axis| (at[axis] - u32::from(tile[axis]) * u32::from(TILE_PX)) as u16);
            let index = image.put(&CloudPoint { cam1_px, ..*point });
            inner.extend(index.filter(|_| point.cam1_px.map(|px| px / TILE_PX) == tile).map(|index| (index, number)));
        }
        normals.compute(&image, &mut planes);
        let [x, y, z] = &planes;
        for (index, number) in inner.into_iter().filter(|&(index, _)| !x[index].is_nan()) {
            found[number] = [x[index], y[index], z[index]];
        }
    }
    found
}

/// The parts of the image, by column and row, and the numbers of the points in each and in its margin.
fn tiles(points: &[CloudPoint]) -> BTreeMap<[u16; 2], Vec<usize>> {
    let mut tiles: BTreeMap<[u16; 2], Vec<usize>> = BTreeMap::new();
    for (number, point) in points.iter().enumerate() {
        let near = |px: u16| px.saturating_sub(MARGIN_PX) / TILE_PX..=px.saturating_add(MARGIN_PX) / TILE_PX;
        let [columns, rows] = point.cam1_px.map(near);
        for tile in rows.flat_map(|row| columns.clone().map(move |column| [column, row])) {
            tiles.entry(tile).or_default().push(number);
        }
    }
    tiles
}

/// Computes the planes of normals; a pixel without a normal gets NaN.
fn compute(level: Level, points: &PointImage, windows: &mut Vec<Window>, normals: &mut [Vec<f32>; 3]) {
    let [columns, rows] = points.size_px;
    if columns * rows == 0 {
        return;
    }
    let threads = rayon::current_num_threads();
    windows.resize_with(threads, Window::default);
    let rows_per_thread = rows.div_ceil(threads);
    let [x, y, z] = normals.each_mut().map(|plane| plane.par_chunks_mut(rows_per_thread * columns));
    let parts = (x, y, z, windows.par_iter_mut()).into_par_iter().enumerate();
    parts.for_each(|(part, (x, y, z, window))| {
        window.arrange(points.size_px);
        let mut rows = x.chunks_mut(columns).zip(y.chunks_mut(columns)).zip(z.chunks_mut(columns));
        for (k, ((x, y), z)) in rows.by_ref().enumerate() {
            window.move_to(points, part * rows_per_thread + k);
            fringeflow_simd::run(level, Row { window, normals: [x, y, z] });
        }
    });
}

/// Computes the normals of the row in the middle of a window.
struct Row<'a> {
    window: &'a Window,
    normals: [&'a mut [f32]; 3],
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self { window, normals: [x, y, z] } = self;
        let starts = window.starts();
        let none = l.real(f32::NAN);
        for first in (0..x.len()).step_by(LANES) {
            let square = Square { window, starts: &starts, first };
            let (normal, has_normal) = square.normals(l);
            store(l, l.select_real(has_normal, normal[0], none), &mut x[first..]);
            store(l, normal[1], &mut y[first..]);
            store(l, normal[2], &mut z[first..]);
        }
    }
}

/// The squares around 32 wanted pixels.
struct Square<'a> {
    window: &'a Window,
    /// As [`Window::starts`] returns them.
    starts: &'a [usize; COUNT],
    /// Number of the first of the pixels in its row.
    first: usize,
}

/// ρ, η and inverse depth of pixels.
type Sample<L> = [<L as Lanes>::Reals; 3];

impl Square<'_> {
    /// Returns the normals towards C1, and a mask of the pixels that have one.
    #[inline(always)]
    fn normals<L: Lanes>(&self, l: L) -> ([L::Reals; 3], L::Mask) {
        // used = pixels with a point that are connected to the centre without a depth edge
        // plane = fit(used); used = those that fit the plane
        // plane = fit(used); the normal is −(a, b, c) / |(a, b, c)| of 1/z = (a, b, c)·(ρ, η, 1)
        let centre @ [x, y, w] = self.at(l, 0);
        // `w ≥ w` is false for NaN, which marks a pixel without a point.
        let has_point = l.is_at_least_real(w, w);
        if !l.any(has_point) {
            return (centre, has_point);
        }
        let mut used = [has_point; COUNT];
        let noise = load(l, &self.window.noise, self.starts[0] + self.first);
        let connected = self.connected(l, centre, noise, &mut used);
        let (first, has_first) = connected.plane(l);
        let (plane, has_plane) = self.fitting(l, centre, noise, &first, &used, connected).plane(l);
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

    /// Returns the samples of the pixels at an offset, given by its index.
    #[inline(always)]
    fn at<L: Lanes>(&self, l: L, offset: usize) -> Sample<L> {
        let index = self.starts[offset] + self.first;
        let Window { rays: [x, y], inverse_depth, .. } = self.window;
        [load(l, x, index), load(l, y, index), load(l, inverse_depth, index)]
    }

    /// Finds the offsets that are connected to the centre, ring by ring outwards: no step on the way may exceed what
    /// [`MAX_SLOPE`] and noise explain. Returns their moments.
    #[inline(always)]
    fn connected<L: Lanes>(&self, l: L, centre: Sample<L>, noise: L::Reals, used: &mut [L::Mask; COUNT]) -> Moments<L> {
        let slope = square(l, l.times_real(l.real(MAX_SLOPE), centre[2]));
        let mut moments = Moments::zero(l);
        moments.add(l, used[0], difference(l, centre, centre));
        for (i, offset) in OFFSETS.iter().enumerate().skip(1) {
            let here = self.at(l, i);
            let [x, y, w] = difference(l, here, self.at(l, offset.inner));
            let distance = l.add_real(square(l, x), square(l, y));
            let limit = l.add_real(l.times_real(slope, distance), noise);
            used[i] = l.and(used[offset.inner], l.is_at_least_real(limit, square(l, w)));
            moments.add(l, used[i], difference(l, here, centre));
        }
        moments
    }

    /// Returns the moments of the used offsets whose inverse depth fits a plane within noise and bend. `moments` are
    /// those of all used offsets: few of them do not fit.
    #[inline(always)]
    fn fitting<L: Lanes>(
        &self,
        l: L,
        centre: Sample<L>,
        noise: L::Reals,
        plane: &Plane<L>,
        used: &[L::Mask; COUNT],
        mut moments: Moments<L>,
    ) -> Moments<L> {
        let bend = square(l, l.times_real(l.real(MAX_DEVIATION * MAX_BEND), centre[2]));
        let [a, b] = plane.slope;
        for (i, &used) in used.iter().enumerate() {
            let off @ [x, y, w] = difference(l, self.at(l, i), centre);
            let expected = l.add_real(plane.at_middle, l.add_real(l.times_real(a, x), l.times_real(b, y)));
            let distance = l.add_real(square(l, x), square(l, y));
            let limit = l.add_real(noise, l.times_real(bend, distance));
            let misfits = l.and(used, l.is_greater_real(square(l, l.sub_real(expected, w)), limit));
            if l.any(misfits) {
                moments.remove(l, misfits, off);
            }
        }
        moments
    }
}

/// Returns a sample relative to another one.
#[inline(always)]
fn difference<L: Lanes>(l: L, [x, y, w]: Sample<L>, [from_x, from_y, from_w]: Sample<L>) -> Sample<L> {
    [l.sub_real(x, from_x), l.sub_real(y, from_y), l.sub_real(w, from_w)]
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

/// Stores the first lanes, as many as there is room for.
#[inline(always)]
fn store<L: Lanes>(l: L, a: L::Reals, to: &mut [f32]) {
    let mut all = [0.0; LANES];
    l.store_reals(a, &mut all);
    store_first(&all, to);
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
    #[inline(always)]
    fn zero(l: L) -> Self {
        Self([l.real(0.0); 9])
    }

    /// Adds a sample, relative to the centre, where it is used.
    #[inline(always)]
    fn add(&mut self, l: L, used: L::Mask, sample: Sample<L>) {
        let terms = Self::terms(l, used, sample);
        for (sum, term) in self.0.iter_mut().zip(terms) {
            *sum = l.add_real(*sum, term);
        }
    }

    /// Takes a sample away again.
    #[inline(always)]
    fn remove(&mut self, l: L, unused: L::Mask, sample: Sample<L>) {
        let terms = Self::terms(l, unused, sample);
        for (sum, term) in self.0.iter_mut().zip(terms) {
            *sum = l.sub_real(*sum, term);
        }
    }

    /// The terms of a sample where it counts, and 0 elsewhere.
    #[inline(always)]
    fn terms(l: L, counts: L::Mask, sample: Sample<L>) -> [L::Reals; 9] {
        let zero = l.real(0.0);
        let [x, y, w] = sample.map(|value| l.select_real(counts, value, zero));
        let one = l.select_real(counts, l.real(1.0), zero);
        [one, x, y, w, square(l, x), l.times_real(x, y), square(l, y), l.times_real(x, w), l.times_real(y, w)]
    }

    /// Returns the least-squares planes, and a mask where they exist: not for too few samples or samples on a line.
    #[inline(always)]
    fn plane(&self, l: L) -> (Plane<L>, L::Mask) {
        let [count, x, y, w, xx, xy, yy, xw, yw] = self.0;
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
mod tests;
