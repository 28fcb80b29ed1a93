//! EGC: full Gray code with epipolar lines (paper, Table 2).
//!
//! In: absolute phase of both cameras. Out: for each pixel of C1 the point of its epipolar line in C2 with the same
//! absolute phase. The absolute phase of C2 is resampled into the epipolar frame once. A search runs along the line,
//! between two rows of the frame.
//!
//! Along a line the absolute phase is monotone where the surface is, so the point is unique. Noise, mixed pixels and
//! depth steps can make the phase cross the value more than once. Of the crossings in the sense of most of the line,
//! the one nearest to C1 counts: its surface hides everything behind.

use rayon::prelude::*;

use super::{MatchError, ReferenceMatch, check_sizes, depths_of, order_of};
use crate::geometry::{EpipolarFrame, EpipolarLine, MeasurementVolume, Pixel, Rig};
use crate::phase::AbsolutePhase;

/// Neighbouring absolute phases that differ by more turns lie on different surfaces.
///
/// Generous, since the mixed pixels of both cameras at a depth edge correspond too.
const MAX_STEP_TURNS: f32 = 0.8;

/// Matches absolute phases along epipolar lines. Returns one entry per pixel of C1, row by row.
///
/// With a volume, only points inside it are found.
///
/// # Errors
/// A phase of another size than its camera, or a rig without an epipolar frame.
pub fn match_along_epipolar_lines(
    rig: &Rig,
    cam1: &AbsolutePhase,
    cam2: &AbsolutePhase,
    volume: Option<&MeasurementVolume>,
) -> Result<Vec<Option<ReferenceMatch>>, MatchError> {
    check_sizes(rig, cam1, cam2)?;
    let frame = EpipolarFrame::new(rig)?;
    let resampled = resample(&frame, cam2);
    let matched = |i: usize| {
        let wanted = cam1.valid[i].then(|| cam1.turns[i])?;
        let ray = rig.cam1.ray(&Pixel::new((i % cam1.width) as f64, (i / cam1.width) as f64))?;
        let (near_m, far_m) = depths_of(&ray, volume)?;
        let line = frame.line(&ray)?;
        let columns = columns_of(&line, near_m, far_m, resampled.width)?;
        let column_px = resampled.rows_at(line.row_px)?.find(wanted, columns, line.column_per_inverse_depth > 0.0)?;
        let depth_m = line.depth_of_column(column_px);
        if !(near_m <= depth_m && depth_m <= far_m && depth_m.is_finite()) {
            return None;
        }
        let cam2_px = frame.cam2_pixel(&Pixel::new(column_px, line.row_px))?;
        Some(ReferenceMatch { cam2_px, depth_m, order: order_of(wanted) })
    };
    Ok((0..cam1.valid.len()).into_par_iter().map(matched).collect())
}

/// Whole columns, first and last, that enclose the columns of a range of depths inside a frame.
fn columns_of(line: &EpipolarLine, near_m: f64, far_m: f64, width: usize) -> Option<(usize, usize)> {
    // A nearest depth of almost zero lies infinitely far out on one side.
    let (a, b) = (line.column_of_depth(near_m), line.column_of_depth(far_m));
    let last = width as f64 - 1.0;
    let (from, to) = (a.min(b).floor().max(0.0), a.max(b).ceil().min(last));
    (from < to).then_some((from as usize, to as usize))
}

/// Absolute phase of C2 in the epipolar frame; NaN where there is none.
struct EpipolarPhase {
    width: usize,
    height: usize,
    turns: Vec<f32>,
}

fn resample(frame: &EpipolarFrame, cam2: &AbsolutePhase) -> EpipolarPhase {
    let (width, height) = (frame.width_px(), frame.height_px());
    let at = |i: usize| {
        let place = Pixel::new((i % width) as f64, (i / width) as f64);
        frame.cam2_pixel(&place).and_then(|pixel| sample(cam2, &pixel)).unwrap_or(f32::NAN)
    };
    EpipolarPhase { width, height, turns: (0..width * height).into_par_iter().map(at).collect() }
}

/// Absolute phase at a raw point: bilinear on a surface, else that of the nearest pixel, if it is valid.
fn sample(phase: &AbsolutePhase, pixel: &Pixel) -> Option<f32> {
    let value = |u: f64, v: f64| {
        let inside = u >= 0.0 && v >= 0.0 && u < phase.width as f64 && v < phase.height as f64;
        let i = inside.then(|| v as usize * phase.width + u as usize)?;
        phase.valid[i].then(|| phase.turns[i])
    };
    let (u, v) = (pixel.x.floor(), pixel.y.floor());
    // Beyond the outermost pixel centres the nearest pixel would be off by up to half a pixel.
    if !(u >= 0.0 && v >= 0.0 && pixel.x <= phase.width as f64 - 1.0 && pixel.y <= phase.height as f64 - 1.0) {
        return None;
    }
    let corners = [value(u, v), value(u + 1.0, v), value(u, v + 1.0), value(u + 1.0, v + 1.0)];
    if let [Some(a), Some(b), Some(c), Some(d)] = corners {
        let (least, most) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
        if most - least < MAX_STEP_TURNS {
            let (x, y) = ((pixel.x - u) as f32, (pixel.y - v) as f32);
            return Some((1.0 - y) * (a + x * (b - a)) + y * (c + x * (d - c)));
        }
    }
    value(pixel.x.round(), pixel.y.round())
}

