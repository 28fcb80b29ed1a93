//! The phase of C2 resampled into the epipolar frame, where every epipolar segment is part of a row.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::segment_table::{SegmentTable, SourcePixel};

/// Largest phase difference between neighbours that are taken for one surface, turns · 65536: three eighths of a turn, the
/// phase of fringes of little more than two and a half pixels.
pub(super) const MAX_NEIGHBOUR_STEP: i32 = 24576;
/// Largest difference of the steps along opposite sides of four pixels that are taken for one surface (33°). Where
/// surfaces meet, the wrapped phase jumps by anything, and few jumps are alike on both sides.
const MAX_TWIST: i32 = 6000;

/// Wrapped phase of C2 in the epipolar frame, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpipolarImage {
    /// Width, pixels.
    pub width: usize,
    /// Wrapped phase, turns · 65536.
    pub phase: Vec<u16>,
    /// Whether there is a phase.
    pub valid: Vec<bool>,
}

impl EpipolarImage {
    /// Resamples a phase map of C2; `None` if it has another size than the table was built for.
    ///
    /// The four neighbours are mixed bilinearly where all are valid and of one surface, else the nearest one is taken:
    /// mixing across a jump would invent phases that no surface has. On a steep surface, where opposite sides show the
    /// same large step, the nearest one alone would err by half of it.
    #[must_use]
    pub fn resample(map: &PhaseMap, table: &SegmentTable) -> Option<Self> {
        if [map.width, map.height] != table.cam2_size_px {
            return None;
        }
        let width = table.epipolar_width;
        let mut image = Self { width, phase: vec![0; table.sources.len()], valid: vec![false; table.sources.len()] };
        let rows = image.phase.par_chunks_mut(width).zip(image.valid.par_chunks_mut(width));
        rows.zip(table.sources.par_chunks(width)).for_each(|((phase, valid), sources)| {
            for (i, source) in sources.iter().enumerate() {
                if let Some(p) = mix(map, source) {
                    phase[i] = p;
                    valid[i] = true;
                }
            }
        });
        Some(image)
    }
}

/// Phase at a place between four pixels.
#[inline]
fn mix(map: &PhaseMap, source: &SourcePixel) -> Option<u16> {
    if source.index == SourcePixel::OUTSIDE {
        return None;
    }
    let first = source.index as usize;
    let corners = [first, first + 1, first + map.width, first + map.width + 1];
    let (right, below) = (i64::from(source.right), i64::from(source.below));
    let nearest = corners[usize::from(right >= 32768) + 2 * usize::from(below >= 32768)];
    let [upper_left, upper_right, lower_left, lower_right] = corners.map(|corner| map.phase[corner]);
    let step = |from: u16, to: u16| i32::from(to.wrapping_sub(from) as i16);
    let (top, bottom) = (step(upper_left, upper_right), step(lower_left, lower_right));
    let (at_left, at_right) = (step(upper_left, lower_left), step(upper_right, lower_right));
    let is_small = |step: i32| step.abs() <= MAX_NEIGHBOUR_STEP;
    let smooth = corners.into_iter().all(|corner| map.valid[corner])
        && [top, bottom, at_left, at_right].into_iter().all(is_small)
        && (top - bottom).abs() <= MAX_TWIST
        && (at_left - at_right).abs() <= MAX_TWIST;
    if smooth {
        // Unwrapped from the upper left corner, the phase of all four runs on.
        let upper = i64::from(top) * right;
        let lower = (i64::from(at_left) << 16) + i64::from(bottom) * right;
        let sum = upper * (65536 - below) + lower * below;
        return Some(upper_left.wrapping_add(((sum + (1 << 31)) >> 32) as u16));
    }
    map.valid[nearest].then_some(map.phase[nearest])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(phase: [u16; 4], valid: [bool; 4]) -> PhaseMap {
        PhaseMap { width: 2, height: 2, phase: phase.to_vec(), valid: valid.to_vec(), ..PhaseMap::default() }
    }

    #[test]
    fn phases_are_mixed_across_the_wrap() {
        let middle = SourcePixel { index: 0, right: 32768, below: 0 };
        assert_eq!(mix(&map([65000, 536, 65000, 536], [true; 4]), &middle), Some(0));
    }

    #[test]
    fn short_fringes_of_a_steep_surface_are_mixed() {
        let middle = SourcePixel { index: 0, right: 32768, below: 32768 };
        // 0.31 and 0.15 turns from pixel to pixel: the far corners are half a turn apart.
        assert_eq!(mix(&map([0, 20000, 10000, 30000], [true; 4]), &middle), Some(15000));
        assert_eq!(mix(&map([0, 20000, 10000, 40000], [true; 4]), &middle), Some(40000));
    }

    #[test]
    fn jumps_and_invalid_neighbours_leave_the_nearest() {
        let left = SourcePixel { index: 0, right: 10000, below: 0 };
        assert_eq!(mix(&map([100, 30000, 100, 30000], [true; 4]), &left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [true, false, true, true]), &left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [false, true, true, true]), &left), None);
    }
}
