//! Regions of pixels whose absolute phases run on from one to the next.

use super::super::neighbourhood::{Decided, MAX_STEP, UNDECIDED, neighbours};

/// A pixel without region.
const NONE: u32 = u32::MAX;

/// Division of the decided pixels into regions.
pub(super) struct Regions {
    label: Vec<u32>,
    /// Pixels of each region.
    pub(super) sizes: Vec<u32>,
    width: usize,
}

impl Regions {
    /// Regions of an image: neighbours belong together if their absolute phases run on and their δ differ by no more than
    /// `tolerance`.
    pub(super) fn of(decided: Decided<'_>, tolerance: i32, width: usize) -> Self {
        let absolute = decided.absolute;
        let mut regions = Self { label: vec![NONE; absolute.len()], sizes: Vec::new(), width };
        let mut frontier = Vec::new();
        for seed in 0..absolute.len() {
            if absolute[seed] != UNDECIDED && regions.label[seed] == NONE {
                let size = regions.fill(seed, decided, tolerance, &mut frontier);
                regions.sizes.push(size);
            }
        }
        regions
    }

    /// Region of a pixel, if it is decided.
    #[inline]
    pub(super) fn region_of(&self, pixel: usize) -> Option<usize> {
        let label = self.label.get(pixel).copied().unwrap_or(NONE);
        (label != NONE).then_some(label as usize)
    }

    /// Labels all pixels connected to `seed`; yields how many.
    fn fill(&mut self, seed: usize, decided: Decided<'_>, tolerance: i32, frontier: &mut Vec<usize>) -> u32 {
        let Decided { absolute, delta } = decided;
        let label = self.sizes.len() as u32;
        self.label[seed] = label;
        frontier.push(seed);
        let mut size = 0;
        while let Some(pixel) = frontier.pop() {
            size += 1;
            for next in neighbours(pixel, self.width, absolute.len()).into_iter().flatten() {
                let linked = absolute[next] != UNDECIDED
                    && (absolute[next] - absolute[pixel]).abs() <= MAX_STEP
                    && (i32::from(delta[next]) - i32::from(delta[pixel])).abs() <= tolerance;
                if linked && self.label[next] == NONE {
                    self.label[next] = label;
                    frontier.push(next);
                }
            }
        }
        size
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::neighbourhood::TURN;
    use super::*;

    #[test]
    fn regions_end_where_the_absolute_phase_or_delta_jumps() {
        let absolute = [0, 6000, 12000, UNDECIDED, 18000, 18000 + TURN, 25000 + TURN, 31000 + TURN];
        let delta = [0, 0, 5, 0, 0, 0, 9, 50];
        let regions = Regions::of(Decided { absolute: &absolute, delta: &delta }, 10, absolute.len());
        assert_eq!(regions.sizes, [3, 1, 2, 1]);
        assert_eq!(regions.region_of(3), None);
        assert_eq!(regions.region_of(6), regions.region_of(5));
    }
}
