//! Triangulation of all correspondences, with the standard deviation of every point (paper, section 2.1).
//!
//! In: planes of the matches and of the phase data of C1. Out: points, as numbers or as records. Cost: some hundred
//! operations per point, in vector code. A correspondence lies on the epipolar line of its pixel, so both rays intersect
//! exactly.
//!
//! ```text
//! count the matches of every row             (so that each row has its part of the output)
//! for each row, in parallel:
//!     for each tile of neighbouring pixels:
//!         triangulate every pixel of the tile, matched or not (no branches: vector code)
//!         append the points of its matches   (a match has no point if its rays do not intersect)
//! close the gaps that missing points left    (serial; most often nothing moves)
//! ```

use std::f64::consts::TAU;
use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::{Confidence, Outcome, RayRow, SegmentTable};
use crate::geometry::{EpipolarFrame, ImageTriangulation};
use crate::phase::Modulation;

use super::CloudPoint;

/// Pixels triangulated together.
const TILE_PX: usize = RayRow::PIXELS;
/// Most rows in a task of one thread.
const ROWS_PER_TASK: usize = 16;
/// Matches hold δ in turns · 65536.
const RAD_PER_DELTA: f32 = (TAU / 65536.0) as f32;

/// The matches of all pixels of C1, row by row, and what triangulation needs besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangulationInput<'a> {
    /// Width of the images of C1, pixels.
    pub width: usize,
    /// How each pixel was decided.
    pub outcomes: &'a [Outcome],
    /// Column of the correspondence in the epipolar frame.
    pub column_px: &'a [f32],
    /// Fringe order.
    pub order: &'a [i16],
    /// δ, turns · 65536.
    pub delta: &'a [i16],
    /// Slope of the phase along the epipolar line, turns · 65536 per column.
    pub slope: &'a [i16],
    /// Orders that the surface around the pixel leaves possible.
    pub passing: &'a [u8],
    /// Probability that the match is correct.
    pub confidence: &'a [Confidence],
    /// Mean grey level of every pixel of C1, see [`crate::phase::PhaseMap`].
    pub mean: &'a [u8],
    /// Modulation of every pixel of C1.
    pub modulation: &'a [Modulation],
    /// Standard deviation of the phase of C1 and C2 times the modulation, grey levels: grey-level noise times noise
    /// gain, see [`crate::phase::FitStatistics`].
    pub phase_noise_grey: [f32; 2],
}

/// A point in the form in which it is needed.
pub trait PointForm: Copy + Send {
    /// The point in this form.
    fn from_point(point: CloudPoint) -> Self;
}

impl PointForm for CloudPoint {
    #[inline(always)]
    fn from_point(point: CloudPoint) -> Self {
        point
    }
}

/// Triangulates the windows of one rig, reusing its memory.
#[derive(Clone, Debug)]
pub struct Triangulator {
    triangulation: ImageTriangulation,
    rows: Vec<RowPoints>,
}

/// Where the points of a row are in the cloud.
#[derive(Clone, Copy, Debug, Default)]
struct RowPoints {
    /// Index of the first, with room for a point per match.
    begin: usize,
    /// Number of points.
    count: usize,
}

impl Triangulator {
    /// A triangulator for the rig of an epipolar frame.
    #[must_use]
    pub fn new(frame: &EpipolarFrame) -> Self {
        Self { triangulation: frame.image_triangulation(), rows: Vec::new() }
    }

    /// Prepares the triangulation of a window. Returns the number of matches: the largest number of its points.
    pub fn count_matches(&mut self, input: &TriangulationInput<'_>) -> usize {
        let rows = input.outcomes.par_chunks_exact(input.width.max(1)).with_min_len(ROWS_PER_TASK);
        let matches = |outcomes: &[Outcome]| outcomes.iter().filter(|outcome| outcome.is_found()).count();
        rows.map(|outcomes| RowPoints { begin: 0, count: matches(outcomes) }).collect_into_vec(&mut self.rows);
        let mut end = 0;
        for row in &mut self.rows {
            row.begin = end;
            end += std::mem::take(&mut row.count);
        }
        end
    }

