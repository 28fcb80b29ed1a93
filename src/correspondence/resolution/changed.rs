//! Where in the image decisions have changed, so that nobody is asked twice about what stayed as it was.

use super::super::grid::Grid;
use super::continuity::Axis;
use super::opinions::Directions;

/// A bit a place: where decisions changed since each kind of their neighbours were last asked.
#[derive(Clone, Debug, Default)]
pub(super) struct Unheard {
    /// Open pixels, along the epipolar direction.
    pub(super) along: Vec<u32>,
    /// Open pixels, across it too.
    pub(super) across: Vec<u32>,
    /// Decided pixels, for contradictions.
    pub(super) by_decided: Vec<u32>,
}

impl Unheard {
    /// Open pixels have not been asked yet; decided ones have.
    pub(super) fn by_open(&mut self, grid: Grid) {
        for bits in [&mut self.along, &mut self.across, &mut self.by_decided] {
            bits.resize(grid.all_blocks(), 0);
        }
        self.along.fill(u32::MAX);
        self.across.fill(u32::MAX);
        self.by_decided.fill(0);
    }

    pub(super) fn of(&mut self, directions: Directions) -> &mut Vec<u32> {
        match directions {
            Directions::Along => &mut self.along,
            Directions::AlongAndAcross => &mut self.across,
        }
    }
}

/// Where decisions changed.
#[derive(Clone, Copy)]
pub(super) struct Changed<'a> {
    pub(super) grid: Grid,
    /// A bit a place.
    pub(super) bits: &'a [u32],
}

impl Changed<'_> {
    /// The pixels of a block of the image from which walks of so many pixels, 15 at most, along some axes may come to a change,
    /// or that changed themselves.
    #[inline]
    pub(super) fn around(&self, block: usize, axes: &[Axis], reach: u32) -> u32 {
        axes.iter().fold(0, |near, axis| {
            near | match axis {
                Axis::Row => self.in_row(block, reach),
                Axis::Column => self.in_columns(block, reach as usize),
            }
        })
    }

    #[inline]
    fn in_row(&self, block: usize, reach: u32) -> u32 {
        let [before, here, after] = [block - 1, block, block + 1].map(|block| u64::from(self.bits[block]));
        // From the sixteenth place before the block to the sixteenth after it.
        let changed = before >> 16 | here << 16 | after << 48;
        if changed == 0 {
            return 0;
        }
        let (mut left, mut right, mut covered) = (changed, changed, 1);
        while covered <= reach {
            let step = covered.min(reach + 1 - covered);
            left |= left >> step;
            right |= right << step;
            covered += step;
        }
        ((left | right) >> 16) as u32
    }

    #[inline]
    fn in_columns(&self, block: usize, reach: usize) -> u32 {
        let stride = self.grid.blocks;
        let first = block - reach.min(block / stride) * stride;
        let rows = self.bits[first..].iter().step_by(stride).take((block - first) / stride + reach + 1);
        rows.fold(0, |near, bits| near | bits)
    }
}

#[cfg(test)]
mod tests {
    use crate::simd::LANES;

    use super::super::super::grid::bit;
    use super::super::continuity::FAR;
    use super::*;

    #[test]
    fn whoever_a_walk_can_bring_to_a_change_is_told_and_nobody_else() {
        let (width, height) = (150, 60);
        let grid = Grid::new([width, height]);
        for (u, v) in [(0, 0), (33, 17), (64, 30), (width - 1, height - 1)] {
            let mut bits = vec![0; grid.all_blocks()];
            let place = grid.place(v * width + u);
            bits[place / LANES] |= 1 << (place % LANES);
            let changed = Changed { grid, bits: &bits };
            for (axes, reach) in [(&[Axis::Row][..], FAR), (&[Axis::Column], 3), (&[Axis::Row, Axis::Column], FAR)] {
                let mut told = vec![0; grid.all_blocks()];
                grid.blocks_of_image().for_each(|block| told[block] = changed.around(block, axes, reach));
                for (of_u, of_v) in (0..width).flat_map(|u| (0..height).map(move |v| (u, v))) {
                    let (du, dv) = (of_u.abs_diff(u), of_v.abs_diff(v));
                    let on_a_walk = |axis: &Axis| match axis {
                        Axis::Row => dv == 0 && du <= reach as usize,
                        Axis::Column => du == 0 && dv <= reach as usize,
                    };
                    let is_told = bit(&told, grid.place(of_v * width + of_u));
                    assert_eq!(is_told, axes.iter().any(on_a_walk), "{u} {v}: {of_u} {of_v}");
                }
            }
        }
    }
}
