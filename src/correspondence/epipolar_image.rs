//! The phase of C2 resampled into the epipolar frame, where every epipolar segment is part of a row.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::patches::PATCH_PX;
use super::segment_table::SegmentTable;
use super::source_map::{PLACE_BITS, SourceRow};

/// Largest phase difference between neighbours that are taken for one surface, turns · 65536: three eighths of a turn, the
/// phase of fringes of little more than two and a half pixels.
pub(super) const MAX_NEIGHBOUR_STEP: i32 = 24576;
/// Largest difference of the steps along opposite sides of four pixels that are taken for one surface (33°). Where
/// surfaces meet, the wrapped phase jumps by anything, and few jumps are alike on both sides.
const MAX_TWIST: i32 = 6000;
/// Parts of a pixel in which places are counted.
const PARTS: i32 = 1 << PLACE_BITS;

/// Wrapped phase of C2 in the epipolar frame, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpipolarImage {
    /// Width, pixels.
    pub width: usize,
    /// Wrapped phase, turns · 65536; [`Self::NO_PHASE`] where there is none.
    pub phase: Vec<u16>,
}

impl EpipolarImage {
    /// Stands where there is no phase. A phase that happens to equal it is a step less, 1e-4 rad.
    pub const NO_PHASE: u16 = u16::MAX;

    /// Resamples a phase map of C2; `None` if it has another size than the table was built for.
    #[must_use]
    pub fn resample(map: &PhaseMap, table: &SegmentTable) -> Option<Self> {
        let mut image = Self::default();
        image.resample_into(map, table).then_some(image)
    }

    /// Resamples a phase map of C2 into the room of another image; tells whether it has the size that the table was built
    /// for, and else leaves the image as it is.
    ///
    /// The four neighbours are mixed bilinearly where all are valid and of one surface, else the nearest one is taken:
    /// mixing across a jump would invent phases that no surface has. On a steep surface, where opposite sides show the
    /// same large step, the nearest one alone would err by half of it.
    #[must_use]
    pub fn resample_into(&mut self, map: &PhaseMap, table: &SegmentTable) -> bool {
        if [map.width, map.height] != table.cam2_size_px {
            return false;
        }
        let [width, height] = table.epipolar_size_px;
        self.width = width;
        self.phase.resize(width * height, Self::NO_PHASE);
        self.phase.par_chunks_mut(width).enumerate().for_each(|(row, phase)| {
            resample_row(map, table.sources.row(row), phase);
        });
        true
    }

    /// Takes a phase off everywhere, turns · 65536.
    pub(super) fn turn_back(&mut self, by: u16) {
        for phase in self.phase.iter_mut().filter(|phase| **phase != Self::NO_PHASE) {
            *phase = marked(phase.wrapping_sub(by));
        }
    }
}

/// A phase that is not taken for none.
#[inline(always)]
fn marked(phase: u16) -> u16 {
    phase.min(EpipolarImage::NO_PHASE - 1)
}

fn resample_row(map: &PhaseMap, sources: SourceRow<'_>, out: &mut [u16]) {
    for (patch, out) in out.chunks_mut(PATCH_PX).enumerate() {
        let [columns, rows] = sources.patch(patch);
        for (i, phase) in out.iter_mut().enumerate() {
            *phase = mix(map, [columns[i], rows[i]]).map_or(EpipolarImage::NO_PHASE, marked);
        }
    }
}

/// Phase at a place between four pixels, column and row in 1/2048 pixel.
#[inline]
fn mix(map: &PhaseMap, place: [i32; 2]) -> Option<u16> {
    let [u, v] = place.map(|parts| parts >> PLACE_BITS);
    if u < 0 || v < 0 || u >= map.width as i32 - 1 || v >= map.height as i32 - 1 {
        return None;
    }
    let first = v as usize * map.width + u as usize;
    let corners = [first, first + 1, first + map.width, first + map.width + 1];
    let [right, below] = place.map(|parts| parts & (PARTS - 1));
    let nearest = corners[usize::from(right >= PARTS / 2) + 2 * usize::from(below >= PARTS / 2)];
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
        // Unwrapped from the upper left corner, the phase of all four runs on. With the limits above 32 bits hold it all,
        // if five of the 22 bits after the point go first.
        let down = at_left * PARTS + (bottom - top) * right;
        let rise = top * right + (((down >> 6) * below) >> 5);
        return Some(upper_left.wrapping_add(((rise + PARTS / 2) >> PLACE_BITS) as u16));
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
        assert_eq!(mix(&map([65000, 536, 65000, 536], [true; 4]), [1024, 0]), Some(0));
    }

    #[test]
    fn short_fringes_of_a_steep_surface_are_mixed() {
        let middle = [1024, 1024];
        // 0.31 and 0.15 turns from pixel to pixel: the far corners are half a turn apart.
        assert_eq!(mix(&map([0, 20000, 10000, 30000], [true; 4]), middle), Some(15000));
        assert_eq!(mix(&map([0, 20000, 10000, 40000], [true; 4]), middle), Some(40000));
    }

    #[test]
    fn jumps_and_invalid_neighbours_leave_the_nearest() {
        let left = [312, 0];
        assert_eq!(mix(&map([100, 30000, 100, 30000], [true; 4]), left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [true, false, true, true]), left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [false, true, true, true]), left), None);
    }

    #[test]
    fn a_place_outside_the_image_has_no_phase() {
        let map = map([100; 4], [true; 4]);
        for outside in [[-1, 0], [0, -1], [2048, 0], [0, 2048], [i32::MAX, 0], [0, i32::MIN]] {
            assert_eq!(mix(&map, outside), None);
        }
        assert_eq!(mix(&map, [2047, 2047]), Some(100));
    }

    #[test]
    fn a_phase_is_never_taken_for_none() {
        let mut image = EpipolarImage { width: 3, phase: vec![7, EpipolarImage::NO_PHASE, 10] };
        image.turn_back(8);
        assert_eq!(image.phase, [EpipolarImage::NO_PHASE - 1, EpipolarImage::NO_PHASE, 2]);
    }
}