    /// Triangulates the matches of the window prepared with [`Self::count_matches`], in the order of their pixels, into
    /// memory for so many points. Returns the number of points: a match whose rays do not intersect has none.
    ///
    /// `sigma_m` is predicted from noise: sd(φ) = gain · σ/B in each camera (the modulation of C1 stands for both),
    /// divided by the slope of the phase along the epipolar line, times depth per column, times length of the ray.
    pub fn triangulate<P: PointForm>(
        &mut self,
        input: &TriangulationInput<'_>,
        table: &SegmentTable,
        points: &mut [P],
    ) -> usize {
        let Self { triangulation, rows } = self;
        let [cam1_grey, cam2_grey] = input.phase_noise_grey.map(f64::from);
        let phase_noise = (cam1_grey.hypot(cam2_grey) / TAU * 65536.0) as f32;
        let shared = Shared { input, table, triangulation, phase_noise };
        shared.fill_rows(0..rows.len(), rows, points);
        close_gaps(points, rows)
    }
}

/// Input that all rows share.
#[derive(Clone, Copy)]
struct Shared<'a> {
    input: &'a TriangulationInput<'a>,
    table: &'a SegmentTable,
    triangulation: &'a ImageTriangulation,
    /// Standard deviation of the phase of both cameras together at a modulation of one grey level, turns · 65536.
    phase_noise: f32,
}

impl Shared<'_> {
    /// Fills in the points of a range of rows, in parallel.
    fn fill_rows<P: PointForm>(self, range: Range<usize>, rows: &mut [RowPoints], points: &mut [P]) {
        // Rows have parts of different length in the cloud, so the range is halved until one task's worth is left.
        if range.len() > ROWS_PER_TASK {
            let (middle, half) = (range.start + range.len() / 2, range.len() / 2);
            let (upper, lower) = rows.split_at_mut(half);
            let (points_above, points_below) = points.split_at_mut(lower[0].begin - upper[0].begin);
            rayon::join(
                || self.fill_rows(range.start..middle, upper, points_above),
                || self.fill_rows(middle..range.end, lower, points_below),
            );
            return;
        }
        let mut rest = points;
        for (place, v) in range.enumerate() {
            let matched = rows.get(place + 1).map_or(rest.len(), |next| next.begin - rows[place].begin);
            let out;
            (out, rest) = rest.split_at_mut(matched);
            rows[place].count = fringeflow_simd::run(Level::in_use(), RowKernel { shared: self, v, out });
        }
    }
}

/// Triangulates row `v`; returns the number of points.
struct RowKernel<'a, 'b, P> {
    shared: Shared<'a>,
    v: usize,
    out: &'b mut [P],
}

impl<P: PointForm> Kernel for RowKernel<'_, '_, P> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> usize {
        let Self { shared, v, out } = self;
        let width = shared.input.width;
        let rays = shared.table.rays(v);
        let mut count = 0;
        for k in 0..width.div_ceil(TILE_PX) {
            let first = v * width + TILE_PX * k;
            let tile = Tile::new(&shared, first, TILE_PX.min(width - TILE_PX * k));
            if tile.found.contains(&true) {
                count += tile.write_points(&shared, rays.patch(k), [TILE_PX * k, v], &mut out[count..]);
            }
        }
        count
    }
}

/// Data of neighbouring pixels of a row, copied to arrays of fixed size.
struct Tile {
    found: [bool; TILE_PX],
    outcome: [Outcome; TILE_PX],
    column_px: [f32; TILE_PX],
    order: [i16; TILE_PX],
    delta: [i16; TILE_PX],
    slope: [i16; TILE_PX],
    modulation: [Modulation; TILE_PX],
    intensity: [u8; TILE_PX],
    candidates: [u8; TILE_PX],
    confidence: [Confidence; TILE_PX],
}

