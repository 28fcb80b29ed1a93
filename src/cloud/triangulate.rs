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
            let seen = pixels.iter().enumerate().filter_map(|(k, &u)| {
                let i = v * width + u;
                point(matches, &input, phase_noise, i, matches.chosen[i].as_ref()?, sights, sighted, k)
            });
            out.iter_mut().zip(seen).map(|(out, point)| *out = point).count()
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

/// The point of pixel `i`, the k-th correspondence of its row.
#[inline]
fn point(
    matches: &Matches,
    input: &TriangulationInput<'_>,
    phase_noise: f64,
    i: usize,
    candidate: &Candidate,
    sights: &Sights,
    sighted: &Sighted,
    k: usize,
) -> Option<CloudPoint> {
    let (x, y, depth_m) = (f64::from(sights.ray_x[k]), f64::from(sights.ray_y[k]), sighted.depth_m[k]);
    let per_depth = (x * x + y * y + 1.0).sqrt();
    let sigma_m = column_sd_px(phase_noise, input.modulation[i], candidate) * sighted.depth_per_column_m[k] * per_depth;
    let cam2_px = [sighted.cam2_u_px[k], sighted.cam2_v_px[k]];
    let finite = depth_m > 0.0 && (depth_m * per_depth + sigma_m + cam2_px[0]).is_finite();
    finite.then(|| CloudPoint {
        position_m: [(x * depth_m) as f32, (y * depth_m) as f32, depth_m as f32],
        intensity: input.mean[i],
        cam1_px: [(i % input.width) as u16, (i / input.width) as u16],
        cam2_px: cam2_px.map(|px| px as f32),
        order: candidate.order,
        delta_rad: (f64::from(candidate.delta) / 65536.0 * TAU) as f32,
        candidates: matches.passing[i],
        stage: matches.outcomes[i] as u8,
        sigma_m: sigma_m as f32,
        confidence: matches.confidence[i].probability(),
    })
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
