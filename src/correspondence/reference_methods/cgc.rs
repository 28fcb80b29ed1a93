//! CGC: full Gray code in two fringe directions (paper, Table 2).
//!
//! In: absolute phase of both cameras along the columns and along the rows of the projector. Out: for each pixel of C1
//! the point of C2 with the same two phases. The geometry of the cameras only triangulates the point.
//!
//! The pixels of C2 are sorted into bins of their two phases. The search for a pixel of C1 starts at the closest pixel
//! in the bins around its own. Newton's method on the bilinear phases refines it to a sub-pixel point.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::{MatchError, ReferenceMatch, check_sizes, depths_of, order_of};
use crate::geometry::{MeasurementVolume, Pixel, Rig, triangulate};
use crate::phase::AbsolutePhase;

/// Width of a bin, turns: a few pixels of a usual fringe.
const BIN_TURNS: f32 = 0.25;
/// Neighbouring phases that differ by more turns lie on different surfaces.
const MAX_STEP_TURNS: f32 = 0.5;
/// Newton's steps; bilinear phases need two or three.
const MAX_STEPS: usize = 8;
/// Phase differences at which a point is accepted, turns.
const TOLERANCE_TURNS: f64 = 1e-4;
/// The sub-pixel point must stay this close to the pixel it started from, pixels.
const MAX_MOVE_PX: f64 = 3.0;

/// Matches absolute phases `[along columns, along rows]`. Returns one entry per pixel of C1, row by row.
///
/// With a volume, only points inside it are found.
///
/// # Errors
/// A phase of another size than its camera.
pub fn match_both_directions(
    rig: &Rig,
    cam1: [&AbsolutePhase; 2],
    cam2: [&AbsolutePhase; 2],
    volume: Option<&MeasurementVolume>,
) -> Result<Vec<Option<ReferenceMatch>>, MatchError> {
    check_sizes(rig, cam1[0], cam2[0])?;
    check_sizes(rig, cam1[1], cam2[1])?;
    let index = PhaseIndex::new(cam2);
    let matched = |i: usize| {
        let wanted = phases_of(cam1, i)?;
        let cam1_px = Pixel::new((i % cam1[0].width) as f64, (i / cam1[0].width) as f64);
        let cam2_px = refine(cam2, wanted, index.closest(wanted)?)?;
        let depth_m = triangulate(rig, &cam1_px, &cam2_px)?.point_cam1.z;
        let (near_m, far_m) = depths_of(&rig.cam1.ray(&cam1_px)?, volume)?;
        (near_m <= depth_m && depth_m <= far_m).then(|| ReferenceMatch { cam2_px, depth_m, order: order_of(wanted[0]) })
    };
    Ok((0..cam1[0].valid.len()).into_par_iter().map(matched).collect())
}

/// Both phases of a pixel, if both are valid.
fn phases_of(phases: [&AbsolutePhase; 2], pixel: usize) -> Option<[f32; 2]> {
    let [columns, rows] = phases;
    (columns.valid[pixel] && rows.valid[pixel]).then(|| [columns.turns[pixel], rows.turns[pixel]])
}

/// The pixels of C2 sorted by the bin of their phases.
struct PhaseIndex<'a> {
    phases: [&'a AbsolutePhase; 2],
    /// Bin and pixel, ascending.
    entries: Vec<([i32; 2], u32)>,
}

fn bin_of(phases: [f32; 2]) -> [i32; 2] {
    phases.map(|turns| (turns / BIN_TURNS).floor() as i32)
}

