//! The pixels of a row at which all paths arrive settled on the same order.

use fringeflow_simd::{Kernel, Lanes};

use crate::correspondence::semi_global::cost_table::{DECIDED, MISSING};
use crate::correspondence::semi_global::links::{AXES, NO_PLACE, RowLinks};
use crate::correspondence::semi_global::matching_cost::BestRow;

use super::path_row::PathRow;

/// The pixels of a row at which all paths arrive settled, assuming that the paths along the row do.
#[derive(Clone, Debug, Default)]
pub(super) struct AgreedRow {
    /// Places on which all other paths arrive settled and which fit best; [`NO_PLACE`] where there is none.
    pub(super) places: Vec<u8>,
    /// 1 where a pixel can be skipped behind a settled one: the path along the row arrives settled on its place,
    /// provided that the pixel before is settled on its own; else 0.
    pub(super) is_skippable: Vec<u8>,
    /// Scratch for the places that each axis brings.
    carried: [Vec<u8>; AXES.len()],
}

impl AgreedRow {
    pub(super) fn resize(&mut self, width: usize) {
        for array in [&mut self.places, &mut self.is_skippable].into_iter().chain(&mut self.carried) {
            array.resize(width, NO_PLACE);
        }
    }

    /// Finds these pixels in a row from the row before; `count` is the number of orders of each pixel.
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

/// Finds the places of [`AgreedRow`].
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
        let Self { row: AgreedRow { places, is_skippable, carried }, links, before, count, best } = self;
        let width = count.len();
        for axis in 1..AXES.len() {
            links[axis].carry(&before[axis].places, &mut carried[axis]);
        }
        let [along, straight, left, right] = carried;
        let (straight, left, right) = (&straight[..width], &left[..width], &right[..width]);
        let (place, least) = (&best.place[..width], &best.least[..width]);
        let (places, is_skippable) = (&mut places[..width], &mut is_skippable[..width]);
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
            is_skippable[u] = u8::from((places[u] != NO_PLACE) & ((along[u] == places[u]) | (least[u] == DECIDED)));
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

    #[test]
    fn ones_are_counted_both_ways() {
        let mut bytes = vec![1; 100];
        assert_eq!([run_of_ones(&bytes, 3, true), run_of_ones(&bytes, 3, false)], [97, 4]);
        bytes[60] = 0;
        assert_eq!([run_of_ones(&bytes, 3, true), run_of_ones(&bytes, 99, false)], [57, 39]);
        assert_eq!([run_of_ones(&bytes, 60, true), run_of_ones(&bytes, 60, false)], [0, 0]);
    }
}
