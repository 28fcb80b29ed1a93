//! Regions: selected candidates whose absolute phases continue from pixel to pixel, along and across rows.
//!
//! In: absolute phases and z of all pixels. Out: the [runs](super::runs) of each row, with the number of their region,
//! and the size of each region.

use std::ops::Range;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::neighbourhood::{ABSENT, MAX_STEP};
use crate::correspondence::runs::{Runs, Union, divide_at_marks};

/// Division of the selected pixels into regions.
#[derive(Clone, Debug, Default)]
pub(super) struct Regions {
    /// The runs; the set of each is its region.
    pub(super) runs: Runs<Vec<u8>>,
    /// Pixels of each region.
    pub(super) size_px: Vec<u32>,
}

impl Regions {
    /// Divides an image of `width` columns. Neighbours belong together if their absolute phases continue and their z
    /// differ by no more than `max_z_step`; a pixel with the absolute phase [`ABSENT`] belongs to none.
    pub(super) fn find(&mut self, width: usize, absolute: &[i32], z: &[f32], max_z_step: f32) {
        let height = absolute.len() / width;
        let row = |v: usize| Row { absolute: &absolute[v * width..][..width], z: &z[v * width..][..width] };
        let Self { runs, size_px } = self;
        runs.divide(height, rayon::iter::repeat_n((), height), |v, marks, (), runs| {
            marks.resize(width, 0);
            fringeflow_simd::run(Level::in_use(), Borders { row: row(v), max_z_step, marks });
            divide_at_marks(v * width, marks, |u| row(v).absolute[u] != ABSENT, runs);
        });
        let regions = runs.unite(width, |v, marks, overlaps, unions| {
            fringeflow_simd::run(Level::in_use(), Touches { rows: [row(v - 1), row(v)], max_z_step, marks });
            let marks = |shared: &Range<usize>| &marks[shared.start - v * width..shared.end - v * width];
            let touching = overlaps.filter(|(_, shared)| marks(shared).contains(&1));
            unions.extend(touching.map(|(runs, _)| Union { runs, order_step: 0 }));
        });
        size_px.clear();
        size_px.resize(regions, 0);
        runs.all.iter().for_each(|run| size_px[run.set as usize] += run.pixels().len() as u32);
    }
}

/// A row of pixels.
#[derive(Clone, Copy)]
struct Row<'a> {
    absolute: &'a [i32],
    z: &'a [f32],
}

/// Whether neighbours belong together.
#[inline(always)]
fn continues(absolute: [i32; 2], z: [f32; 2], max_z_step: f32) -> bool {
    let step = absolute[1].wrapping_sub(absolute[0]).wrapping_abs();
    (absolute[0] != ABSENT) & (absolute[1] != ABSENT) & (step <= MAX_STEP) & ((z[1] - z[0]).abs() <= max_z_step)
}

/// Marks the pixels of a row at which a run begins, or the one before ends, by 1.
struct Borders<'a> {
    row: Row<'a>,
    max_z_step: f32,
    marks: &'a mut [u8],
}

impl Kernel for Borders<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { row, max_z_step, marks } = self;
        let Some(last) = marks.len().checked_sub(1) else { return };
        marks[0] = u8::from(row.absolute[0] != ABSENT);
        let (before, here) = (&row.absolute[..last], &row.absolute[1..][..last]);
        let (z_before, z_here) = (&row.z[..last], &row.z[1..][..last]);
        let marks = &mut marks[1..][..last];
        for i in 0..last {
            let any = (before[i] != ABSENT) | (here[i] != ABSENT);
            marks[i] = u8::from(any & !continues([before[i], here[i]], [z_before[i], z_here[i]], max_z_step));
        }
    }
}

/// Marks the pixels that belong to the one above by 1.
struct Touches<'a> {
    rows: [Row<'a>; 2],
    max_z_step: f32,
    marks: &'a mut [u8],
}

impl Kernel for Touches<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { rows: [above, below], max_z_step, marks } = self;
        let width = marks.len();
        let (above, z_above) = (&above.absolute[..width], &above.z[..width]);
        let (below, z_below) = (&below.absolute[..width], &below.z[..width]);
        for i in 0..width {
            marks[i] = u8::from(continues([above[i], below[i]], [z_above[i], z_below[i]], max_z_step));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::neighbourhood::neighbours;
    use crate::correspondence::test_random::random;

    /// The region of each pixel, pixel by pixel: the oracle.
    fn flooded(width: usize, absolute: &[i32], z: &[f32], max_z_step: f32) -> Vec<Option<usize>> {
        let mut label = vec![None; absolute.len()];
        let mut regions = 0;
        for seed in 0..absolute.len() {
            if absolute[seed] == ABSENT || label[seed].is_some() {
                continue;
            }
            label[seed] = Some(regions);
            let mut next = vec![seed];
            while let Some(pixel) = next.pop() {
                for other in neighbours(pixel, width, absolute.len()).into_iter().flatten() {
                    let linked = absolute[other] != ABSENT
                        && (absolute[other] - absolute[pixel]).abs() <= MAX_STEP
                        && (z[other] - z[pixel]).abs() <= max_z_step;
                    if linked && label[other].is_none() {
                        label[other] = Some(regions);
                        next.push(other);
                    }
                }
            }
            regions += 1;
        }
        label
    }

    #[test]
    fn regions_are_those_of_a_flood() {
        let mut random = random(3);
        // The same scratch memory for all: its old content must not matter.
        let mut regions = Regions::default();
        for (width, height) in [(1, 1), (37, 71), (64, 9), (8, 40)] {
            let pixels = width * height;
            let absolute: Vec<i32> = (0..pixels)
                .map(|_| if random(5) == 0 { ABSENT } else { random(3) as i32 * (MAX_STEP - 7000) })
                .collect();
            let z: Vec<f32> = (0..pixels).map(|_| random(8) as f32).collect();
            for max_z_step in [5.0, f32::INFINITY] {
                let wanted = flooded(width, &absolute, &z, max_z_step);
                regions.find(width, &absolute, &z, max_z_step);
                let mut found = vec![None; pixels];
                for run in &regions.runs.all {
                    run.pixels().for_each(|pixel| found[pixel] = Some(run.set as usize));
                }
                assert_eq!(found, wanted);
                let size_px: Vec<u32> = (0..regions.size_px.len())
                    .map(|region| wanted.iter().filter(|label| **label == Some(region)).count() as u32)
                    .collect();
                assert_eq!(regions.size_px, size_px);
                assert_eq!((0..height).map(|v| regions.runs.row(v).len()).sum::<usize>(), regions.runs.all.len());
            }
        }
    }
}
