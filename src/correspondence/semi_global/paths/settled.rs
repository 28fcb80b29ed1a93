//! Settled paths: one order costs nothing, all others the price of a change.

use fringeflow_simd::{Kernel, Lanes};

use crate::correspondence::semi_global::links::{AXES, MAX_SHIFT, NO_PLACE, RowLinks};
use crate::correspondence::semi_global::matching_cost::{BestRow, DECIDED, MISSING};
use crate::correspondence::semi_global::order_ranges::MAX_LANES;

use super::{CHANGE, PathRow};

/// Costs of a settled pixel, with a margin on either side for shifted ranges.
pub(super) static SETTLED: [u8; 2 * (MAX_LANES + MAX_SHIFT)] = {
    let mut costs = [CHANGE as u8; 2 * (MAX_LANES + MAX_SHIFT)];
    costs[MAX_LANES + MAX_SHIFT] = 0;
    costs
};

/// The costs of a pixel settled on the order in `place`, `lanes` of them from `shift` on.
#[inline(always)]
pub(super) fn settled(place: usize, shift: usize, lanes: usize) -> &'static [u8] {
    &SETTLED[MAX_LANES + shift - place..][..lanes]
}

/// Index of the first zero byte, from the lowest on; 8 if there is none.
#[inline(always)]
pub(super) fn place_of_zero(bytes: u64) -> usize {
    // The subtraction borrows from the lowest zero byte first.
    let (lowest, highest) = (u64::MAX / 255, u64::MAX / 255 * 128);
    let zeros = bytes.wrapping_sub(lowest) & !bytes & highest;
    zeros.trailing_zeros() as usize / 8
}

/// What holds for the pixels of a row if the paths along the row come settled too.
#[derive(Clone, Debug, Default)]
pub(super) struct AgreedRow {
    /// Places on which all other paths come settled and which fit best; [`NO_PLACE`] where there is none.
    pub(super) places: Vec<u8>,
    /// 1 where the path along the row comes settled on that place, provided that the pixel before is settled on its
    /// own; else 0.
    pub(super) runs_on: Vec<u8>,
    /// Scratch for the places that each axis brings.
    carried: [Vec<u8>; AXES.len()],
}

impl AgreedRow {
    pub(super) fn resize(&mut self, width: usize) {
        for array in [&mut self.places, &mut self.runs_on].into_iter().chain(&mut self.carried) {
            array.resize(width, NO_PLACE);
        }
    }

    /// Finds them in a row from the row before; `count` is the number of orders of each pixel.
    #[inline(always)]
    pub(super) fn find<L: Lanes>(
        &mut self,
        level: L,
        links: &[RowLinks<'_>; AXES.len()],
        before: &[PathRow; AXES.len()],
        count: &[u8],
        best: BestRow<'_>,
    ) {
        AgreedKernel { row: self, links, before, count, best }.run(level);
    }
}

struct AgreedKernel<'a> {
    row: &'a mut AgreedRow,
    links: &'a [RowLinks<'a>; AXES.len()],
    before: &'a [PathRow; AXES.len()],
    count: &'a [u8],
    best: BestRow<'a>,
}

impl Kernel for AgreedKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { row: AgreedRow { places, runs_on, carried }, links, before, count, best } = self;
        let width = count.len();
        for axis in 1..AXES.len() {
            links[axis].carry(&before[axis].places, &mut carried[axis]);
        }
        let [along, straight, left, right] = carried;
        let (straight, left, right) = (&straight[..width], &left[..width], &right[..width]);
        let (place, least) = (&best.place[..width], &best.least[..width]);
        let (places, runs_on) = (&mut places[..width], &mut runs_on[..width]);
        for u in 0..width {
            let agreed = straight[u];
            // Straight and both diagonals must bring the same place, and the pixel itself must not prefer another.
            let is_agreed = (agreed == left[u])
                & (agreed == right[u])
                & (agreed < count[u])
                & ((agreed == place[u]) | (least[u] == MISSING));
            let agreed = if is_agreed { agreed } else { NO_PLACE };
            places[u] = if least[u] == DECIDED { place[u] } else { agreed };
        }
        links[0].carry(places, along);
        let along = &along[..width];
        for u in 0..width {
            runs_on[u] = u8::from((places[u] != NO_PLACE) & ((along[u] == places[u]) | (least[u] == DECIDED)));
        }
    }
}

/// Number of ones in sequence from a place on, upwards or downwards.
#[inline(always)]
pub(super) fn run_of_ones(bytes: &[u8], from: usize, forward: bool) -> usize {
    const STEP: usize = 16;
    let is_one = |byte: &&u8| **byte == 1;
    if forward {
        let rest = &bytes[from..];
        let whole = STEP * rest.as_chunks::<STEP>().0.iter().take_while(|chunk| **chunk == [1; STEP]).count();
        whole + rest[whole..].iter().take_while(is_one).count()
    } else {
        let rest = &bytes[..=from];
        let whole = STEP * rest.as_rchunks::<STEP>().1.iter().rev().take_while(|chunk| **chunk == [1; STEP]).count();
        whole + rest[..rest.len() - whole].iter().rev().take_while(is_one).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_simd::Arrays;

    #[test]
    fn a_settled_pixel_has_one_order_and_others_at_the_price_of_a_change() {
        for lanes in [8, 24, 128] {
            for place in 0..lanes {
                let mut row = PathRow::default();
                row.clear(3, lanes);
                let mut costs = vec![CHANGE; lanes];
                costs[place] = 0;
                row.set(Arrays, 1, &costs);
                assert_eq!(usize::from(row.places[1]), place);
                let seen: Vec<u8> = costs.iter().map(|&cost| cost as u8).collect();
                assert_eq!(settled(place, MAX_SHIFT, lanes), seen);
                costs[(place + 3) % lanes] -= 1;
                row.set(Arrays, 1, &costs);
                assert_eq!(row.places[1], NO_PLACE);
            }
            assert!(settled(0, MAX_SHIFT + 1, lanes).iter().all(|&cost| cost == CHANGE as u8));
            assert_eq!(settled(2, MAX_SHIFT + 1, lanes)[1], 0);
        }
    }

    #[test]
    fn the_first_zero_is_found() {
        let place = |bytes: [u8; 8]| place_of_zero(u64::from_le_bytes(bytes));
        assert_eq!(place([1, 0, 255, 0, 3, 1, 0, 7]), 1);
        assert_eq!(place([1, 128, 255, 1, 3, 1, 9, 0]), 7);
        assert_eq!(place([1, 128, 255, 1, 3, 1, 9, 2]), 8);
    }

    #[test]
    fn ones_are_counted_both_ways() {
        let mut bytes = vec![1; 100];
        assert_eq!([run_of_ones(&bytes, 3, true), run_of_ones(&bytes, 3, false)], [97, 4]);
        bytes[60] = 0;
        assert_eq!([run_of_ones(&bytes, 3, true), run_of_ones(&bytes, 99, false)], [57, 39]);
        assert_eq!([run_of_ones(&bytes, 60, true), run_of_ones(&bytes, 60, false)], [0, 0]);
    }
}
