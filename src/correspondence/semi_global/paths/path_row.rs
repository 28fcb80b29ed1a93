//! Path costs of a row of pixels in one direction.

use fringeflow_simd::Lanes;

use crate::correspondence::semi_global::links::{Link, MAX_SHIFT, NO_PLACE};
use crate::correspondence::semi_global::order_ranges::{LANE_STEP, MAX_LANES};

use super::settled::{CHANGE, SETTLED, place_of_zero, settled};

/// Path costs of a row of pixels in one direction, the least of each pixel subtracted, none above the price of a
/// change.
#[derive(Clone, Debug, Default)]
pub(super) struct PathRow {
    /// Places of the orders on which pixels are settled; [`NO_PLACE`] for pixels with costs.
    pub(super) places: Vec<u8>,
    /// With a margin on either side of each pixel, for shifted ranges of neighbours.
    costs: Vec<u8>,
}

impl PathRow {
    /// Resets to no costs.
    pub(super) fn clear(&mut self, width: usize, lanes: usize) {
        self.places.clear();
        self.places.resize(width, NO_PLACE);
        self.costs.clear();
        self.costs.resize(width * (lanes + 2 * MAX_SHIFT), CHANGE as u8);
        // Behind them the costs of a settled pixel, and zeros for pixels without link: then one index selects among the
        // three.
        self.costs.extend_from_slice(&SETTLED);
        self.costs.extend_from_slice(&[0; MAX_LANES]);
    }

    /// The costs that a path brings along a link.
    #[inline(always)]
    pub(super) fn costs_along(&self, Link { is_link, column, shift }: Link, lanes: usize) -> &[u8] {
        let (place, of_settled) = (self.places[column], self.costs.len() - MAX_LANES - SETTLED.len());
        let own = column * (lanes + 2 * MAX_SHIFT) + shift;
        let begin = if place == NO_PLACE { own } else { of_settled + MAX_LANES + shift - usize::from(place) };
        let begin = if is_link { begin } else { of_settled + SETTLED.len() };
        &self.costs[begin..][..lanes]
    }

    /// Stores the costs of a pixel; the least is zero. Free of branches: whether they are settled is unpredictable.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(&mut self, level: L, u: usize, costs: &[u16]) {
        let lanes = costs.len();
        let own = &mut self.costs[u * (lanes + 2 * MAX_SHIFT) + MAX_SHIFT..][..lanes];
        let mut place = 0;
        let steps = own.as_chunks_mut::<LANE_STEP>().0.iter_mut().zip(costs.as_chunks::<LANE_STEP>().0);
        for (step, (own, costs)) in steps.enumerate().rev() {
            let bytes = level.bytes_of(costs);
            *own = bytes.to_le_bytes();
            let of_step = place_of_zero(bytes);
            place = if of_step < LANE_STEP { step * LANE_STEP + of_step } else { place };
        }
        let differs = *own != *settled(place, MAX_SHIFT, lanes);
        // All bits set are [`NO_PLACE`].
        self.places[u] = place as u8 | u8::from(differs).wrapping_neg();
    }
}

const _: () = assert!(NO_PLACE == u8::MAX);

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
}
