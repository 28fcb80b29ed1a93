//! Which pixels have one candidate alone that passes the back-projection test.

use crate::simd::{Kernel, LANES, Lanes};

use super::super::candidates::Candidate;
use super::super::grid::{ones, words};
use super::super::search::Row;

/// Which δ of a block lie within bounds, a bit each.
pub(super) struct Within<'a> {
    pub(super) delta: &'a [i16],
    pub(super) block: usize,
    /// Least and greatest.
    pub(super) bounds: [i16; 2],
}

impl Kernel for Within<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u32 {
        within(lanes, words(self.delta, self.block * LANES), self.bounds)
    }
}

#[inline(always)]
fn within<L: Lanes>(lanes: L, delta: &[u16; LANES], [least, greatest]: [i16; 2]) -> u32 {
    let delta = lanes.load(delta);
    let below = lanes.bits(lanes.is_greater(lanes.word(least), delta));
    !(below | lanes.bits(lanes.is_greater(delta, lanes.word(greatest))))
}

/// Counts the candidates of the pixels of a row that pass, and makes the one that does so alone that of its pixel.
pub(super) struct UniqueInRow<'a> {
    pub(super) candidates: Row<'a>,
    /// Least and greatest δ that pass.
    pub(super) gate_bounds: [i16; 2],
    /// A bit a place: one candidate passes.
    pub(super) unique: &'a mut [u32],
    /// Candidates of each pixel that pass.
    pub(super) passing: &'a mut [u8],
}

impl Kernel for UniqueInRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { mut candidates, gate_bounds, unique, passing } = self;
        let [zero, one] = [lanes.word(0), lanes.word(1)];
        for (b, passing) in passing.chunks_mut(LANES).enumerate() {
            let (any, several) = (candidates.any[b + 1], candidates.several[b + 1]);
            let mut alone = any & !several;
            if alone != 0 {
                alone &= within(lanes, words(candidates.delta, (b + 1) * LANES), gate_bounds);
            }
            let counts = lanes.select(lanes.mask(alone), one, zero);
            match passing.first_chunk_mut() {
                Some(passing) => lanes.store_bytes(counts, passing),
                None => {
                    let mut of_block = [0; LANES];
                    lanes.store_bytes(counts, &mut of_block);
                    passing.copy_from_slice(&of_block[..passing.len()]);
                }
            }
            if several != 0 {
                alone |= unique_of_several(&mut candidates, b, gate_bounds, passing);
            }
            unique[b + 1] = alone;
        }
    }
}

/// The same of the pixels of a block that have several candidates; those of which one passes.
fn unique_of_several(candidates: &mut Row<'_>, b: usize, [least, greatest]: [i16; 2], passing: &mut [u8]) -> u32 {
    let mut unique = 0;
    for k in ones(candidates.several[b + 1]) {
        let u = b * LANES + k;
        let number = candidates.number(u);
        let passes = |(_, candidate): &(u8, &Candidate)| (least..=greatest).contains(&candidate.delta);
        let mut all = (0..).zip(candidates.lists.of(number)).filter(passes);
        let first = all.next();
        passing[k] = u8::from(first.is_some()) + all.count() as u8;
        if let Some((of_list, _)) = first.filter(|_| passing[k] == 1) {
            candidates.lists.decided_for[number] = of_list;
            candidates.decide(u);
            unique |= 1 << k;
        }
    }
    unique
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use crate::simd::{self, Level};

    use super::super::super::grid::bit;
    use super::super::test_scene::TestScene;
    use super::*;

    #[test]
    fn candidates_that_pass_are_counted_as_one_by_one() {
        let (width, height) = (150, 60);
        let (least, greatest) = (-120, 210);
        for level in Level::ALL {
            let mut scene = TestScene::new(width, height);
            let grid = scene.continuity.grid;
            let lists: Vec<Vec<i16>> = (0..width * height)
                .map(|pixel| scene.candidates.of(pixel).iter().map(|candidate| candidate.delta).collect())
                .collect();
            // The candidate that the pixels of the scene with one alone stand for may be another.
            let alone = |pixel: usize| !bit(&scene.candidates.several, grid.place(pixel));
            let expected: Vec<u8> = lists
                .iter()
                .map(|list| list.iter().filter(|delta| (least..=greatest).contains(*delta)).count() as u8)
                .collect();
            let is_alone: Vec<bool> = (0..width * height).map(alone).collect();
            let mut unique = vec![0; grid.all_blocks()];
            let mut passing = vec![7; width * height];
            let rows = scene.candidates.rows().zip(grid.rows(&mut unique).par_chunks_mut(grid.blocks));
            rows.zip(passing.par_chunks_mut(width)).for_each(|((candidates, unique), passing)| {
                simd::run(level, UniqueInRow { candidates, gate_bounds: [least, greatest], unique, passing });
            });
            assert_eq!(passing, expected);
            for (pixel, passing) in passing.into_iter().enumerate() {
                let place = grid.place(pixel);
                assert_eq!(bit(&unique, place), passing == 1);
                let delta = scene.candidates.delta[place];
                assert!(passing != 1 || is_alone[pixel] || (least..=greatest).contains(&delta));
            }
        }
    }
}