impl EpipolarPhase {
    /// The rows on both sides of a line. `None` if the line leaves the frame.
    fn rows_at(&self, row_px: f64) -> Option<RowPair<'_>> {
        let row = row_px.floor();
        if !(row >= 0.0 && row + 1.0 < self.height as f64) {
            return None;
        }
        let start = row as usize * self.width;
        let (upper, rest) = self.turns[start..].split_at(self.width);
        Some(RowPair { upper, lower: &rest[..self.width], weight: (row_px - row) as f32 })
    }
}

/// Two neighbouring rows of an [`EpipolarPhase`] and the place of a line between them.
struct RowPair<'a> {
    upper: &'a [f32],
    lower: &'a [f32],
    /// 0 on the upper row, 1 on the lower.
    weight: f32,
}

/// A place where the phase passes the value looked for.
struct Crossing {
    column_px: f64,
    rising: bool,
}

impl RowPair<'_> {
    /// Absolute phase on the line at a column; NaN where there is none.
    fn at(&self, column: usize) -> f32 {
        let (a, b) = (self.upper[column], self.lower[column]);
        let step = b - a;
        if step.abs() < MAX_STEP_TURNS {
            return a + self.weight * step;
        }
        if self.weight < 0.5 { a } else { b }
    }

    /// Column where the line has the absolute phase `wanted`. `near_last` is true if the last columns are the nearest
    /// to C1.
    fn find(&self, wanted: f32, (from, to): (usize, usize), near_last: bool) -> Option<f64> {
        let mut crossings = Vec::new();
        let (mut before, mut rising) = (self.at(from), 0_i32);
        for column in from + 1..=to {
            let here = self.at(column);
            let step = here - before;
            if step.abs() < MAX_STEP_TURNS {
                rising += if step > 0.0 { 1 } else { -1 };
                if (before < wanted) != (here < wanted) {
                    let share = f64::from((wanted - before) / step);
                    crossings.push(Crossing { column_px: (column - 1) as f64 + share, rising: step > 0.0 });
                }
            }
            before = here;
        }
        nearest(&crossings, rising > 0, near_last)
    }
}

/// Column of the crossing nearest to C1, of those in the sense of the line, else of all.
fn nearest(crossings: &[Crossing], line_rises: bool, near_last: bool) -> Option<f64> {
    let along = |c: &&Crossing| c.rising == line_rises;
    let columns = || crossings.iter();
    let found = if near_last {
        columns().rev().find(along).or(columns().next_back())
    } else {
        columns().find(along).or(columns().next())
    };
    found.map(|c| c.column_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::reference_methods::test_scene::Scene;

    #[test]
    fn points_of_a_plane_are_found_within_a_fiftieth_of_a_pixel() {
        let scene = Scene::new();
        let found = match_along_epipolar_lines(&scene.rig, &scene.cam1_columns(), &scene.cam2_columns(), None).unwrap();
        let (count, worst) = scene.worst_error_px(&found);
        assert!(count > 10_000, "{count} points");
        assert!(worst < 0.02, "{worst} px");
    }

    #[test]
    fn the_volume_restricts_the_points() {
        let scene = Scene::new();
        let volume = scene.half_of_the_plane();
        let (cam1, cam2) = (scene.cam1_columns(), scene.cam2_columns());
        let all = match_along_epipolar_lines(&scene.rig, &cam1, &cam2, None).unwrap();
        let some = match_along_epipolar_lines(&scene.rig, &cam1, &cam2, Some(&volume)).unwrap();
        let inside = |found: &[Option<ReferenceMatch>]| found.iter().flatten().count();
        assert!(inside(&some) > 1000 && inside(&some) < inside(&all));
        for (i, found) in some.iter().enumerate() {
            assert!(found.is_none_or(|f| volume.contains(&scene.point(i, f.depth_m))));
        }
    }

    #[test]
    fn of_several_crossings_the_nearest_in_the_sense_of_the_line_counts() {
        // A noisy pixel at column 3, and a second surface from column 8 on.
        let row = [0.0, 0.1, 0.2, 0.12, 0.4, 0.5, 0.6, 0.7, 0.3, 0.51, 0.6];
        let pair = RowPair { upper: &row, lower: &row, weight: 0.3 };
        let column = |wanted, near_last| pair.find(wanted, (0, 10), near_last).unwrap();
        assert!((column(0.55, false) - 5.5).abs() < 1e-5);
        assert!((column(0.55, true) - 9.444).abs() < 1e-3);
        assert!((column(0.15, false) - 1.5).abs() < 1e-5);
        assert!(pair.find(0.8, (0, 10), false).is_none());
    }

    #[test]
    fn no_surface_is_made_up_between_rows_or_columns_of_different_orders() {
        let pair = RowPair { upper: &[1.0, 1.1, 3.0], lower: &[5.0, f32::NAN, 3.1], weight: 0.6 };
        assert_eq!(pair.at(0), 5.0);
        assert!(pair.at(1).is_nan());
        assert!((pair.at(2) - 3.06).abs() < 1e-6);
        assert!(pair.find(2.0, (0, 2), false).is_none());
    }

    #[test]
    fn a_phase_of_another_size_is_refused() {
        let scene = Scene::new();
        let small = AbsolutePhase::default();
        let refused = match_along_epipolar_lines(&scene.rig, &scene.cam1_columns(), &small, None);
        assert!(matches!(refused, Err(MatchError::Size { camera: 2, width: 0, .. })));
    }
}
