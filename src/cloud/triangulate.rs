//! From correspondences to points with their standard deviation.
//!
//! The correspondence lies on the epipolar line of its pixel, so the two rays meet; the depth is linear-fractional in the
//! column of the epipolar frame.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::correspondence::{Candidate, Matches, Segment, SegmentRow, SegmentTable};
use crate::geometry::{EpipolarFrame, Pixel, Vector3};
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

/// Points of all matches, in the order of their pixels.
///
/// `sigma_m` is predicted from noise: sd(φ) = gain · σ/B in either camera (the modulation of C1 stands for both),
/// divided by the slope of the phase along the epipolar line, times the depth per column, times the length of the ray.
#[must_use]
pub fn triangulate(matches: &Matches, input: TriangulationInput<'_>) -> Cloud {
    let width = input.width.max(1);
    let rows = (0..matches.chosen.len() / width).into_par_iter().map_init(SegmentRow::default, |segments, v| {
        input.table.row(v, segments);
        let row = (0..width).filter_map(|u| Some((u, matches.chosen[v * width + u]?)));
        let points = row.filter_map(|(u, c)| point(matches, &input, v * width + u, &segments.segment(u), &c));
        points.collect::<Vec<_>>()
    });
    Cloud { points: rows.collect::<Vec<_>>().concat() }
}

fn point(
    matches: &Matches,
    input: &TriangulationInput<'_>,
    i: usize,
    segment: &Segment,
    candidate: &Candidate,
) -> Option<CloudPoint> {
    let ray = Vector3::new(f64::from(segment.ray[0]), f64::from(segment.ray[1]), 1.0);
    let line = input.frame.line(&ray)?;
    let column_px = f64::from(candidate.column_px);
    let depth_m = line.depth_of_column(column_px);
    let cam2 = input.frame.cam2_pixel(&Pixel::new(column_px, f64::from(segment.row_px)))?;
    let depth_per_column = depth_m * depth_m / line.column_per_inverse_depth.abs();
    let sigma_m = column_sd_px(input, i, candidate) * depth_per_column * ray.norm();
    let position = ray * depth_m;
    let finite = depth_m > 0.0 && [position.norm(), sigma_m].iter().all(|x| x.is_finite());
    finite.then(|| CloudPoint {
        position_m: [position.x as f32, position.y as f32, position.z as f32],
        intensity: input.mean[i],
        cam1_px: [(i % input.width) as u16, (i / input.width) as u16],
        cam2_px: [cam2.x as f32, cam2.y as f32],
        order: candidate.order,
        delta_rad: (f64::from(candidate.delta) / 65536.0 * TAU) as f32,
        candidates: matches.passing[i],
        stage: matches.outcomes[i] as u8,
        sigma_m: sigma_m as f32,
        confidence: matches.confidence[i].probability(),
    })
}

/// Standard deviation of the column of a correspondence, pixels.
fn column_sd_px(input: &TriangulationInput<'_>, i: usize, candidate: &Candidate) -> f64 {
    let noise_grey = f64::from(input.phase_noise_grey[0]).hypot(f64::from(input.phase_noise_grey[1]));
    let phase_sd_turns = noise_grey / f64::from(input.modulation[i].grey()) / TAU;
    phase_sd_turns * 65536.0 / f64::from(candidate.slope.unsigned_abs().max(1))
}
