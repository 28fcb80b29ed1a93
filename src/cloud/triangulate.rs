//! From correspondences to points with their standard deviation.
//!
//! The correspondence lies on the epipolar line of its pixel, so the two rays meet; the depth is linear-fractional in the
//! column of the epipolar frame.

use std::f64::consts::TAU;
use std::ops::Range;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::{Confidence, Matches, Outcome, RayRow, SegmentTable};
use crate::geometry::{EpipolarFrame, Sights};
use crate::phase::Modulation;

use super::{Cloud, CloudPoint};

/// Pixels that are looked at together.
const TILE_PX: usize = RayRow::PIXELS;
/// Rows that one thread takes at a time.
const ROWS_AT_A_TIME: usize = 16;
/// δ is told in turns · 65536.
const RAD_PER_DELTA: f32 = (TAU / 65536.0) as f32;

/// What the points are made of, beside the matches.
#[derive(Clone, Copy)]
pub struct TriangulationInput<'a> {
    /// Width of the images of C1, pixels.
    pub width: usize,
    /// Mean grey level of every pixel of C1, see [`crate::phase::PhaseMap`].
    pub mean: &'a [u8],
    /// Modulation of every pixel of C1.
    pub modulation: &'a [Modulation],
    /// Standard deviation of the phase of C1 and of C2, times the modulation, grey levels: noise of the grey levels times its
    /// gain, see [`crate::phase::FitStatistics`].
    pub phase_noise_grey: [f32; 2],
    /// Segment table that the matches come from.
    pub table: &'a SegmentTable,
}

/// Makes the points of one window after the other, in the same memory.
#[derive(Clone, Debug)]
pub struct Triangulator {
    sights: Sights,
    /// Of each row the place of its first point, if all of its matches have one, and how many have.
    rows: Vec<PointsOfRow>,
}

#[derive(Clone, Copy, Debug, Default)]
struct PointsOfRow {
    begin: usize,
    made: usize,
}

impl Triangulator {
    /// For the rig of an epipolar frame.
    #[must_use]
    pub fn new(frame: &EpipolarFrame) -> Self {
        Self { sights: frame.sights(), rows: Vec::new() }
    }

    /// Makes the points of all matches, in the order of their pixels, in the memory of the cloud before; a match whose rays part
    /// has none.
    ///
    /// `sigma_m` is predicted from noise: sd(φ) = gain · σ/B in either camera (the modulation of C1 stands for both),
    /// divided by the slope of the phase along the epipolar line, times the depth per column, times the length of the ray.
    pub fn triangulate(&mut self, matches: &Matches, input: TriangulationInput<'_>, cloud: &mut Cloud) {
        let Self { sights, rows } = self;
        let [cam1_grey, cam2_grey] = input.phase_noise_grey.map(f64::from);
        let phase_noise = (cam1_grey.hypot(cam2_grey) / TAU * 65536.0) as f32;
        rows.clear();
        let mut end = 0;
        rows.extend(matches.outcomes.chunks_exact(input.width.max(1)).map(|outcomes| {
            let begin = end;
            end += outcomes.iter().map(|outcome| usize::from(outcome.is_found())).sum::<usize>();
            PointsOfRow { begin, made: 0 }
        }));
        cloud.points.resize(end, CloudPoint::default());
        let work = Work { matches, input, sights, phase_noise };
        work.fill(0..rows.len(), rows, &mut cloud.points);
        close_gaps(&mut cloud.points, rows);
    }
}

/// What all rows share.
#[derive(Clone, Copy)]
struct Work<'a> {
    matches: &'a Matches,
    input: TriangulationInput<'a>,
    sights: &'a Sights,
    /// Standard deviation of the phase of both cameras together at a modulation of a grey level, turns · 65536.
    phase_noise: f32,
}

impl Work<'_> {
    /// Fills in the points of some rows, in parallel.
    fn fill(self, range: Range<usize>, rows: &mut [PointsOfRow], points: &mut [CloudPoint]) {
        if range.len() > ROWS_AT_A_TIME {
            let (middle, half) = (range.start + range.len() / 2, range.len() / 2);
            let (upper, lower) = rows.split_at_mut(half);
            let (points_above, points_below) = points.split_at_mut(lower[0].begin - upper[0].begin);
            rayon::join(
                || self.fill(range.start..middle, upper, points_above),
                || self.fill(middle..range.end, lower, points_below),
            );
            return;
        }
        let mut rest = points;
        for (place, v) in range.enumerate() {
            let count = rows.get(place + 1).map_or(rest.len(), |next| next.begin - rows[place].begin);
            let out;
            (out, rest) = rest.split_at_mut(count);
            rows[place].made = fringeflow_simd::run(Level::in_use(), RowKernel { work: self, v, out });
        }
    }
}

/// Makes the points of row `v`; how many there are.
struct RowKernel<'a, 'b> {
    work: Work<'a>,
    v: usize,
    out: &'b mut [CloudPoint],
}