impl<'a> PhaseIndex<'a> {
    fn new(phases: [&'a AbsolutePhase; 2]) -> Self {
        let pixels = 0..phases[0].valid.len();
        let entry = |i: usize| phases_of(phases, i).map(|p| (bin_of(p), i as u32));
        let mut entries: Vec<_> = pixels.into_par_iter().filter_map(entry).collect();
        // Entries are distinct, so the order does not depend on the number of threads.
        entries.par_sort_unstable();
        Self { phases, entries }
    }

    /// The pixel with the closest phases, less than a bin away; the first of several.
    fn closest(&self, wanted: [f32; 2]) -> Option<usize> {
        let [bin_u, bin_v] = bin_of(wanted);
        let distance = |pixel: usize| {
            let [du, dv] = [0, 1].map(|d| self.phases[d].turns[pixel] - wanted[d]);
            du * du + dv * dv
        };
        let bins = (bin_u - 1..=bin_u + 1).flat_map(|u| self.between([u, bin_v - 1], [u, bin_v + 1]));
        let closest =
            bins.map(|&(_, i)| i as usize).min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
        closest.filter(|&i| distance(i) <= BIN_TURNS * BIN_TURNS)
    }

    fn between(&self, first: [i32; 2], last: [i32; 2]) -> &[([i32; 2], u32)] {
        let from = self.entries.partition_point(|&(bin, _)| bin < first);
        let to = self.entries.partition_point(|&(bin, _)| bin <= last);
        &self.entries[from..to]
    }
}

/// The raw point near `start` with the wanted phases; `None` where the surface ends.
fn refine(phases: [&AbsolutePhase; 2], wanted: [f32; 2], start: usize) -> Option<Pixel> {
    let width = phases[0].width;
    let origin = Pixel::new((start % width) as f64, (start / width) as f64);
    let mut at = origin;
    for _ in 0..MAX_STEPS {
        let (values, slopes) = bilinear(phases, &at)?;
        let residual = Vector2::new(f64::from(wanted[0]), f64::from(wanted[1])) - values;
        if residual.amax() < TOLERANCE_TURNS {
            return Some(at);
        }
        // A Newton step.
        at += slopes.try_inverse()? * residual;
        let moved_px = (at - origin).norm();
        if moved_px.is_nan() || moved_px > MAX_MOVE_PX {
            return None;
        }
    }
    None
}

/// Both phases and their derivatives (one row per phase) at a raw point, from the four pixels around it.
fn bilinear(phases: [&AbsolutePhase; 2], at: &Pixel) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (width, height) = (phases[0].width, phases[0].height);
    if !(at.x >= 0.0 && at.y >= 0.0 && at.x <= width as f64 - 1.0 && at.y <= height as f64 - 1.0) {
        return None;
    }
    // The last column and row belong to the cell before them.
    let (u, v) = ((at.x as usize).min(width - 2), (at.y as usize).min(height - 2));
    let corner = v * width + u;
    let (x, y) = (at.x - u as f64, at.y - v as f64);
    let (mut values, mut slopes) = (Vector2::zeros(), Matrix2::zeros());
    for (direction, phase) in phases.into_iter().enumerate() {
        let corners = [corner, corner + 1, corner + width, corner + width + 1];
        if !corners.iter().all(|&i| phase.valid[i]) {
            return None;
        }
        let turns = corners.map(|i| phase.turns[i]);
        if turns.iter().any(|t| (t - turns[0]).abs() > MAX_STEP_TURNS) {
            return None;
        }
        let [a, b, c, d] = turns.map(f64::from);
        values[direction] = (1.0 - y) * (a + x * (b - a)) + y * (c + x * (d - c));
        slopes[(direction, 0)] = (1.0 - y) * (b - a) + y * (d - c);
        slopes[(direction, 1)] = (1.0 - x) * (c - a) + x * (d - b);
    }
    Some((values, slopes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::reference_methods::test_scene::Scene;

    #[test]
    fn points_of_a_plane_are_found_within_a_fiftieth_of_a_pixel() {
        let scene = Scene::new();
        let (columns1, rows1) = (scene.cam1_columns(), scene.cam1_rows());
        let (columns2, rows2) = (scene.cam2_columns(), scene.cam2_rows());
        let found = match_both_directions(&scene.rig, [&columns1, &rows1], [&columns2, &rows2], None).unwrap();
        let (count, worst) = scene.worst_error_px(&found);
        assert!(count > 10_000, "{count} points");
        assert!(worst < 0.02, "{worst} px");
    }

    #[test]
    fn a_point_without_a_surface_around_it_is_not_found() {
        let scene = Scene::new();
        let (columns1, rows1) = (scene.cam1_columns(), scene.cam1_rows());
        let (mut columns2, rows2) = (scene.cam2_columns(), scene.cam2_rows());
        let all = match_both_directions(&scene.rig, [&columns1, &rows1], [&columns2, &rows2], None).unwrap();
        // Every other pixel of C2 lost leaves no four neighbours.
        for valid in columns2.valid.iter_mut().step_by(2) {
            *valid = false;
        }
        let none = match_both_directions(&scene.rig, [&columns1, &rows1], [&columns2, &rows2], None).unwrap();
        assert!(all.iter().flatten().count() > 0 && none.iter().flatten().count() == 0);
    }

    #[test]
    fn the_volume_restricts_the_points() {
        let scene = Scene::new();
        let volume = scene.half_of_the_plane();
        let (columns1, rows1) = (scene.cam1_columns(), scene.cam1_rows());
        let (columns2, rows2) = (scene.cam2_columns(), scene.cam2_rows());
        let found = match_both_directions(&scene.rig, [&columns1, &rows1], [&columns2, &rows2], Some(&volume)).unwrap();
        assert!(found.iter().flatten().count() > 1000);
        for (i, found) in found.iter().enumerate() {
            assert!(found.is_none_or(|f| volume.contains(&scene.point(i, f.depth_m))));
        }
    }
}
