//! From correspondences to points with their standard deviation.
//!
//! The correspondence lies on the epipolar line of its pixel, so the two rays meet; the depth is linear-fractional in the
//! column of the epipolar frame.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::correspondence::{Candidate, Matches, SegmentRow, SegmentTable};
use crate::geometry::{EpipolarFrame, Sighted, Sights};
use crate::phase::Modulation;

use super::{Cloud, CloudPoint};

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
    /// Epipolar frame of the same rig.
    pub frame: &'a EpipolarFrame,
}

/// Makes the points of all matches, in the order of their pixels, in the memory of the cloud before.
///
/// `sigma_m` is predicted from noise: sd(φ) = gain · σ/B in either camera (the modulation of C1 stands for both),
/// divided by the slope of the phase along the epipolar line, times the depth per column, times the length of the ray.
pub fn triangulate(matches: &Matches, input: TriangulationInput<'_>, cloud: &mut Cloud) {
    let width = input.width.max(1);
    let [cam1_grey, cam2_grey] = input.phase_noise_grey.map(f64::from);
    let phase_noise = cam1_grey.hypot(cam2_grey) / TAU * 65536.0;
    let rows = matches.chosen.par_chunks_exact(width);
    let counts: Vec<usize> = rows.map(|row| row.iter().flatten().count()).collect();
    cloud.points.resize(counts.iter().sum(), CloudPoint::default());
    let mut rest = cloud.points.as_mut_slice();
    let rows: Vec<&mut [CloudPoint]> = counts.iter().filter_map(|&count| rest.split_off_mut(..count)).collect();
    let made: Vec<usize> = rows
        .into_par_iter()
        .enumerate()
        .map_init(Room::default, |room, (v, out)| {
            let Room { segments, pixels, sights, sighted } = room;
            input.table.row(v, segments);
            pixels.clear();
            sights.clear();
            for u in 0..width {
                if let Some(candidate) = &matches.chosen[v * width + u] {
                    pixels.push(u);
                    sights.push([segments.ray_x[u], segments.ray_y[u]], segments.row_px[u], candidate.column_px);
                }
            }
            input.frame.look(sights, sighted);
            let mut made = 0;
            for (k, &u) in pixels.iter().enumerate() {
                let i = v * width + u;
                if let Some(candidate) = &matches.chosen[i]
                    && let Some(out) = out.get_mut(made)
                {
                    *out = point(matches, &input, phase_noise, [u, v], candidate, sights, sighted, k);
                    made += usize::from(is_seen(out));
                }
            }
            made
        })
        .collect();
    close_gaps(&mut cloud.points, &counts, &made);
}

/// Keeps of each row's points those that were made: of some matches the rays part.
fn close_gaps(points: &mut Vec<CloudPoint>, counts: &[usize], made: &[usize]) {
    let (mut from, mut to) = (0, 0);
    for (&count, &made) in counts.iter().zip(made) {
        if from != to {
            points.copy_within(from..from + made, to);
        }
        (from, to) = (from + count, to + made);
    }
    points.truncate(to);
}

/// What a row is triangulated with, used again for the next.
#[derive(Default)]
struct Room {
    segments: SegmentRow,
    /// Columns of the pixels with a correspondence.
    pixels: Vec<usize>,
    sights: Sights,
    sighted: Sighted,
}

/// The point of a pixel, the k-th correspondence of its row; some number of it is not finite where the rays part.
#[inline(always)]
fn point(
    matches: &Matches,
    input: &TriangulationInput<'_>,
    phase_noise: f64,
    [u, v]: [usize; 2],
    candidate: &Candidate,
    sights: &Sights,
    sighted: &Sighted,
    k: usize,
) -> CloudPoint {
    let i = v * input.width + u;
    let (x, y, depth_m) = (f64::from(sights.ray_x[k]), f64::from(sights.ray_y[k]), sighted.depth_m[k]);
    let column_sd_px = column_sd_px(phase_noise, input.modulation[i], candidate);
    let sigma_m = column_sd_px * sighted.depth_per_column_m[k] * sighted.range_per_depth[k];
    CloudPoint {
        position_m: [(x * depth_m) as f32, (y * depth_m) as f32, depth_m as f32],
        intensity: input.mean[i],
        cam1_px: [u as u16, v as u16],
        cam2_px: [sighted.cam2_u_px[k] as f32, sighted.cam2_v_px[k] as f32],
        order: candidate.order,
        delta_rad: (f64::from(candidate.delta) / 65536.0 * TAU) as f32,
        candidates: matches.passing[i],
        stage: matches.outcomes[i] as u8,
        sigma_m: sigma_m as f32,
        confidence: matches.confidence[i].probability(),
    }
}

/// Whether the rays of a point meet before the camera, and all of its numbers are finite.
#[inline(always)]
fn is_seen(point: &CloudPoint) -> bool {
    let ([x, y, z], [u, v]) = (point.position_m, point.cam2_px);
    (z > 0.0) & (x + y + z + u + v + point.sigma_m).is_finite()
}

/// Standard deviation of the column of a correspondence, pixels, where the phases of both cameras err by so much at a modulation of
/// a grey level, turns · 65536.
#[inline]
fn column_sd_px(phase_noise: f64, modulation: Modulation, candidate: &Candidate) -> f64 {
    phase_noise / (f64::from(modulation.grey()) * f64::from(candidate.slope.unsigned_abs().max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_with_fewer_points_than_matches_leave_no_gaps() {
        let mut points: Vec<CloudPoint> =
            (0..9).map(|i| CloudPoint { intensity: i, ..CloudPoint::default() }).collect();
        close_gaps(&mut points, &[3, 0, 4, 2], &[3, 0, 1, 2]);
        assert_eq!(points.iter().map(|point| point.intensity).collect::<Vec<_>>(), [0, 1, 2, 3, 7, 8]);
    }
}