impl Kernel for RowKernel<'_, '_> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> usize {
        let Self { work, v, out } = self;
        let width = work.input.width;
        let rays = work.input.table.rays(v);
        let mut made = 0;
        for k in 0..width.div_ceil(TILE_PX) {
            let first = v * width + TILE_PX * k;
            let tile = Tile::new(&work, first, TILE_PX.min(width - TILE_PX * k));
            if tile.found.contains(&true) {
                made += tile.points(&work, rays.of_patch(k), [TILE_PX * k, v], &mut out[made..]);
            }
        }
        made
    }
}

/// What is known of some neighbouring pixels of a row.
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
    /// `count` pixels from `first` on; nothing is found beyond them.
    #[inline(always)]
    fn new(work: &Work<'_>, first: usize, count: usize) -> Self {
        let (matches, input, pixels) = (work.matches, &work.input, first..first + count);
        let outcome = fringeflow_simd::filled(&matches.outcomes[pixels.clone()], Outcome::Invalid);
        let mut found = [false; TILE_PX];
        for i in 0..TILE_PX {
            found[i] = outcome[i].is_found();
        }
        Self {
            found,
            outcome,
            column_px: fringeflow_simd::filled(&matches.chosen.column_px[pixels.clone()], 0.0),
            order: fringeflow_simd::filled(&matches.chosen.order[pixels.clone()], 0),
            delta: fringeflow_simd::filled(&matches.chosen.delta[pixels.clone()], 0),
            slope: fringeflow_simd::filled(&matches.chosen.slope[pixels.clone()], 0),
            modulation: fringeflow_simd::filled(&input.modulation[pixels.clone()], Modulation::default()),
            intensity: fringeflow_simd::filled(&input.mean[pixels.clone()], 0),
            candidates: fringeflow_simd::filled(&matches.passing[pixels.clone()], 0),
            confidence: fringeflow_simd::filled(&matches.confidence[pixels], Confidence::NONE),
        }
    }

    /// Makes their points, of pixels from column and row `[u, v]` on; how many there are.
    #[inline(always)]
    fn points(
        &self,
        work: &Work<'_>,
        [ray_x, ray_y, row_px]: [[f32; TILE_PX]; 3],
        [u, v]: [usize; 2],
        out: &mut [CloudPoint],
    ) -> usize {
        let (mut x_m, mut y_m, mut z_m) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut u2_px, mut v2_px) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut delta_rad, mut sigma_m) = ([0.0_f32; TILE_PX], [0.0_f32; TILE_PX]);
        let (mut confidence, mut is_seen) = ([0.0_f32; TILE_PX], [false; TILE_PX]);
        for i in 0..TILE_PX {
            let seen = work.sights.look([ray_x[i], ray_y[i]], self.column_px[i], row_px[i]);
            let slope = f32::from(self.slope[i].unsigned_abs().max(1));
            let column_sd_px = work.phase_noise / (self.modulation[i].grey() * slope);
            let (x, y, z) = (ray_x[i] * seen.depth_m, ray_y[i] * seen.depth_m, seen.depth_m);
            (x_m[i], y_m[i], z_m[i]) = (x, y, z);
            [u2_px[i], v2_px[i]] = seen.cam2_px;
            sigma_m[i] = column_sd_px * seen.depth_per_column_m * seen.range_per_depth;
            delta_rad[i] = f32::from(self.delta[i]) * RAD_PER_DELTA;
            confidence[i] = self.confidence[i].probability();
            // Before the camera, and no number that is not finite.
            let sum = x + y + z + u2_px[i] + v2_px[i] + sigma_m[i];
            is_seen[i] = self.found[i] & (z > 0.0) & (sum.abs() < f32::INFINITY);
        }
        let mut made = 0;
        for i in 0..TILE_PX {
            if is_seen[i] {
                out[made] = CloudPoint {
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
                };
                made += 1;
            }
        }
        made
    }
}

/// Keeps of each row's points those that were made: of some matches the rays part.
fn close_gaps(points: &mut Vec<CloudPoint>, rows: &[PointsOfRow]) {
    let mut to = 0;
    for row in rows {
        if row.begin != to {
            points.copy_within(row.begin..row.begin + row.made, to);
        }
        to += row.made;
    }
    points.truncate(to);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_with_fewer_points_than_matches_leave_no_gaps() {
        let mut points: Vec<CloudPoint> =
            (0..9).map(|i| CloudPoint { intensity: i, ..CloudPoint::default() }).collect();
        let rows = [(0, 3), (3, 0), (3, 1), (7, 2)].map(|(begin, made)| PointsOfRow { begin, made });
        close_gaps(&mut points, &rows);
        assert_eq!(points.iter().map(|point| point.intensity).collect::<Vec<_>>(), [0, 1, 2, 3, 7, 8]);
    }
}
