//! What the pixels of a camera see, for images alone: smooth surfaces are interpolated.
//!
//! In: a camera and a scene. Out: surface and light at the centre of each pixel. Rays are traced at every fourth pixel of
//! every fourth row. In between, grid by grid, a cubic through four neighbours in the row, or in the column, takes the
//! place of a ray if all four see one surface, all in light or all in shadow, and if their third differences are small.
//! Otherwise the ray is traced. So seven of eight rays are spared. What is narrower than four pixels can be missed
//! between two rays: in a scene with many edges, one pixel of ten thousand differs.

use rayon::prelude::*;

use super::scene::Surface;
use super::view::{Eye, Sample};

/// What the centre of a pixel sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Seen {
    /// The surface that its ray hits; `None` if there is none.
    pub(super) surface: Option<Surface>,
    /// Light at that point.
    pub(super) sample: Sample,
}

/// Distance of the pixels of the coarsest grid.
const COARSEST_PX: usize = 4;
/// Largest third differences of four neighbours: projector pixels, and share of the brightness. The error of a cubic is
/// 3/128 of the fourth difference, so less than a twentieth of that.
const BEND_PX: f32 = 0.06;
const BEND_SHARE: f32 = 0.02;

/// Returns what the pixels see, row by row.
pub(super) fn seen(eye: &Eye<'_>, width: usize, height: usize) -> Vec<Seen> {
    // trace every pixel of the coarsest grid
    // for each grid, the coarsest first:
    //     in its rows, fill the places between its pixels from these
    //     in the rows between, fill the places above and below its pixels and the filled places
    let mut pixels = vec![Seen::default(); width * height];
    pixels.par_chunks_mut((COARSEST_PX * width).max(1)).enumerate().for_each(|(row, rows)| {
        for u in (0..width).step_by(COARSEST_PX) {
            rows[u] = eye.seen(u, row * COARSEST_PX);
        }
    });
    let mut grid_px = COARSEST_PX;
    while grid_px > 1 {
        let half_px = grid_px / 2;
        pixels.par_chunks_mut((grid_px * width).max(1)).enumerate().for_each(|(row, rows)| {
            for u in (half_px..width).step_by(grid_px) {
                rows[u] = between(u, half_px, width, |u| rows[u]).unwrap_or_else(|| eye.seen(u, row * grid_px));
            }
        });
        let row_between = |v: usize| -> Vec<Seen> {
            let seen = |u| between(v, half_px, height, |v| pixels[v * width + u]).unwrap_or_else(|| eye.seen(u, v));
            (0..width).step_by(half_px).map(seen).collect()
        };
        let rows = (half_px..height).into_par_iter().step_by(grid_px);
        let rows: Vec<_> = rows.map(|v| (v, row_between(v))).collect();
        for (v, row) in rows {
            pixels[v * width..][..width].iter_mut().step_by(half_px).zip(row).for_each(|(pixel, seen)| *pixel = seen);
        }
        grid_px = half_px;
    }
    pixels
}

/// Returns what is seen at place `at` of a row or column of a length, if its neighbours at distances of once and three
/// times `half_px` belong to one smooth, evenly lit piece of surface.
fn between(at: usize, half_px: usize, length: usize, seen: impl Fn(usize) -> Seen) -> Option<Seen> {
    if at < 3 * half_px || at + 3 * half_px >= length {
        return None;
    }
    let neighbours = [at - 3 * half_px, at - half_px, at + half_px, at + 3 * half_px].map(seen);
    let [first, second, ..] = &neighbours;
    let is_lit = |seen: &Seen| seen.sample.reflected > 0.0;
    if !neighbours.iter().all(|other| other.surface == first.surface && is_lit(other) == is_lit(first)) {
        return None;
    }
    let bend = BEND_SHARE * second.sample.reflected.max(second.sample.albedo);
    let value = |of: fn(&Sample) -> f32, bend| cubic(neighbours.each_ref().map(|seen| of(&seen.sample)), bend);
    let sample = Sample {
        column_px: value(|s| s.column_px, BEND_PX)?,
        row_px: value(|s| s.row_px, BEND_PX)?,
        reflected: value(|s| s.reflected, bend)?,
        albedo: value(|s| s.albedo, bend)?,
    };
    Some(Seen { surface: first.surface, sample })
}

/// Returns the value of a cubic in the middle of four evenly spaced values, if their third difference is at most `bend`.
fn cubic([a, b, c, d]: [f32; 4], bend: f32) -> Option<f32> {
    let (inner, outer) = (b + c, a + d);
    ((d - a - 3.0 * (c - b)).abs() <= bend).then(|| inner / 2.0 + (inner - outer) / 16.0)
}

#[cfg(test)]
mod tests {
    use fringeflow_dataset::CameraId;

    use crate::simulation::sensor::{ImageSeed, Sensor};
    use crate::simulation::virtual_scanner::tests::options;
    use crate::simulation::{Object, RigOptions, SweepOptions, View, VirtualScanner, VirtualScannerOptions};

    use super::*;

    #[test]
    fn a_cubic_is_exact_on_cubics_and_refuses_kinks() {
        let at = |x: f32| 1.0 + 0.5 * x - 0.3 * x * x + 0.001 * x * x * x;
        assert!((cubic([-3.0, -1.0, 1.0, 3.0].map(at), 0.1).unwrap() - 1.0).abs() < 1e-5);
        assert_eq!(cubic([0.0, 0.0, 0.1, 0.5], 0.02), None);
    }

    #[test]
    fn interpolated_images_equal_traced_ones() {
        let far = SweepOptions {
            travel_mm: [9.0, 8.0, 1.0],
            turn_deg: [3.0, 4.0, 5.0],
            outside_mm: 100.0,
            ..SweepOptions::default()
        };
        for object in [Object::Elephant, Object::Machine, Object::Tooth, Object::Clutter, Object::Tray] {
            let options = VirtualScannerOptions {
                object,
                rig: RigOptions { size_px: [640, 512], ..options().rig },
                sweep: far,
                ..options()
            };
            let scanner = VirtualScanner::new(options).unwrap();
            let rig = &scanner.rig().exact;
            let scene = scanner.scene().at(scanner.cam1_from_object(5));
            for camera in CameraId::BOTH {
                let image = |view: &View| {
                    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
                    Sensor::exposed(None, 1.0).image(view, &scanner.projected(1), seed)
                };
                let expected = image(&View::trace(rig, &scene, camera, 1).unwrap());
                let found = image(&View::for_images(rig, &scene, camera, 1).unwrap());
                let off = found.pixels.iter().zip(&expected.pixels).filter(|(a, b)| a.abs_diff(**b) > 1).count();
                // At corners narrower than two pixels.
                assert!(off <= found.pixels.len() / 5000, "{object:?}, {camera:?}: {off} pixels differ");
            }
        }
    }
}
