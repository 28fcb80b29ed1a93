//! The phase of C2 resampled into the epipolar frame, where every epipolar segment is part of a row.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::segment_table::{SegmentTable, SourcePixel};

/// Largest phase difference between neighbours that are taken for one surface, turns · 65536 (a quarter turn).
pub(super) const MAX_NEIGHBOUR_STEP: i32 = 16384;

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
    /// mixing across a jump would invent phases that no surface has.
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
    let base = map.phase[nearest];
    let weights = [(65536 - right) * (65536 - below), right * (65536 - below), (65536 - right) * below, right * below];
    let (mut sum, mut smooth) = (0, true);
    for (corner, weight) in corners.into_iter().zip(weights) {
        let step = map.phase[corner].wrapping_sub(base) as i16;
        smooth &= map.valid[corner] && i32::from(step).abs() <= MAX_NEIGHBOUR_STEP;
        sum += weight * i64::from(step);
    }
    if smooth {
        return Some(base.wrapping_add(((sum + (1 << 31)) >> 32) as u16));
    }
    map.valid[nearest].then_some(base)
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
    fn jumps_and_invalid_neighbours_leave_the_nearest() {
        let left = SourcePixel { index: 0, right: 10000, below: 0 };
        assert_eq!(mix(&map([100, 30000, 100, 30000], [true; 4]), &left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [true, false, true, true]), &left), Some(100));
        assert_eq!(mix(&map([100, 200, 100, 200], [false, true, true, true]), &left), None);
    }
}