impl Tile {
    /// `count` pixels from `first` on; the rest of the tile is padding without matches.
    #[inline(always)]
    fn new(shared: &Shared<'_>, first: usize, count: usize) -> Self {
        let (input, pixels) = (shared.input, first..first + count);
        let outcome = fringeflow_simd::filled(&input.outcomes[pixels.clone()], Outcome::Invalid);
        let mut found = [false; TILE_PX];
        for i in 0..TILE_PX {
            found[i] = outcome[i].is_found();
        }
        Self {
            found,
            outcome,
            column_px: fringeflow_simd::filled(&input.column_px[pixels.clone()], 0.0),
            order: fringeflow_simd::filled(&input.order[pixels.clone()], 0),
            delta: fringeflow_simd::filled(&input.delta[pixels.clone()], 0),
            slope: fringeflow_simd::filled(&input.slope[pixels.clone()], 0),
            modulation: fringeflow_simd::filled(&input.modulation[pixels.clone()], Modulation::default()),
            intensity: fringeflow_simd::filled(&input.mean[pixels.clone()], 0),
            candidates: fringeflow_simd::filled(&input.passing[pixels.clone()], 0),
            confidence: fringeflow_simd::filled(&input.confidence[pixels], Confidence::NONE),
        }
    }

    /// Writes the points of the tile, whose first pixel is at column and row `[u, v]`; returns their number.
    #[inline(always)]
    fn write_points<P: PointForm>(
        &self,
        shared: &Shared<'_>,
        [ray_x, ray_y, row_px]: [[f32; TILE_PX]; 3],
        [u, v]: [usize; 2],
        out: &mut [P],
    ) -> usize {
        let (mut x_m, mut y_m, mut z_m) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut u2_px, mut v2_px) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut delta_rad, mut sigma_m) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut confidence, mut has_point) = ([0.0_f32; TILE_PX], [false; TILE_PX]);
        for i in 0..TILE_PX {
            let found = shared.triangulation.triangulate([ray_x[i], ray_y[i]], self.column_px[i], row_px[i]);
            let slope = f32::from(self.slope[i].unsigned_abs().max(1));
            let column_sd_px = shared.phase_noise / (self.modulation[i].grey() * slope);
            let (x, y, z) = (ray_x[i] * found.depth_m, ray_y[i] * found.depth_m, found.depth_m);
            (x_m[i], y_m[i], z_m[i]) = (x, y, z);
            [u2_px[i], v2_px[i]] = found.cam2_px;
            sigma_m[i] = column_sd_px * found.depth_per_column_m * found.range_per_depth;
            delta_rad[i] = f32::from(self.delta[i]) * RAD_PER_DELTA;
            confidence[i] = self.confidence[i].probability();
            // The sum is finite only if every term is: one comparison instead of six.
            let sum = x + y + z + u2_px[i] + v2_px[i] + sigma_m[i];
            has_point[i] = self.found[i] & (z > 0.0) & (sum.abs() < f32::INFINITY);
        }
        // A loop of its own: appending depends on the pixels before, and would keep the loop above from vectorizing.
        let mut count = 0;
        for i in 0..TILE_PX {
            if has_point[i] {
                out[count] = P::from_point(CloudPoint {
                    position_m: [x_m[i], y_m[i], z_m[i]],
                    intensity: self.intensity[i],
                    cam1_px: [(u + i) as u16, v as u16],
                    cam2_px: [u2_px[i], v2_px[i]],
                    order: self.order[i],
                    delta_rad: delta_rad[i],
                    candidates: self.candidates[i],
                    stage: self.outcome[i] as u8,
                    sigma_m: sigma_m[i],
                    confidence: confidence[i],
                });
                count += 1;
            }
        }
        count
    }
}

/// Moves the points of all rows together, and returns their number: a match without a point leaves a gap at the end of
/// its row.
fn close_gaps<P: Copy>(points: &mut [P], rows: &[RowPoints]) -> usize {
    let mut to = 0;
    for row in rows {
        if row.begin != to {
            points.copy_within(row.begin..row.begin + row.count, to);
        }
        to += row.count;
    }
    to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_with_fewer_points_than_matches_leave_no_gaps() {
        let mut points: Vec<CloudPoint> =
            (0..9).map(|i| CloudPoint { intensity: i, ..CloudPoint::default() }).collect();
        let rows = [(0, 3), (3, 0), (3, 1), (7, 2)].map(|(begin, count)| RowPoints { begin, count });
        let count = close_gaps(&mut points, &rows);
        let kept: Vec<u8> = points[..count].iter().map(|point| point.intensity).collect();
        assert_eq!(kept, [0, 1, 2, 3, 7, 8]);
    }
}
